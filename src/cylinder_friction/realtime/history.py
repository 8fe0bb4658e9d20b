"""Features of the past motion, on which friction depends: dwell, travel and time since the last reversal."""

from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled, compiled_part
from cylinder_friction.signals.backlash import AGE, CENTRE, DIRECTION, new_backlash, push

HISTORY_NAMES = ("direction", "dwell", "dwell_before", "travel_short", "travel_long", "moving_time")
BACKLASH, MOVES, DWELL, TRAVEL_SHORT, TRAVEL_LONG, MOVING = range(6)  # Places in ``History.settings``
TOLERANCE_M = 1e-7
"""A position beyond the backlash by less than this is a rounding error, even in single precision, and no push: moving
averages of the same values differ in the last digit with the order of the sum."""


@dataclass(frozen=True, eq=False)
class History:
    """Six features of the motion so far, from a smoothed position; see ``history_step``."""

    position_feature: int  # Index of the linear feature that is the smoothed position [m], before scaling
    # Subtracted from each history feature, then divided by, shape ``(6,)``
    mean: Array
    scale: Array
    # Half-width of the backlash operator on the smoothed position [m], about three times the noise of a smoothed 12-bit
    # potentiometer. A velocity threshold would mistake noise for motion, and miss creep
    backlash_m: float = 4e-5
    moves_s: float = 0.05  # The piston moves while its last push against the backlash is at most this old [s]
    dwell_s: float = 0.1  # Time scale of the logarithm of the dwells [s]
    # Travels over which the travel features saturate [m]
    travel_short_m: float = 2e-4
    travel_long_m: float = 5e-3
    moving_s: float = 0.2  # Time over which the time of motion saturates [s]

    def settings(self) -> Array:
        """Pack the settings of ``history_step``, shape ``(6,)``, at the places named in this module."""
        lengths = (self.travel_short_m, self.travel_long_m)
        return np.array([self.backlash_m, self.moves_s, self.dwell_s, *lengths, self.moving_s])

    def to_dict(self) -> dict[str, Any]:
        return asdict(self) | {"mean": self.mean.tolist(), "scale": self.scale.tolist()}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return cls(**content | {"mean": np.array(content["mean"]), "scale": np.array(content["scale"])})


def new_history() -> Array:
    """Make the state before the first position, shape ``(7,)``.

    It holds the dwell [s], the dwell before the present motion [s], the position of the last reversal or start [m] (NaN
    before the first position), the time of motion [s], and the state of the backlash operator.
    """
    return np.concatenate([[0.0, 0.0, np.nan, 0.0], new_backlash()])


@compiled_part
def history_step(position_m: float, state: Array, settings: Array, sample_time_s: float, result: Array) -> None:
    """Take the next smoothed position: update ``state`` (see ``new_history``) and fill ``result``, shape ``(6,)``.

    The results are the direction of the last motion, the logarithms of the present dwell and of the dwell before this
    motion, the travel since the last reversal or start (saturated over a short and over a long distance), and the time
    of motion.
    """
    backlash = state[4:]
    before = backlash[DIRECTION]
    if np.isnan(state[2]):
        state[2] = position_m
    if abs(position_m - backlash[CENTRE]) <= settings[BACKLASH] + TOLERANCE_M:
        backlash[AGE] += sample_time_s
        pushed = False
    else:
        pushed = push(position_m, backlash, settings[BACKLASH], 0.0, sample_time_s)
    if pushed and (backlash[DIRECTION] != before or state[0] > 0.0):
        state[1], state[2], state[3] = state[0], position_m, 0.0
    if backlash[AGE] < settings[MOVES]:
        state[0] = 0.0
        state[3] += sample_time_s
    else:
        state[0] += sample_time_s
    travel = abs(position_m - state[2])
    result[0] = backlash[DIRECTION]
    result[1] = np.log1p(state[0] / settings[DWELL])
    result[2] = np.log1p(state[1] / settings[DWELL])
    result[3] = 1.0 - np.exp(-travel / settings[TRAVEL_SHORT])
    result[4] = 1.0 - np.exp(-travel / settings[TRAVEL_LONG])
    result[5] = 1.0 - np.exp(-state[3] / settings[MOVING])


@compiled
def history_rows(position_m: Array, state: Array, settings: Array, sample_time_s: float) -> Array:
    """Run ``history_step`` at each position, shape ``(n, 6)``; updates ``state``."""
    result = np.empty((position_m.shape[0], 6))
    for row in range(position_m.shape[0]):
        history_step(position_m[row], state, settings, sample_time_s, result[row])
    return result

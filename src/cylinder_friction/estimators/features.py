"""What a learned estimator sees of any set of sensors: filtered signals, and how the piston came to where it is.

The linear part is a ``FrontEnd``. The rest is the memory that friction has and a filter has not: how long the piston
has been at rest, how far and how long it has moved since the last reversal, and which way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numba
import numpy as np

from cylinder_friction.estimators.front_end import (
    FrontEnd,
    FrontEndBlock,
    FrontEndState,
    feature_rows,
    smoothed_force_balance_taps,
    standardisation,
    unscaled_front_end,
)
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.signals.backlash import AGE, DIRECTION, new_backlash, push

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import Array
    from cylinder_friction.recordings.recording import Recording

HISTORY_NAMES = ("direction", "dwell", "dwell_before", "travel_short", "travel_long", "moving_time")
PLAY_M = 4e-5
"""Half-width of a play that the smoothed position pushes before it [m], about three times the noise of a 12-bit
potentiometer so smoothed: a velocity threshold would take noise for motion several times a second, and miss creep."""
MOVES_S = 0.05
"""The piston moves while its last push against the play is no older [s]."""
DWELL_S = 0.1
TRAVEL_SHORT_M, TRAVEL_LONG_M = 2e-4, 5e-3
MOVING_S = 0.2


@dataclass(frozen=True)
class Features:
    """The feature plan of one estimator.

    Attributes:
        inputs: Columns of a recording, in the order of its samples.
        front_end: Filters, scaling of all features, and the force that is corrected.
        mean, scale: Of the history, shape ``(6,)``.
        sample_time_s: Between two samples [s].
    """

    inputs: tuple[str, ...]
    front_end: FrontEnd
    mean: Array
    scale: Array
    sample_time_s: float

    @property
    def names(self) -> tuple[str, ...]:
        return self.front_end.names + HISTORY_NAMES

    @property
    def has_base(self) -> bool:
        """Whether there is a force balance to correct."""
        return self.front_end.base_taps is not None

    def to_dict(self) -> dict[str, Any]:
        return {
            "inputs": list(self.inputs),
            "front_end": self.front_end.to_dict(),
            "history_mean": self.mean.tolist(),
            "history_scale": self.scale.tolist(),
            "sample_time_s": self.sample_time_s,
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return cls(
            tuple(content["inputs"]),
            FrontEnd.from_dict(content["front_end"]),
            np.array(content["history_mean"]),
            np.array(content["history_scale"]),
            content["sample_time_s"],
        )


@dataclass
class FeatureState:
    """State of the filters, and of the history: see ``_history``."""

    front_end: FrontEndState
    history: Array


class FeatureBlock:
    """Samples, shape ``(n, inputs)``, to standardised features and the force they correct; causal, cut anywhere."""

    def __init__(self, features: Features) -> None:
        self.features = features
        self._linear = FrontEndBlock(features.front_end)
        self._smooth = features.front_end.names.index("position_m_20")

    def new_state(self) -> FeatureState:
        return FeatureState(self._linear.new_state(), _new_history())

    def advance(self, state: FeatureState, samples: Array) -> tuple[Any, Array]:
        """Return features, shape ``(n, k)``, float32, and the force balance to correct [N], shape ``(n,)``."""
        linear, base_n = self._linear.advance(state.front_end, samples)
        plan = self.features
        smooth_m = linear[:, self._smooth] * plan.front_end.scale[self._smooth] + plan.front_end.mean[self._smooth]
        history = _history(smooth_m.astype(np.float64), state.history, plan.sample_time_s)
        scaled = ((history - plan.mean) / plan.scale).astype(np.float32)
        return np.concatenate([linear, scaled], axis=1), base_n

    def multiply_adds(self) -> int:
        return self._linear.multiply_adds() + 5 * len(HISTORY_NAMES)


def fit_features(inputs: Sequence[str], cylinder: Cylinder, recordings: Sequence[Recording]) -> Features:
    """Return the features of given inputs, their scaling learnt on the usable rows of these recordings alone.

    Where both raw pressures are among the inputs, the least-squares smoothed force balance is what will be corrected;
    where they are not, there is nothing to correct and the estimate begins at nought.

    Args:
        inputs: Columns; ``position_m`` must be one. Raw pressures give force balance and rates; every other column goes
            through a moving average of 20.
        cylinder: Its areas.
        recordings: Labelled, of one sample time.

    Raises:
        ValueError: There is no position among the inputs.
    """
    inputs = tuple(inputs)
    if "position_m" not in inputs:
        raise ValueError(f"expected position_m among the inputs, but got {inputs}")
    sample_time_s = recordings[0].sample_time_s
    rows = feature_rows(inputs, cylinder, sample_time_s)
    base = None
    if inputs[:3] == SAMPLE_COLUMNS:
        found = smoothed_force_balance_taps(cylinder, recordings)
        base = np.pad(found, ((0, 0), (0, len(inputs) - 3), (0, 0)))
    front_end = unscaled_front_end(rows, base)
    count, history = len(rows), len(HISTORY_NAMES)
    raw = Features(inputs, front_end, np.zeros(history), np.ones(history), sample_time_s)
    mean, scale = standardisation(FeatureBlock(raw), inputs, recordings)
    scaled = replace(front_end, mean=mean[:count], scale=scale[:count])
    return replace(raw, front_end=scaled, mean=mean[count:], scale=scale[count:])


def _new_history() -> Array:
    """Return the state before the first position, shape ``(7,)``: dwell [s], dwell before [s], place of the last
    reversal or start [m], NaN before the first position, time of motion [s]; then the play [m], its age in seconds."""
    return np.concatenate([[0.0, 0.0, np.nan, 0.0], new_backlash()])


@numba.njit(cache=True)
def _history(position_m: Array, state: Array, sample_time_s: float) -> Array:
    """Return, shape ``(n, 6)``: direction of the last motion; logarithms of the dwell so far and of the one before
    this motion; travel since the last reversal or start, saturating over 0.2 mm and over 5 mm; time of motion so far.

    State: from ``_new_history``, changed in place.
    """
    result = np.empty((position_m.shape[0], 6))
    play = state[4:]
    for row in range(position_m.shape[0]):
        at, before = position_m[row], play[DIRECTION]
        if np.isnan(state[2]):
            state[2] = at
        pushed = push(at, play, PLAY_M, 0.0, sample_time_s)
        if pushed and (play[DIRECTION] != before or state[0] > 0.0):
            state[1], state[2], state[3] = state[0], at, 0.0
        if play[AGE] < MOVES_S:
            state[0] = 0.0
            state[3] += sample_time_s
        else:
            state[0] += sample_time_s
        travel = abs(at - state[2])
        result[row, 0] = play[DIRECTION]
        result[row, 1] = np.log1p(state[0] / DWELL_S)
        result[row, 2] = np.log1p(state[1] / DWELL_S)
        result[row, 3] = 1.0 - np.exp(-travel / TRAVEL_SHORT_M)
        result[row, 4] = 1.0 - np.exp(-travel / TRAVEL_LONG_M)
        result[row, 5] = 1.0 - np.exp(-state[3] / MOVING_S)
    return result

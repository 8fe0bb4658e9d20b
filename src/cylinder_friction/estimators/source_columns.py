"""Which features the models of the related work are given: what their sources see, and what the task adds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from cylinder_friction.recordings import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.estimators.features import Features

VELOCITIES = ("velocity_m_s", "creep_velocity")
"""The velocity, straight and through a soft limit: the same signal, with room for what happens at creep."""

PLAY_M = 4e-5
"""Half-width of a play on the smoothed position, about three times its noise [m]: see ``MotionSide``."""

OF_PRESSURES = (
    "force_balance_n",
    "force_balance_4_n",
    "force_balance_12_n",
    "pressure_1_pa",
    "pressure_2_pa",
    "pressure_1_rate_pa_s",
)


def task_columns(features: Features) -> tuple[str, ...]:
    """Returns what the task lets a model see beside the motion: raw pressures' features, a temperature, a level."""
    pressures = OF_PRESSURES if features.has_base else ()
    others = tuple(f"{name}_20" for name in features.inputs if name not in SAMPLE_COLUMNS)
    return pressures + others


def places_of(features: Features, names: Sequence[str]) -> list[int]:
    """Returns the columns of features by their names."""
    return [features.names.index(name) for name in names]


class MotionSide:
    """Which way the piston moved last: -1, 0 before it first moved, or 1.

    The smoothed position pushes a play before it. A velocity threshold would do worse: at rest the noise of a 12-bit
    potentiometer passes 1 mm/s several times a second, and creep stays below it.
    """

    def __init__(self, features: Features) -> None:
        self._place = features.names.index("position_m_20")
        self._half_width = PLAY_M / float(features.front_end.scale[self._place])

    def new_state(self) -> NDArray[np.float64]:
        """Returns the centre of the play, in standard deviations of the position, and the side."""
        return np.array([np.nan, 0.0])

    def advance(self, state: NDArray[np.float64], features: NDArray[Any]) -> NDArray[np.float64]:
        """Returns the side, shape ``(n,)``, of the next rows of features; changes ``state``."""
        return _side(np.ascontiguousarray(features[:, self._place], dtype=np.float64), self._half_width, state)


@numba.njit(cache=True)
def _side(position: NDArray[np.float64], half_width: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
    result = np.empty(position.shape[0])
    for row in range(position.shape[0]):
        if np.isnan(state[0]):
            state[0] = position[row]
        if position[row] > state[0] + half_width:
            state[0], state[1] = position[row] - half_width, 1.0
        elif position[row] < state[0] - half_width:
            state[0], state[1] = position[row] + half_width, -1.0
        result[row] = state[1]
    return result

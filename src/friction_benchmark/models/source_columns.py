"""Which features the models of the related work are given: what their sources see, and what the task adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.estimators.features import Features

VELOCITIES = ("velocity_m_s", "creep_velocity")
"""The velocity, straight and through a soft limit: the same signal, with room for what happens at creep."""

OF_PRESSURES = (
    "force_balance_n",
    "force_balance_4_n",
    "force_balance_12_n",
    "pressure_1_pa",
    "pressure_2_pa",
    "pressure_1_rate_pa_s",
)


def task_columns(features: Features) -> tuple[str, ...]:
    """Return what the task lets a model see beside the motion: raw pressures' features, a temperature, a level."""
    pressures = OF_PRESSURES if features.has_base else ()
    others = tuple(f"{name}_20" for name in features.inputs if name not in SAMPLE_COLUMNS)
    return pressures + others


def places_of(features: Features, names: Sequence[str]) -> list[int]:
    """Return the columns of features by their names."""
    return [features.names.index(name) for name in names]


def last_motion(features: Features, rows: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return which way the piston moved last, shape ``(n,)``, by rows of features: -1, 0 before it first moved, or 1.

    Not standardised: a swarm that searches weights within a box does worse with a direction whose mean is taken off.
    """
    place = features.names.index("direction")
    in_history = place - len(features.front_end.names)
    return np.rint(rows[:, place] * features.scale[in_history] + features.mean[in_history])

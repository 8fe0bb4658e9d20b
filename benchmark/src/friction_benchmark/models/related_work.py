"""What the networks of the related work share: the features they are given, and the error they minimise."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from cylinder_friction.estimators.front_end import FrontEnd
from cylinder_friction.realtime.history import HISTORY_NAMES
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

VELOCITIES = ("velocity_m_s", "creep_velocity")
"""The velocity as it is, and through a soft limit: the same signal, with resolution for what happens at creep."""

OF_PRESSURES = (
    "force_balance_n",
    "force_balance_4_n",
    "force_balance_12_n",
    "pressure_1_pa",
    "pressure_2_pa",
    "pressure_1_rate_pa_s",
)
KNEE = 0.05  # Error, in standard deviations of the target, below which the cost turns from absolute to squared


def task_columns(features: FrontEnd) -> tuple[str, ...]:
    """Return what the task lets a model see beside the motion: raw pressures' features, a temperature, a level."""
    pressures = OF_PRESSURES if features.has_base else ()
    return pressures + tuple(f"{name}_20" for name in features.inputs if name not in SAMPLE_COLUMNS)


def places_of(features: FrontEnd, names: Sequence[str]) -> list[int]:
    """Return the columns of features by their names."""
    return [features.names.index(name) for name in names]


def last_motion(features: FrontEnd, rows: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the direction of the last motion, shape ``(n,)``: -1, 1, or 0 before the piston first moved.

    Not standardised: a swarm that searches weights within a box does worse with a direction without its mean.
    """
    assert features.history is not None
    place = HISTORY_NAMES.index("direction")
    column = rows[:, len(features.taps) + place]
    return np.rint(column * features.history.scale[place] + features.history.mean[place])


def smoothed_absolute(error: torch.Tensor) -> torch.Tensor:
    """Return ``sqrt(e² + knee²) - knee`` of each error: its absolute value, rounded at zero."""
    return (error**2 + KNEE**2).sqrt() - KNEE

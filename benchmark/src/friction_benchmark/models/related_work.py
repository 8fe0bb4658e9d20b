"""What the networks of the related work share: the features they are given, and the error they minimise."""

import numpy as np
import torch

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.history import HISTORY_NAMES
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.base import FeatureModel, Single

VELOCITIES = ("velocity_m_s", "creep_velocity")
"""The velocity as it is, and through a soft limit: the same signal, with resolution for what happens at creep."""
OF_PRESSURES = (
    "force_balance_n", "force_balance_4_n", "force_balance_12_n",
    "pressure_1_pa", "pressure_2_pa", "pressure_1_rate_pa_s",
)  # fmt: skip
KNEE = 0.05  # Error, in standard deviations of the target, below which the cost turns from absolute to squared


class MotionModel(FeatureModel):
    """A model that is given the motion, the direction of the last motion, and what else the task lets it see."""

    def named(self, features: Single, *names: str) -> Single:
        """Return features by their names, shape ``(n, names)``."""
        return features[:, [self.features.names.index(name) for name in names]]

    def others(self, features: Single) -> Single:
        """Return what the task shows beside the motion: raw pressures' features, a temperature, a pressure level."""
        pressures = OF_PRESSURES if self.features.has_base else ()
        slow = (f"{name}_20" for name in self.features.inputs if name not in SAMPLE_COLUMNS)
        return self.named(features, *pressures, *slow)

    def last_motion(self, features: Single) -> Array:
        """Return the direction of the last motion, shape ``(n,)``: -1, 1, or 0 before the piston first moved.

        Not standardised: a swarm that searches weights within a box does worse with a direction without its mean.
        """
        history = self.features.history
        assert history is not None
        place = HISTORY_NAMES.index("direction")
        column = features[:, len(self.features.taps) + place]
        return np.asarray(np.rint(column * history.scale[place] + history.mean[place]))


def smoothed_absolute(error: torch.Tensor) -> torch.Tensor:
    """Return ``sqrt(e² + knee²) - knee`` of each error: its absolute value, rounded at zero."""
    return (error**2 + KNEE**2).sqrt() - KNEE

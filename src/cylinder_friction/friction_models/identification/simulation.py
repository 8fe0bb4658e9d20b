"""Simulation of a friction model along labelled motions, for a search over its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numba
import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.friction_models.model import FrictionModel, log_speed_of


@dataclass(frozen=True)
class Motion:
    """The signals of one recording that a friction model reads, and its label."""

    velocity_m_s: Array  # The velocity that drives the model, dead band applied, shape ``(n,)``
    pressure_pa: Array  # The gauge pressure that scales dry friction, shape ``(n,)``
    friction_n: Array  # The label, shape ``(n,)``
    usable: Mask  # Rows whose label counts, shape ``(n,)``


@dataclass(frozen=True)
class Motions:
    """Several motions at one sample time, laid end to end for a compiled loop."""

    sample_time_s: float  # Time between two rows [s]
    # Shape ``(rows,)``
    velocity_m_s: Array
    log_speed: Array
    pressure_pa: Array
    friction_n: Array
    usable: Mask  # Rows whose label counts, shape ``(rows,)``
    starts: NDArray[np.int64]  # First row of each motion, then the number of rows, shape ``(motions + 1,)``
    model: FrictionModel  # The model that is simulated

    @classmethod
    def of(cls, motions: Sequence[Motion], sample_time_s: float, model: FrictionModel) -> Self:
        """Join motions; raise ``ValueError`` if no motion has a usable row."""
        if not motions or not any(motion.usable.any() for motion in motions):
            raise ValueError(
                f"identification: {len(motions)} motions without one usable row among them; "
                "check the mask that the label stage made"
            )
        velocity = np.concatenate([motion.velocity_m_s for motion in motions])
        return cls(
            sample_time_s=sample_time_s,
            velocity_m_s=velocity,
            log_speed=log_speed_of(velocity),
            pressure_pa=np.concatenate([motion.pressure_pa for motion in motions]),
            friction_n=np.concatenate([motion.friction_n for motion in motions]),
            usable=np.concatenate([motion.usable for motion in motions]),
            starts=np.cumsum([0, *(len(motion.velocity_m_s) for motion in motions)]).astype(np.int64),
            model=model,
        )

    @property
    def reference_pressure_pa(self) -> float:
        """Mean pressure of the usable rows, at least 1 Pa [Pa]."""
        return max(float(np.mean(self.pressure_pa[self.usable])), 1.0)

    @property
    def mean_friction_n(self) -> float:
        """Mean absolute label of the usable rows [N], the base of percentages."""
        return float(np.mean(np.abs(self.friction_n[self.usable])))

    def error_of(self, values: Array) -> float:
        """Compute the mean absolute difference between model and label over usable rows [N].

        ``values`` are the model's numbers in the order of its specs.
        """
        return self.difference_of(self.simulated(values))

    def difference_of(self, friction_n: Array) -> float:
        """Compute the mean absolute difference between this friction and the label over usable rows [N]."""
        return float(_mean_absolute_difference(friction_n, self.friction_n, self.usable))

    def simulated(self, values: Array) -> Array:
        """Compute the model's friction [N], shape ``(rows,)``, each motion from a fresh state."""
        friction_n = np.empty_like(self.velocity_m_s)
        for start, end in pairwise(self.starts):
            self.model.step_through(
                values,
                self.velocity_m_s[start:end],
                self.log_speed[start:end],
                self.pressure_pa[start:end],
                self.sample_time_s,
                self.model.new_state(),
                friction_n[start:end],
            )
        return friction_n


@numba.njit(cache=True)
def _mean_absolute_difference(first: Array, second: Array, counted: Mask) -> float:
    total, count = 0.0, 0
    for row in range(first.shape[0]):
        if counted[row]:
            total += abs(first[row] - second[row])
            count += 1
    return total / count

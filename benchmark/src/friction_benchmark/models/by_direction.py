"""Friction from the direction of the last motion alone: what an estimate without pressures has to beat.

``SteadyMotion`` separates motion from noise: its velocity is exactly zero at standstill.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.linear import labelled_rows
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.steady_motion import SteadyMotion, SteadyMotionState

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.recordings.recording import Recording

SITUATIONS = ("extending", "retracting", "at_rest_after_extending", "at_rest_after_retracting", "never_moved")


class ByDirectionEstimator(FrictionEstimator):
    """A straight line over velocity in each of five situations; a subclass finds it.

    Attributes:
        levels_n: Friction in each situation, at vanishing velocity, in the order of ``SITUATIONS`` [N].
        viscous_n_s_m: Slope over velocity [N s/m].

    Raises:
        ValueError: There is no position among the inputs.
    """

    def __init__(self, inputs: Sequence[str] = SAMPLE_COLUMNS) -> None:
        super().__init__(inputs)
        if "position_m" not in self.inputs:
            raise ValueError(f"expected position_m among the inputs, but got {self.inputs}")
        self.levels_n = np.zeros(len(SITUATIONS))
        self.viscous_n_s_m = 0.0
        self._block: SteadyMotion | None = None

    @abstractmethod
    def _learn(self, situation: NDArray[np.int64], velocity_m_s: Array, friction_n: Array) -> None:
        """Set levels and slope from the usable rows."""

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Find the levels on all usable rows; a situation that never occurs keeps 0 N."""
        self._begin_fit(recordings)
        labels, masks = labelled_rows(recordings)
        seen = [self._look(self.new_state(), recording.samples(self.inputs)) for recording in recordings]
        situation = np.concatenate([each[mask] for (each, _), mask in zip(seen, masks, strict=True)])
        velocity = np.concatenate([each[mask] for (_, each), mask in zip(seen, masks, strict=True)])
        self._learn(situation, velocity, labels)
        return self

    def new_state(self) -> SteadyMotionState:
        return self._motion().new_state()

    def advance(self, state: SteadyMotionState, samples: Array) -> Array:
        situation, velocity = self._look(state, samples)
        return self.levels_n[situation] + self.viscous_n_s_m * velocity

    def multiply_adds(self) -> int:
        return self._motion().multiply_adds() + 1

    def _look(self, state: SteadyMotionState, samples: Array) -> tuple[NDArray[np.int64], Array]:
        place = self.inputs.index("position_m")
        velocity, direction = self._motion().advance(state, samples[:, place : place + 1]).T
        rest = np.select([direction > 0.0, direction < 0.0], [2, 3], default=4)
        return np.select([velocity > 0.0, velocity < 0.0], [0, 1], default=rest), velocity

    def _motion(self) -> SteadyMotion:
        if self._block is None:
            assert self.sample_time_s is not None
            self._block = SteadyMotion(self.sample_time_s)
        return self._block

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - everything is JSON
        return {
            "levels_n": dict(zip(SITUATIONS, self.levels_n.tolist(), strict=True)),
            "viscous_n_s_m": self.viscous_n_s_m,
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003
        estimator = cls()
        estimator.levels_n = np.array([parameters["levels_n"][name] for name in SITUATIONS])
        estimator.viscous_n_s_m = parameters["viscous_n_s_m"]
        return estimator


class ConstantByDirectionEstimator(ByDirectionEstimator):
    """The median friction of each situation: of all constants the one with the smallest absolute error."""

    kind: ClassVar[str] = "constant_by_direction"

    def _learn(self, situation: NDArray[np.int64], velocity_m_s: Array, friction_n: Array) -> None:  # noqa: ARG002
        for number in range(len(SITUATIONS)):
            rows = situation == number
            self.levels_n[number] = np.median(friction_n[rows]) if rows.any() else 0.0
        self.viscous_n_s_m = 0.0


class CoulombViscousLineEstimator(ByDirectionEstimator):
    """Coulomb and viscous friction without Stribeck: least squares on direction and velocity."""

    kind: ClassVar[str] = "coulomb_viscous_line"

    def _learn(self, situation: NDArray[np.int64], velocity_m_s: Array, friction_n: Array) -> None:
        columns = [situation == number for number in range(len(SITUATIONS))]
        design = np.column_stack([*columns, velocity_m_s])
        found = np.linalg.lstsq(design.T @ design, design.T @ friction_n, rcond=None)[0]
        self.levels_n, self.viscous_n_s_m = found[:-1], float(found[-1])

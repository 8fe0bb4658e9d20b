"""LuGre as published comparisons use it: identified on one test alone; pressures only scale it, if at all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator, AnalyticalState
from cylinder_friction.friction_models.identification.procedure import SearchEffort
from cylinder_friction.friction_models.lugre import LUGRE_STEP_MULTIPLY_ADDS, LuGre, LugreParameters

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.friction_models.parameters import ModelParameters
    from cylinder_friction.signals.causal_velocity import CausalVelocity

    Array = NDArray[np.float64]

__all__ = [
    "LUGRE_STEP_MULTIPLY_ADDS",
    "AnalyticalState",
    "LugreEstimator",
    "PressureLugreEstimator",
    "scaling_pressure",
]


class LugreEstimator(AnalyticalEstimator):
    """LuGre identified on one test alone, as published comparisons do; at run time it sees position only.

    Args:
        cylinder: For the moving mass.
        test: The ``metadata.condition`` of the recordings that it is identified on.
        seed: Seed of the search.
        population: Members of differential evolution, a coordinate.
        generations: Greatest number of generations.
        simulated_recordings: How many recordings differential evolution simulates.
        velocity_dead_band_m_s: Slower counts as standstill, where no play tells it [m/s].
        damping_ratio: Damping ratio of the moving mass on the bristles.
        confidence: Probability of the confidence intervals.

    Attributes:
        parameters: The model; None before ``fit``.
    """

    kind: ClassVar[str] = "lugre"
    pressure_scaled: ClassVar[bool] = False

    parameters: LugreParameters | None

    def __init__(
        self,
        cylinder: Cylinder,
        condition: str = "1",
        seed: int = 0,
        population: int = 12,
        generations: int = 60,
        simulated_recordings: int = 4,
        velocity_dead_band_m_s: float = 1e-3,
        damping_ratio: float = 0.5,
        confidence: float = 0.95,
    ) -> None:
        super().__init__(
            cylinder,
            LuGre(self.pressure_scaled),
            condition=condition,
            effort=SearchEffort(seed, population, generations, simulated_recordings),
            velocity_dead_band_m_s=velocity_dead_band_m_s,
            damping_ratio=damping_ratio,
            confidence=confidence,
        )

    def _use(self, parameters: ModelParameters, sense: CausalVelocity) -> None:
        assert isinstance(parameters, LugreParameters)
        super()._use(parameters, sense)

    def _write(self, folder: Path) -> dict[str, Any]:
        content = super()._write(folder)
        kept = {key: value for key, value in content.items() if key not in ("friction_model", "inputs")}
        for entry in kept["model"].values():
            del entry["meaning"]
        return kept

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003 - everything is JSON
        estimator = cls(
            Cylinder(**parameters["cylinder"]),
            condition=parameters["condition"],
            velocity_dead_band_m_s=parameters["least_velocity_dead_band_m_s"],
            damping_ratio=parameters["damping_ratio"],
            confidence=parameters["confidence"],
        )
        estimator._restore(parameters)
        return estimator


class PressureLugreEstimator(LugreEstimator):
    """LuGre whose dry friction grows linearly with the sum of both pressures; the slope is found on the same test.

    Source: Coulomb friction with preload and a pressure coefficient times the sum of pressures is the usual law of
    cylinder friction in simulation tools (Simscape's Cylinder Friction).
    """

    kind: ClassVar[str] = "pressure_lugre"
    pressure_scaled: ClassVar[bool] = True


def scaling_pressure(samples: Array) -> Array:
    """Return the pressure that scales dry friction, P1 + P2 [Pa], shape ``(n,)``, of raw samples, shape ``(n, 3)``."""
    return np.ascontiguousarray(samples[:, 0] + samples[:, 1])

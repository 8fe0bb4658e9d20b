"""LuGre as published comparisons use it: identified in one condition alone, and at most scaled by the pressures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.friction_models.identification.procedure import SearchEffort
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording


class LugreEstimator(AnalyticalEstimator):
    """LuGre identified in one condition alone, as in published comparisons; at run time it reads position only.

    Use it as the classical baseline. It needs no pressure sensor, and therefore cannot follow a load or pressure that
    differs from its condition. Ten minutes of recordings at 200 Hz take about
    10 s on one core at 2 GHz.

    Args:
        condition: The ``metadata.condition`` of the recordings that it is identified on; None: the condition with the
            smallest mean absolute friction, as the paper identifies LuGre at the smallest load. ``fit`` sets it.
        seed, population, generations, simulated_recordings: As for ``SearchEffort``.
        cylinder, velocity_dead_band_m_s, damping_ratio, confidence, inputs: As for ``AnalyticalEstimator``.

    Attributes:
        parameters: The model; None before ``fit``.

    Example:
        >>> lugre = cf.LugreEstimator(cylinder, generations=2).fit(train)
        >>> lugre.condition  # where friction is smallest
        '1'
        >>> lugre.parameters.coulomb_n > 0.0
        True
    """

    kind: ClassVar[str] = "lugre"
    shown: ClassVar[tuple[str, ...]] = ("condition",)
    pressure_scaled: ClassVar[bool] = False

    parameters: LugreParameters | None

    def __init__(
        self,
        cylinder: Cylinder,
        condition: str | None = None,
        seed: int = 0,
        population: int = 12,
        generations: int = 60,
        simulated_recordings: int = 4,
        velocity_dead_band_m_s: float = 1e-3,
        damping_ratio: float = 0.5,
        confidence: float = 0.95,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
    ) -> None:
        super().__init__(
            cylinder,
            LuGre(self.pressure_scaled),
            inputs,
            condition=condition,
            effort=SearchEffort(seed, population, generations, simulated_recordings),
            velocity_dead_band_m_s=velocity_dead_band_m_s,
            damping_ratio=damping_ratio,
            confidence=confidence,
        )

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Choose the condition if none is stated, then identify as ``AnalyticalEstimator.fit`` does."""
        if self.condition is None and recordings:
            self.condition = condition_of_smallest_friction(recordings)
        return super().fit(recordings)

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003 - everything is JSON
        estimator = cls(
            Cylinder(**parameters["cylinder"]),
            condition=parameters["condition"],
            velocity_dead_band_m_s=parameters["least_velocity_dead_band_m_s"],
            damping_ratio=parameters["damping_ratio"],
            confidence=parameters["confidence"],
            inputs=parameters.get("inputs", SAMPLE_COLUMNS),
        )
        estimator._restore(parameters)
        return estimator


class PressureLugreEstimator(LugreEstimator):
    """LuGre whose dry friction grows linearly with the sum of both pressures; the slope is identified as well.

    Use it if friction differs between loads and both pressures are measured.

    Source: Coulomb friction with preload and a pressure coefficient times the sum of pressures is the usual law of
    cylinder friction in simulation tools (Simscape's Cylinder Friction).
    """

    kind: ClassVar[str] = "pressure_lugre"
    pressure_scaled: ClassVar[bool] = True


def condition_of_smallest_friction(recordings: Sequence[Recording]) -> str:
    """Find the condition with the smallest mean absolute label in usable rows; of equal ones, the first by name.

    ``LugreEstimator`` is identified there unless you name a condition, as the paper identifies LuGre at the smallest
    load. Recordings must be labelled (``friction_n`` [N] and ``usable``) and state their condition.
    """
    labels: dict[str, list[float]] = {}
    for recording in sorted(recordings, key=lambda each: each.metadata.condition):
        friction = np.abs(recording.column("friction_n")[recording.usable()])
        labels.setdefault(recording.metadata.condition, []).extend(friction.tolist())
    return min(labels, key=lambda condition: float(np.mean(labels[condition])) if labels[condition] else np.inf)

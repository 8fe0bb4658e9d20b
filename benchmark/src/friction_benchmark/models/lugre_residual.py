"""LuGre, and boosted trees for its residual: physics where data are scarce, learning where they are not."""

from collections.abc import Sequence
from typing import Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.analytical import PRESSURE_PAIRS, AnalyticalEstimator, scaled_effort
from cylinder_friction.estimators.linear import labelled_rows
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.evenly import evenly
from friction_benchmark.models.base import Single
from friction_benchmark.models.gradient_boosting import SPACE, GradientBoosting
from friction_benchmark.registry import BuildConfiguration, OneOf, RegisteredModel


class LugreResidual(GradientBoosting):
    """An identified LuGre (Canudas de Wit et al. 1995) and boosted trees on its residual (Psichogios and Ungar 1992).

    Without raw pressures the trees correct LuGre. With them they correct the force balance, and LuGre, as well as how
    far the force balance is from it, are features. Dry friction grows with pressure where a pair of pressures, raw or
    slow, is among the inputs. Faster than ``passive_above_mm_s``, unless that is 0, an estimate that would feed energy
    (friction times velocity below zero) is replaced by zero. Effort also cuts LuGre's search and the recordings that it
    is identified on.
    """

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build)
        self.passive_above_m_s = build.number("passive_above_mm_s") * 1e-3
        self.identified_on = max(2, round(16 * build.effort**0.5))
        scaled = any(set(pair) <= set(self.inputs) for pair in PRESSURE_PAIRS)
        effort = scaled_effort(0.4 * build.effort, build.seed)
        self.lugre = AnalyticalEstimator(build.cylinder, LuGre(pressure_scaled=scaled), self.inputs, effort=effort)

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Identify LuGre, then fit the trees to its residual, on the same recordings."""
        self.lugre.fit(evenly(recordings, self.identified_on))
        self.lugre_scale_n = float(labelled_rows(recordings)[0].std()) or 1.0
        return super().fit(recordings)

    def features_of(self, recording: Recording) -> tuple[Single, Array]:
        """Return features with LuGre's friction beside them; LuGre is corrected if there is no force balance."""
        features, base_n = super().features_of(recording)
        lugre_n = self.lugre.estimate(recording)
        if not self.features.has_base:
            return np.column_stack([features, lugre_n / self.lugre_scale_n]).astype(np.float32), lugre_n
        beside = np.stack([lugre_n, base_n - lugre_n], axis=1) / self.lugre_scale_n
        return np.concatenate([features, beside.astype(np.float32)], axis=1), base_n

    def estimate(self, recording: Recording) -> Array:
        friction_n = super().estimate(recording)
        if self.passive_above_m_s == 0.0:
            return friction_n
        velocity = self.column(super().features_of(recording)[0], "velocity_m_s")
        feeds = (np.abs(velocity) > self.passive_above_m_s) & (friction_n * velocity < 0.0)
        return np.where(feeds, 0.0, friction_n)

    def multiply_adds(self) -> int:
        return super().multiply_adds() + self.lugre.multiply_adds()


MODELS = (
    RegisteredModel(
        name="lugre_residual",
        title="LuGre and boosted trees on its residual",
        family="modern",
        source="Canudas de Wit et al. 1995; Psichogios and Ungar 1992",
        build=LugreResidual,
        space={**SPACE, "passive_above_mm_s": (OneOf((0.0, 10.0, 20.0, 50.0)), 20.0)},
        chosen="Scaled by pressure where pressures are known; with raw pressures the force balance is corrected and "
        "LuGre is a feature; while sliding fast, estimates that would feed energy are set to zero.",
    ),
)

"""LuGre and boosted trees on its residual; effort cuts trees, rows, and LuGre's search and recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.lugre_residual import LugreResidualEstimator
from friction_benchmark.registry.gradient_boosting import TREE_DEFAULTS, TREE_SPACE, boosting_plan
from friction_benchmark.registry.model import OneOf, RegisteredModel

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> LugreResidualEstimator:
    return LugreResidualEstimator(
        build.cylinder,
        build.inputs,
        boosting_plan(build),
        seed=build.seed,
        passive_above_m_s=build.number("passive_above_mm_s") * 1e-3,
        identification_effort=0.4 * build.effort,
        identified_on=max(2, round(16 * build.effort**0.5)),
    )


MODELS = (
    RegisteredModel(
        name="lugre_residual",
        title="LuGre and boosted trees on its residual",
        family="modern",
        source="Canudas de Wit et al. 1995; Psichogios and Ungar 1992",
        build=_build,
        space={**TREE_SPACE, "passive_above_mm_s": OneOf((0.0, 10.0, 20.0, 50.0))},
        defaults={**TREE_DEFAULTS, "passive_above_mm_s": 20.0},
        chosen="Scaled by pressure where pressures are known; with raw pressures the force balance is corrected and "
        "LuGre is a feature; while sliding fast, estimates that would feed energy are set to zero.",
    ),
)

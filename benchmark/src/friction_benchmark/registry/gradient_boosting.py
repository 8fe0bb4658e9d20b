"""Histogram gradient boosting; effort cuts trees and rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.gradient_boosting import BoostingPlan, GradientBoostingEstimator
from friction_benchmark.registry.model import OneOf, Range, RegisteredModel

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration, Space, Values

TREE_SPACE: Space = {
    "learning_rate": Range(0.04, 0.25, logarithmic=True),
    "leaves": OneOf((15, 31, 63)),
    "loss": OneOf(("absolute_error", "squared_error")),
}
TREE_DEFAULTS: Values = {"learning_rate": 0.1, "leaves": 31, "loss": "absolute_error"}


def boosting_plan(build: BuildConfiguration) -> BoostingPlan:
    loss = build.hyperparameters["loss"]
    if loss not in ("absolute_error", "squared_error"):
        raise ValueError(f"expected loss 'absolute_error' or 'squared_error', but got {loss!r}")
    return BoostingPlan(
        trees=build.share(400, 5),
        learning_rate=build.number("learning_rate"),
        leaves=build.whole("leaves"),
        loss="absolute_error" if loss == "absolute_error" else "squared_error",
        rows=build.share(160_000, 2000),
    )


def _build(build: BuildConfiguration) -> GradientBoostingEstimator:
    return GradientBoostingEstimator(build.cylinder, build.inputs, boosting_plan(build), seed=build.seed)


MODELS = (
    RegisteredModel(
        name="gradient_boosting",
        title="Histogram gradient boosting",
        family="modern",
        source="Friedman 2001; Ke et al. 2017",
        build=_build,
        space=TREE_SPACE,
        defaults=TREE_DEFAULTS,
        chosen="Features of now, 30, 100 and 300 ms ago, and averages over 0.5 and 5 s.",
    ),
)

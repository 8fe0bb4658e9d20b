"""The product's hybrid of LSTM and random forest, and its LSTM alone."""

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from friction_benchmark.models.sequence_network import (
    DEFAULTS,
    PRESSURE_FREE_EPOCHS,
    SPACE,
    architecture,
    training_plan,
)
from friction_benchmark.registry import BuildConfiguration, Range, RegisteredModel


def _hybrid(build: BuildConfiguration) -> HybridEstimator:
    return HybridEstimator(
        build.cylinder,
        architecture=architecture(build),
        plan=training_plan(build, epochs=40, steps=200, slower=PRESSURE_FREE_EPOCHS),
        forest_plan=ForestPlan(build.whole("trees"), build.whole("depth"), build.share(15_000, 1000), leaf=10),
        seed=build.seed,
        inputs=build.inputs,
    )


def _lstm(build: BuildConfiguration) -> HybridEstimator:
    return HybridEstimator(
        build.cylinder,
        architecture=architecture(build),
        plan=training_plan(build, epochs=60, steps=200, slower=PRESSURE_FREE_EPOCHS),
        forest_plan=None,
        seed=build.seed,
        inputs=build.inputs,
    )


MODELS = (
    RegisteredModel(
        name="hybrid",
        title="Hybrid: LSTM and forest",
        family="modern",
        source="after the paper; Hochreiter and Schmidhuber 1997, Breiman 2001",
        build=_hybrid,
        space={**SPACE, "trees": Range(16, 32, integer=True), "depth": Range(6, 12, integer=True)},
        defaults={**DEFAULTS, "trees": 24, "depth": 10},
        learns_offset=True,
        chosen="The LSTM corrects the force balance where there is one; the forest learns the LSTM's residual, from "
        "its state, its output and the features; leaves of 20 rows or more; mean absolute error, AdamW, cosine. Where "
        "sensors drift it learns their offset in each recording, as the product does.",
    ),
    RegisteredModel(
        name="lstm",
        title="LSTM",
        family="modern",
        source="Hochreiter and Schmidhuber 1997",
        build=_lstm,
        space=SPACE,
        defaults=DEFAULTS,
        learns_offset=True,
        chosen="The hybrid without its forest, with the forest's time spent on epochs.",
    ),
)

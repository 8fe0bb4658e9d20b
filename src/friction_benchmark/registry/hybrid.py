"""The hybrid of LSTM and random forest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.hybrid import ForestPlan
from friction_benchmark.models.lstm_correction import LstmForestEstimator
from friction_benchmark.registry.model import Range, RegisteredModel
from friction_benchmark.registry.recurrent import DEFAULTS, SPACE, architecture, sequence_plan

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> LstmForestEstimator:
    forest = ForestPlan(build.whole("trees"), build.whole("depth"), build.share(60_000, 1000), leaf=20)
    plan = sequence_plan(build, epochs=40, steps=100)
    return LstmForestEstimator(build.cylinder, architecture(build), plan, forest, build.inputs, build.seed)


MODELS = (
    RegisteredModel(
        name="hybrid",
        title="Hybrid: LSTM and forest",
        family="modern",
        source="after the paper; Hochreiter and Schmidhuber 1997, Breiman 2001",
        build=_build,
        space={**SPACE, "trees": Range(16, 32, integer=True), "depth": Range(6, 12, integer=True)},
        defaults={**DEFAULTS, "trees": 24, "depth": 10},
        chosen="The LSTM corrects the force balance where there is one; the forest learns the LSTM's residual, from "
        "its state, its output and the features; leaves of 20 rows or more; mean absolute error, AdamW, cosine.",
    ),
)

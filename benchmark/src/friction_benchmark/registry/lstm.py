"""The LSTM alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.hybrid import HybridEstimator
from friction_benchmark.registry.model import RegisteredModel
from friction_benchmark.registry.recurrent import DEFAULTS, PRESSURE_FREE_EPOCHS, SPACE, architecture, training_plan

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> HybridEstimator:
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
        name="lstm",
        title="LSTM",
        family="modern",
        source="Hochreiter and Schmidhuber 1997",
        build=_build,
        space=SPACE,
        defaults=DEFAULTS,
        learns_offset=True,
        chosen="The hybrid without its forest, with the forest's time spent on epochs.",
    ),
)

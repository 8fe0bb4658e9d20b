"""The LSTM alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.lstm_correction import LstmEstimator
from friction_benchmark.registry.model import RegisteredModel
from friction_benchmark.registry.recurrent import DEFAULTS, SPACE, architecture, sequence_plan

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> LstmEstimator:
    plan = sequence_plan(build, epochs=60, steps=100)
    return LstmEstimator(build.cylinder, architecture(build), plan, build.inputs, build.seed)


MODELS = (
    RegisteredModel(
        name="lstm",
        title="LSTM",
        family="modern",
        source="Hochreiter and Schmidhuber 1997",
        build=_build,
        space=SPACE,
        defaults=DEFAULTS,
        chosen="The hybrid without its forest, with the forest's time spent on epochs.",
    ),
)

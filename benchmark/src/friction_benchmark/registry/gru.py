"""The gated recurrent unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.gru import GruEstimator
from friction_benchmark.registry.model import RegisteredModel
from friction_benchmark.registry.recurrent import DEFAULTS, SPACE, architecture, stride, training_plan

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> GruEstimator:
    plan = training_plan(build, epochs=24, steps=75, batch_size=32)
    return GruEstimator(build.cylinder, architecture(build), plan, build.inputs, build.seed, stride(build))


MODELS = (
    RegisteredModel(
        name="gru",
        title="GRU",
        family="modern",
        source="Cho et al. 2014",
        build=_build,
        space=SPACE,
        defaults=DEFAULTS,
        chosen="Reset gate after the recurrent product; linear head; mean absolute error, AdamW, cosine.",
    ),
)

"""The causal temporal convolutional network."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from friction_benchmark.models.tcn import TcnArchitecture, TcnEstimator
from friction_benchmark.registry.model import OneOf, Range, RegisteredModel
from friction_benchmark.registry.recurrent import stride, training_plan

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> TcnEstimator:
    kernel, field = build.whole("kernel"), build.whole("receptive_field_steps")
    levels = math.ceil(math.log2(1.0 + (field - 1) / (2 * (kernel - 1))))
    architecture = TcnArchitecture(
        levels, build.whole("channels"), kernel, build.number("dropout"), build.number("learning_rate")
    )
    plan = training_plan(build, epochs=24, steps=100, slower=10)
    return TcnEstimator(build.cylinder, architecture, plan, build.inputs, build.seed, stride(build, 10))


MODELS = (
    RegisteredModel(
        name="tcn",
        title="Causal TCN",
        family="modern",
        source="Bai, Kolter and Koltun 2018",
        build=_build,
        space={
            "receptive_field_steps": OneOf((128, 256, 512)),
            "kernel": OneOf((3, 4)),
            "channels": Range(8, 20, integer=True),
            "learning_rate": Range(2e-3, 2e-2, logarithmic=True),
            "dropout": OneOf((0.0, 0.05)),
        },
        defaults={"receptive_field_steps": 128, "kernel": 4, "channels": 16, "learning_rate": 1e-2, "dropout": 0.0},
        chosen="As many blocks as the receptive field needs: at least 128 steps, 0.64 s or, without pressures, 6.4 s; "
        "weight normalisation, spatial dropout.",
    ),
)

"""The deep network of Han et al. 2023, trained on simulated LuGre friction, without and with fine-tuning on labels."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from friction_benchmark.models.han import HanEstimator, HanPlan
from friction_benchmark.registry.model import OneOf, Range, RegisteredModel

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration, Space


def _build(fine_tuned: bool, build: BuildConfiguration) -> HanEstimator:
    values = build.hyperparameters
    plan = HanPlan(
        fine_tuned=fine_tuned,
        layers=build.whole("layers"),
        spread=build.number("spread"),
        synthetic_steps=build.share(2_000),
        tuning_steps=build.share(4_000),
        learning_rate=float(values.get("learning_rate", HanPlan.learning_rate)),
        tuning_rate=float(values.get("tuning_rate", HanPlan.tuning_rate)),
    )
    return HanEstimator(build.cylinder, build.inputs, plan, build.seed)


_SPACE: Space = {"layers": OneOf((3, 4)), "spread": Range(0.3, 0.5)}
_DEFAULTS = {"layers": 3, "spread": 0.4}
_CHOSEN = (
    "3 or 4 rectified layers of 64; a 7.2 s window whose spans grow with age, and the side of the last motion; LuGre "
    "parameters drawn 30 to 50 % around handbook middles (breakaway 1.2 bar on the piston, static 1.5 times Coulomb, "
    "Stribeck velocity 8 mm/s, 1100 N s/m, 10 N/µm), along the training recordings' motion"
)

MODELS = (
    RegisteredModel(
        name="han_zero_shot",
        title="Deep network trained on LuGre, zero-shot",
        family="related work",
        source="Han et al. 2023",
        build=partial(_build, False),
        space={**_SPACE, "learning_rate": Range(1e-3, 1e-2, True)},
        defaults={**_DEFAULTS, "learning_rate": 3e-3},
        chosen=f"{_CHOSEN}; sees no label and no column but the position; effort cuts the batches (2000)",
    ),
    RegisteredModel(
        name="han_fine_tuned",
        title="Deep network trained on LuGre, fine-tuned",
        family="related work",
        source="Han et al. 2023",
        build=partial(_build, True),
        space={**_SPACE, "tuning_rate": Range(5e-4, 1e-2, True)},
        defaults={**_DEFAULTS, "tuning_rate": 4e-3},
        chosen=f"{_CHOSEN}; then on the task's labels: head by ridge regression, all layers by Adam; the task's other "
        "columns join the first layer; corrects the force balance where raw pressures are there; effort cuts the "
        "batches (6000)",
    ),
)

"""The Elman network of Pan et al. 2017, trained by their swarm and simplex, and the same network trained by Adam."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from friction_benchmark.models.elman import ElmanEstimator, ElmanPlan, Trainer
from friction_benchmark.registry.model import Range, RegisteredModel

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(trainer: Trainer, build: BuildConfiguration) -> ElmanEstimator:
    values = build.hyperparameters
    plan = ElmanPlan(
        nodes=build.whole("nodes"),
        feedback=build.number("feedback"),
        trainer=trainer,
        evaluations=build.share(16_000),
        bound=float(values.get("bound", ElmanPlan.bound)),
        learning_rate=float(values.get("learning_rate", ElmanPlan.learning_rate)),
    )
    return ElmanEstimator(build.cylinder, build.inputs, plan, build.seed)


_SPACE = {"nodes": Range(6, 12, integer=True), "feedback": Range(0.0, 0.9)}
_DEFAULTS = {"nodes": 8, "feedback": 0.3}
_CHOSEN = (
    "8 hidden nodes; self-feedback of the context; inputs: velocity (straight and softly limited), side of the last "
    "motion, the task's other columns; corrects the force balance where raw pressures are there; rounded absolute "
    "error; 64 pieces of 250 steps"
)

MODELS = (
    RegisteredModel(
        name="pan_elman",
        title="Elman network by swarm and simplex",
        family="related work",
        source="Pan et al. 2017",
        build=partial(_build, "swarm"),
        space={**_SPACE, "bound": Range(0.2, 2.0, True)},
        defaults={**_DEFAULTS, "bound": 0.4},
        chosen=f"{_CHOSEN}; 6 x 6 agents, steps of at most 5 % of the box, 30 % of the budget for the simplex; effort "
        "cuts the evaluations of the network (16,000)",
    ),
    RegisteredModel(
        name="elman_adam",
        title="The same Elman network by Adam",
        family="related work",
        source="Pan et al. 2017 (network), Kingma and Ba 2015 (training)",
        build=partial(_build, "adam"),
        space={**_SPACE, "learning_rate": Range(3e-3, 6e-2, True)},
        defaults={**_DEFAULTS, "learning_rate": 2e-2},
        chosen=f"{_CHOSEN}; the swarm's rows and number of evaluations of the network, a gradient counted as three; "
        "effort cuts them (16,000)",
    ),
)

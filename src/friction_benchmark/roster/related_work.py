"""The models of the related work that learn: Machado 2006, Pan 2017 (and the same network with Adam), Han 2023."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.elman import ElmanEstimator, ElmanPlan, Trainer
from friction_benchmark.models.han import HanEstimator, HanPlan
from friction_benchmark.models.machado import MachadoEstimator, MachadoPlan
from friction_benchmark.roster.entry import Making, OneOf, Range, RosterEntry

if TYPE_CHECKING:
    from collections.abc import Callable

FULL_ITERATIONS = 3_200
FULL_EVALUATIONS = 16_000
FULL_SYNTHETIC, FULL_TUNING = 2_000, 4_000
"""What each model spends at effort 1: iterations of L-BFGS, evaluations of the network, batches."""


def _machado(making: Making) -> MachadoEstimator:
    plan = MachadoPlan(
        nodes=int(making.choice["nodes"]),
        delay=int(making.choice["delay"]),
        penalty=float(making.choice["penalty"]),
        iterations=_share(FULL_ITERATIONS, making),
    )
    return MachadoEstimator(making.cylinder, making.inputs, plan, making.seed)


def _elman(trainer: Trainer) -> Callable[[Making], ElmanEstimator]:
    def make(making: Making) -> ElmanEstimator:
        choice = making.choice
        plan = ElmanPlan(
            nodes=int(choice["nodes"]),
            feedback=float(choice["feedback"]),
            trainer=trainer,
            evaluations=_share(FULL_EVALUATIONS, making),
            bound=float(choice.get("bound", ElmanPlan.bound)),
            learning_rate=float(choice.get("learning_rate", ElmanPlan.learning_rate)),
        )
        return ElmanEstimator(making.cylinder, making.inputs, plan, making.seed)

    return make


def _han(fine_tuned: bool) -> Callable[[Making], HanEstimator]:
    def make(making: Making) -> HanEstimator:
        choice = making.choice
        plan = HanPlan(
            fine_tuned=fine_tuned,
            layers=int(choice["layers"]),
            spread=float(choice["spread"]),
            synthetic_steps=_share(FULL_SYNTHETIC, making),
            tuning_steps=_share(FULL_TUNING, making),
            learning_rate=float(choice.get("learning_rate", HanPlan.learning_rate)),
            tuning_rate=float(choice.get("tuning_rate", HanPlan.tuning_rate)),
        )
        return HanEstimator(making.cylinder, making.inputs, plan, making.seed)

    return make


def _share(full: int, making: Making) -> int:
    return max(1, round(making.effort * full))


_ELMAN_CHOSEN = (
    "8 hidden nodes; self-feedback of the context; inputs: velocity (straight and softly limited), side of the last "
    "motion, the task's other columns; corrects the force balance where raw pressures are there; rounded absolute "
    "error; 64 pieces of 250 steps; early stopping on the validation recordings"
)
_HAN_CHOSEN = (
    "3 or 4 rectified layers of 64; a 7.2 s window whose spans grow with age, and the side of the last motion; LuGre "
    "parameters drawn 30 to 50 % around handbook middles (breakaway 1.2 bar on the piston, static 1.5 times Coulomb, "
    "Stribeck velocity 8 mm/s, 1100 N s/m, 10 N/µm), along the training recordings' motion"
)

ENTRIES: tuple[RosterEntry, ...] = (
    RosterEntry(
        name="machado",
        title="Neural friction compensator",
        family="related work",
        source="Machado et al. 2006",
        make=_machado,
        space={"nodes": Range(6, 20, integer=True), "delay": OneOf((1, 4, 10, 20)), "penalty": Range(1e-5, 1e-1, True)},
        first={"nodes": 10, "delay": 10, "penalty": 1e-4},
        chosen=(
            "labels as targets; stiction force: the force balance below 3 mm/s, the side of the last motion where no "
            "pressure is measured; the task's other columns are inputs too; corrects the force balance where raw "
            "pressures are there; L-BFGS on 24,000 rows; effort cuts its iterations (3200)"
        ),
    ),
    RosterEntry(
        name="pan_elman",
        title="Elman network by swarm and simplex",
        family="related work",
        source="Pan et al. 2017",
        make=_elman("swarm"),
        space={"nodes": Range(6, 12, integer=True), "feedback": Range(0.0, 0.9), "bound": Range(0.2, 2.0, True)},
        first={"nodes": 8, "feedback": 0.3, "bound": 0.4},
        chosen=_ELMAN_CHOSEN
        + "; 6 x 6 agents, steps of at most 5 % of the box, 30 % of the budget for the simplex; effort cuts the "
        "evaluations of the network (16,000)",
    ),
    RosterEntry(
        name="elman_adam",
        title="The same Elman network by Adam",
        family="related work",
        source="Pan et al. 2017 (network), Kingma and Ba 2015 (training)",
        make=_elman("adam"),
        space={
            "nodes": Range(6, 12, integer=True),
            "feedback": Range(0.0, 0.9),
            "learning_rate": Range(3e-3, 6e-2, True),
        },
        first={"nodes": 8, "feedback": 0.3, "learning_rate": 2e-2},
        chosen=_ELMAN_CHOSEN
        + "; the swarm's rows and number of evaluations of the network, a gradient counted as three; "
        "effort cuts them (16,000)",
    ),
    RosterEntry(
        name="han_zero_shot",
        title="Deep network taught by LuGre, zero-shot",
        family="related work",
        source="Han et al. 2023",
        make=_han(fine_tuned=False),
        space={"layers": OneOf((3, 4)), "spread": Range(0.3, 0.5), "learning_rate": Range(1e-3, 1e-2, True)},
        first={"layers": 3, "spread": 0.4, "learning_rate": 3e-3},
        chosen=_HAN_CHOSEN + "; sees no label and no column but the position; effort cuts the batches (2000)",
    ),
    RosterEntry(
        name="han_fine_tuned",
        title="Deep network taught by LuGre, fine-tuned",
        family="related work",
        source="Han et al. 2023",
        make=_han(fine_tuned=True),
        space={"layers": OneOf((3, 4)), "spread": Range(0.3, 0.5), "tuning_rate": Range(5e-4, 1e-2, True)},
        first={"layers": 3, "spread": 0.4, "tuning_rate": 4e-3},
        chosen=_HAN_CHOSEN
        + "; then on the task's labels: head by ridge regression, all layers by Adam; the task's other columns join "
        "the first layer; corrects the force balance where raw pressures are there; effort cuts the batches (6000)",
    ),
)

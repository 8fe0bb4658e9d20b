"""Hyperparameter search with Optuna that a kill cannot spoil: what is finished is kept, what follows is the same.

Each trial's proposal depends only on the seed and on the trials finished before it, and every finished trial is
written to disk at once, so a resumed search ends where an undisturbed one does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Self

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import TrialState

from cylinder_friction.recordings.files import read_json, write_json

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

Value = int | float


@dataclass(frozen=True)
class SearchSpace:
    """Choices of layers, nodes and dropout; lowest and highest learning rate (log), trees and depth."""

    layers: tuple[int, ...]
    nodes: tuple[int, ...]
    dropout: tuple[float, ...]
    learning_rate: tuple[float, float]
    forest_trees: tuple[int, int]
    forest_depth: tuple[int, int]

    def distributions(self) -> dict[str, BaseDistribution]:
        return {
            "layers": CategoricalDistribution(self.layers),
            "nodes": CategoricalDistribution(self.nodes),
            "dropout": CategoricalDistribution(self.dropout),
            "learning_rate": FloatDistribution(*self.learning_rate, log=True),
            "forest_trees": IntDistribution(*self.forest_trees),
            "forest_depth": IntDistribution(*self.forest_depth),
        }


@dataclass(frozen=True)
class Trial:
    """One finished trial.

    Attributes:
        params: What was tried.
        state: ``complete``, ``pruned`` (stopped early as worse than most) or ``too_costly`` (over the bound, not run).
        value: Validation mean absolute error of the whole hybrid [N]; None unless complete.
        reported: Validation error of the network alone after each epoch [N].
        multiply_adds: Of one step.
    """

    params: dict[str, Value]
    state: str
    value: float | None
    multiply_adds: int
    reported: list[float] = field(default_factory=list)

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return cls(**content)


@dataclass(frozen=True)
class SearchPlan:
    """How many trials, how many of them drawn at random first, the bound on a step's cost, and the seed."""

    trials: int
    startup_trials: int
    maximum_multiply_adds: int
    seed: int


class PruneTrial(Exception):  # noqa: N818 - not an error: it ends a trial that is worse than most
    """Raised by ``report`` when a trial is not worth going on with."""


Report = Callable[[float], None]
Objective = Callable[[dict[str, Value], Report], float]
"""Trains with the given parameters, calls back with each epoch's validation error, returns the final one [N]."""


def run_search(
    space: SearchSpace,
    plan: SearchPlan,
    cost: Callable[[dict[str, Value]], int],
    objective: Objective,
    journal: Path,
    after_trial: Callable[[Trial], None],
) -> list[Trial]:
    """Run what is left of the plan and returns all trials in order.

    Args:
        space: Where to look.
        plan: How long.
        cost: Multiply-adds of one step with these parameters.
        objective: See ``Objective``.
        journal: JSON file that holds the finished trials; read at the start, written after each trial.
        after_trial: Called with each trial as it finishes, those of an earlier run included.
    """
    finished = read_trials(journal)
    for trial in finished:
        after_trial(trial)
    while len(finished) < plan.trials:
        study = study_of(finished, space, plan)
        proposal = study.ask(space.distributions())
        trial = _run_trial(proposal, plan, cost, objective)
        finished.append(trial)
        write_json(journal, [asdict(done) for done in finished])
        after_trial(trial)
    return finished


def read_trials(journal: Path) -> list[Trial]:
    """Return the trials of a file that ``run_search`` wrote; none where there is no file."""
    return [Trial.from_dict(entry) for entry in read_json(journal)] if journal.is_file() else []


def best_trial(trials: Sequence[Trial]) -> Trial:
    """Return the complete trial with the smallest error, the earliest of equals.

    Raises:
        ValueError: No trial was completed.
    """
    complete = [trial for trial in trials if trial.value is not None]
    if not complete:
        states = sorted({trial.state for trial in trials})
        raise ValueError(
            f"search: none of {len(trials)} trials was completed (states {states}); raise maximum_multiply_adds "
            "or narrow the space"
        )
    return min(complete, key=lambda trial: trial.value if trial.value is not None else float("inf"))


def study_of(trials: Sequence[Trial], space: SearchSpace, plan: SearchPlan) -> optuna.Study:
    """Return an in-memory Optuna study holding these trials, its sampler seeded by their number."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.TPESampler(seed=plan.seed * 10_007 + len(trials), n_startup_trials=plan.startup_trials)
    pruner = optuna.pruners.MedianPruner(
        n_startup_trials=plan.startup_trials, n_warmup_steps=2
    )  # steps count from 1: the first epoch is never judged
    study = optuna.create_study(study_name="search", sampler=sampler, pruner=pruner, direction="minimize")
    for trial in trials:
        study.add_trial(
            optuna.trial.create_trial(
                state=TrialState.COMPLETE if trial.value is not None else TrialState.PRUNED,
                value=trial.value,
                params=dict(trial.params),
                distributions=space.distributions(),
                intermediate_values=dict(enumerate(trial.reported, start=1)),
            )
        )
    return study


def _run_trial(
    proposal: optuna.Trial,
    plan: SearchPlan,
    cost: Callable[[dict[str, Value]], int],
    objective: Objective,
) -> Trial:
    params: dict[str, Value] = dict(proposal.params)
    multiply_adds = cost(params)
    if multiply_adds > plan.maximum_multiply_adds:
        return Trial(params, "too_costly", None, multiply_adds)
    reported: list[float] = []

    def report(error_n: float) -> None:
        reported.append(error_n)
        proposal.report(error_n, len(reported))
        if proposal.should_prune():
            raise PruneTrial

    try:
        value = objective(params, report)
    except PruneTrial:
        return Trial(params, "pruned", None, multiply_adds, reported)
    return Trial(params, "complete", value, multiply_adds, reported)

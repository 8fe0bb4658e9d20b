"""The search for the hybrid's hyperparameters: trials under a bound on the cost of a step."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial, TrialState

from cylinder_friction.execution.workers import Workers
from cylinder_friction.tuning.space import RANGES, SearchSpace
from cylinder_friction.tuning.trials import (
    DiscardedTrial,
    Objective,
    Report,
    TuningPlan,
    reason_of,
    reported_at_s,
    run_trials,
)

Value = int | float
Cost = Callable[[dict[str, Value]], int]  # Takes hyperparameters, returns the multiply-adds of one step


@dataclass(frozen=True)
class Trial:
    """One finished trial."""

    params: dict[str, Value]  # The hyperparameters
    # ``complete``, ``pruned`` (stopped early as worse than most) or ``too_costly`` (over the bound, not run)
    state: str
    value: float | None  # Validation mean absolute error of the whole hybrid [N]; None unless complete
    multiply_adds: int  # Of one step
    reported: list[float] = field(default_factory=list)  # Validation error of the network alone after each epoch [N]


@dataclass(frozen=True)
class TimedTrial:
    """A finished trial and when it went on [s since 1970], which is no part of what it found."""

    trial: Trial
    started_s: float
    ended_s: float
    reported_s: list[float]  # Of ``Trial.reported``


@dataclass(frozen=True)
class SearchPlan(TuningPlan):
    """How many trials, how many of them drawn at random first, the seed, and the bound on a step's multiply-adds."""

    maximum_multiply_adds: int


def run_search(
    space: SearchSpace,
    plan: SearchPlan,
    cost: Cost,
    objective: Objective,
    journal: Path,
    after_trial: Callable[[TimedTrial], None],
    workers: Workers | None = None,
) -> list[Trial]:
    """Run what is left of the plan and return all trials in order.

    Args:
        space: Where to look.
        plan: How long.
        cost: See ``Cost``.
        objective: Trains with given hyperparameters, calls back with each epoch's validation error, returns the final
            one [N].
        journal: File of the finished trials; see ``run_trials``.
        after_trial: Called with each trial as it finishes, those of an earlier run included.
        workers: See ``run_trials``.
    """

    def trial_of(trial: FrozenTrial) -> Trial:
        reported = [value for _, value in sorted(trial.intermediate_values.items())]
        complete = trial.state == TrialState.COMPLETE
        value = trial.value if complete else None
        return Trial(dict(trial.params), reason_of(trial) or "complete", value, cost(trial.params), reported)

    def finish(trial: FrozenTrial) -> None:
        started_s, ended_s = (
            moment.timestamp() for moment in (trial.datetime_start, trial.datetime_complete) if moment
        )
        after_trial(TimedTrial(trial_of(trial), started_s, ended_s, reported_at_s(trial)))

    affordable = partial(_affordable, cost, plan.maximum_multiply_adds, objective)
    finished = run_trials(_distributions(space), plan, affordable, journal, after_trial=finish, workers=workers)
    return [trial_of(trial) for trial in finished]


def _affordable(cost: Cost, most: int, objective: Objective, params: dict[str, Value], report: Report) -> float:
    if cost(params) > most:
        raise DiscardedTrial("too_costly")
    return objective(params, report)


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


def study_of(trials: Sequence[Trial], space: SearchSpace) -> optuna.Study:
    """Return an in-memory Optuna study that holds these trials, for Optuna's plots."""
    study = optuna.create_study(study_name="search", direction="minimize")
    for trial in trials:
        study.add_trial(
            optuna.trial.create_trial(
                state=TrialState.COMPLETE if trial.value is not None else TrialState.PRUNED,
                value=trial.value,
                params=dict(trial.params),
                distributions=_distributions(space),
                intermediate_values=dict(enumerate(trial.reported, start=1)),
            )
        )
    return study


def _distributions(space: SearchSpace) -> dict[str, BaseDistribution]:
    return {name: _distribution(name, values) for name, values in asdict(space).items()}


def _distribution(name: str, values: tuple[Value, ...]) -> BaseDistribution:
    if name not in RANGES:
        return CategoricalDistribution(values)
    lowest, highest = values
    if name == "learning_rate":
        return FloatDistribution(lowest, highest, log=True)
    return IntDistribution(int(lowest), int(highest))

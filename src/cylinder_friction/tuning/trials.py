"""Trials with Optuna that survive a kill: finished ones are kept in a journal, and what follows is the same.

Each proposal depends only on the seed, its number and the batches of trials before its own, so a tuning that is resumed
from its journal, or run by any number of workers, ends bit for bit where an undisturbed one does. A trial that a kill
left running is tried again.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import optuna
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler
from optuna.trial import FrozenTrial, TrialState, create_trial

from cylinder_friction.execution.workers import Died, Workers
from cylinder_friction.tuning.study_store import study_storage

Values = dict[str, Any]
Report = Callable[[float], None]
Objective = Callable[[Values, Report], float]
"""Takes proposed values, calls back with intermediate errors, returns the final error; smaller is better."""

REASON = "reason"  # User attribute of a trial without a value: why
REPORTED_S = "reported_s"  # User attribute: when each intermediate error was reported


class DiscardedTrial(Exception):  # noqa: N818 - not an error: it ends a trial that is not worth going on with
    """Raised by ``Report`` or the objective to end a trial without a value; its message is the reason."""


@dataclass(frozen=True)
class TuningPlan:
    """How many trials, how many of them drawn at random before the sampler learns, and the sampler's seed.

    ``batch`` trials are proposed at a time, none of which knows of the others: so many can run side by side, and the
    sampler learns later. It shapes what is found; the number of workers does not.
    """

    trials: int
    startup_trials: int
    seed: int
    batch: int = field(default=1, kw_only=True)


def run_trials(
    space: Mapping[str, BaseDistribution],
    plan: TuningPlan,
    objective: Objective,
    journal: Path,
    after_trial: Callable[[FrozenTrial], None] = lambda _: None,
    workers: Workers | None = None,
) -> list[FrozenTrial]:
    """Run what is left of the plan and return all finished trials in order.

    Values are proposed by a tree-structured Parzen estimator (Bergstra et al. 2011); a trial whose intermediate error
    is worse than the median is discarded with the reason ``pruned``. Both look at the batches before its own.

    Args:
        space: Where to look.
        plan: How long.
        objective: See ``Objective``; for workers elsewhere it can be pickled.
        journal: File of the finished trials, read at the start and appended to, or what ``study_storage`` takes in its
            place.
        after_trial: Called with each trial as it finishes, in their order, those of an earlier run first.
        workers: Run the trials of a batch side by side; None: one after the other, here.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    workers = workers or Workers()
    with study_storage(journal) as (storage, name):
        study = optuna.create_study(storage=storage, study_name=name, load_if_exists=True)
        finished = _finished(study)
        for trial in finished:
            after_trial(trial)
        while len(finished) < plan.trials:
            proposed = next_batch(space, plan, finished)
            earlier = _earlier(plan, finished)
            pieces = [partial(_tried, space, plan, values, earlier, objective) for values in proposed]
            for values, result in zip(proposed, workers.in_order(pieces), strict=True):
                trial = failed(space, values, f"lost: {result.reason}") if isinstance(result, Died) else result
                study.add_trial(trial)
                finished.append(trial)
                after_trial(trial)
    return finished


def next_batch(
    space: Mapping[str, BaseDistribution],
    plan: TuningPlan,
    finished: Sequence[FrozenTrial],
    first: Mapping[str, Any] | None = None,
) -> list[Values]:
    """Return the values of the trials after the finished ones, up to the end of their batch or of the plan.

    Args:
        space: Where to look.
        plan: How long.
        finished: All trials until now, in order.
        first: Values of the first trial; None: it is proposed like the others.
    """
    earlier = _earlier(plan, finished)
    following = range(len(finished), min(len(earlier) + plan.batch, plan.trials))
    return [_proposed(space, plan, number, earlier, first) for number in following]


def failed(space: Mapping[str, BaseDistribution], values: Values, reason: str) -> FrozenTrial:
    """Return a finished trial without a value."""
    return create_trial(state=TrialState.FAIL, params=values, distributions=dict(space), user_attrs={REASON: reason})


def reason_of(trial: FrozenTrial) -> str | None:
    """Return why a trial has no value; None for a complete one."""
    reason: str | None = trial.user_attrs.get(REASON)
    return reason


def reported_at_s(trial: FrozenTrial) -> list[float]:
    """Return when each intermediate error of a trial was reported [s since 1970]."""
    return list(trial.user_attrs.get(REPORTED_S, ()))


def _earlier(plan: TuningPlan, finished: Sequence[FrozenTrial]) -> Sequence[FrozenTrial]:
    """Return the trials before the batch that comes next."""
    return finished[: len(finished) // plan.batch * plan.batch]


def _proposed(
    space: Mapping[str, BaseDistribution],
    plan: TuningPlan,
    number: int,
    earlier: Sequence[FrozenTrial],
    first: Mapping[str, Any] | None,
) -> Values:
    """Return the values of a trial, from the seed, its number and the trials before its batch."""
    sampler = optuna.samplers.TPESampler(seed=plan.seed * 10_007 + number, n_startup_trials=plan.startup_trials)
    study = _study(plan, earlier, sampler)
    if first is not None and number == 0:
        study.enqueue_trial(dict(first))
    return dict(study.ask(dict(space)).params)


def _tried(
    space: Mapping[str, BaseDistribution],
    plan: TuningPlan,
    values: Values,
    earlier: Sequence[FrozenTrial],
    objective: Objective,
) -> FrozenTrial:
    """Return the finished trial of these values."""
    study = _study(plan, earlier)
    study.enqueue_trial(values)
    trial = study.ask(dict(space))
    reported_s: list[float] = []

    def report(error: float) -> None:
        reported_s.append(time.time())
        trial.report(error, len(reported_s))  # from 1: the first is never compared
        if trial.should_prune():
            raise DiscardedTrial("pruned")

    state, value = TrialState.COMPLETE, None
    try:
        value = objective(dict(trial.params), report)
    except DiscardedTrial as discarded:
        trial.set_user_attr(REASON, str(discarded))
        state = TrialState.PRUNED
    trial.set_user_attr(REPORTED_S, reported_s)
    return study.tell(trial, value, state)


def _study(plan: TuningPlan, trials: Sequence[FrozenTrial], sampler: BaseSampler | None = None) -> optuna.Study:
    """Return a study in memory that knows these trials."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    pruner = optuna.pruners.MedianPruner(n_startup_trials=plan.startup_trials, n_warmup_steps=2)
    study = optuna.create_study(sampler=sampler, pruner=pruner)
    study.add_trials(trials)
    return study


def _finished(study: optuna.Study) -> list[FrozenTrial]:
    return [
        trial
        for trial in study.get_trials(deepcopy=False)
        if trial.state == TrialState.COMPLETE or (trial.state.is_finished() and REASON in trial.user_attrs)
    ]

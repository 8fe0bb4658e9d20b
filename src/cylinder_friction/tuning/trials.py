"""Trials with Optuna that survive a kill: finished ones are kept in a journal, and what follows is the same.

Each proposal depends only on the seed and on the trials finished before it, so a tuning that is resumed from its
journal ends bit for bit where an undisturbed one does. A trial that a kill left running is tried again.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import optuna
from optuna.distributions import BaseDistribution
from optuna.trial import FrozenTrial, TrialState

from cylinder_friction.tuning.study_store import study_storage

Values = dict[str, Any]
Report = Callable[[float], None]
Objective = Callable[[Values, Report], float]
"""Takes proposed values, calls back with intermediate errors, returns the final error; smaller is better."""

REASON = "reason"  # User attribute of a trial without a value: why


class DiscardedTrial(Exception):  # noqa: N818 - not an error: it ends a trial that is not worth going on with
    """Raised by ``Report`` or the objective to end a trial without a value; its message is the reason."""


@dataclass(frozen=True)
class TuningPlan:
    """How many trials, how many of them are drawn at random before the sampler learns, and the sampler's seed."""

    trials: int
    startup_trials: int
    seed: int


def run_trials(
    space: Mapping[str, BaseDistribution],
    plan: TuningPlan,
    objective: Objective,
    journal: Path | None = None,
    first: Mapping[str, Any] | None = None,
    after_trial: Callable[[FrozenTrial], None] = lambda _: None,
    failures: tuple[type[Exception], ...] = (),
) -> list[FrozenTrial]:
    """Run what is left of the plan and return all finished trials in order.

    Values are proposed by a tree-structured Parzen estimator (Bergstra et al. 2011); a trial whose intermediate error
    is worse than the median is discarded with the reason ``pruned``.

    Args:
        space: Where to look.
        plan: How long.
        objective: See ``Objective``.
        journal: File of the finished trials, read at the start and appended to, or what ``study_storage`` takes in its
            place; None keeps them in memory.
        first: Values of the first trial; None: it is proposed like the others.
        after_trial: Called with each trial as it finishes, those of an earlier run first.
        failures: Errors of the objective that end its trial, with the message as the reason, and not the tuning.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    pruner = optuna.pruners.MedianPruner(n_startup_trials=plan.startup_trials, n_warmup_steps=2)
    with study_storage(journal) as (storage, name):
        study = optuna.create_study(storage=storage, study_name=name, pruner=pruner, load_if_exists=True)
        for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING, TrialState.WAITING)):
            study.tell(trial.number, state=TrialState.FAIL)  # a kill left it
        finished = _finished(study)
        for trial in finished:
            after_trial(trial)
        while len(finished) < plan.trials:
            study.sampler = optuna.samplers.TPESampler(
                seed=plan.seed * 10_007 + len(finished), n_startup_trials=plan.startup_trials
            )
            if first is not None and not finished:
                study.enqueue_trial(dict(first))
            _run(study, study.ask(dict(space)), objective, failures)
            finished = _finished(study)
            after_trial(finished[-1])
    return finished


def reason_of(trial: FrozenTrial) -> str | None:
    """Return why a trial has no value; None for a complete one."""
    reason: str | None = trial.user_attrs.get(REASON)
    return reason


def _run(study: optuna.Study, trial: optuna.Trial, objective: Objective, failures: tuple[type[Exception], ...]) -> None:
    steps = 0

    def report(error: float) -> None:
        nonlocal steps
        steps += 1  # from 1: the first is never compared
        trial.report(error, steps)
        if trial.should_prune():
            raise DiscardedTrial("pruned")

    try:
        value = objective(dict(trial.params), report)
    except DiscardedTrial as discarded:
        trial.set_user_attr(REASON, str(discarded))
        study.tell(trial, state=TrialState.PRUNED)
    except failures as error:
        trial.set_user_attr(REASON, f"{type(error).__name__}: {error}")
        study.tell(trial, state=TrialState.FAIL)
    else:
        study.tell(trial, value)


def _finished(study: optuna.Study) -> list[FrozenTrial]:
    return [
        trial
        for trial in study.get_trials(deepcopy=False)
        if trial.state == TrialState.COMPLETE or (trial.state.is_finished() and REASON in trial.user_attrs)
    ]

"""The search for the hybrid's hyperparameters with Optuna, with a bound on the cost of a step; it survives a kill.

Finished trials are kept in a journal. Each proposal depends only on the seed, its number and the batches of trials
before its own. A search that is resumed from its journal, or run by any number of workers, therefore gives the same
bits as an uninterrupted one. A trial that was running during a kill is repeated.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.samplers import BaseSampler
from optuna.trial import FrozenTrial, TrialState, create_trial

from cylinder_friction.execution.workers import LostPiece, Workers
from cylinder_friction.tuning.space import RANGES, SearchSpace
from cylinder_friction.tuning.study_store import study_storage

Value = int | float
Values = dict[str, Value]
Cost = Callable[[Values], int]
"""Takes hyperparameters, returns the multiply-adds of one step."""
Report = Callable[[float], None]
Objective = Callable[[Values, Report], float]
"""Trains with hyperparameters, calls back with each epoch's validation error, returns the final one [N]."""

_REASON = "reason"  # User attribute: why a trial has no value
_NUMBER = "number"  # User attribute: number of the trial in the plan
_REPORTED_S = "reported_s"  # User attribute: time of each intermediate error


class DiscardedTrial(Exception):  # noqa: N818 - not an error: it ends a trial that is not worth going on with
    """Raised by ``Report`` to end a trial without a value; its message is the reason."""


@dataclass(frozen=True)
class Trial:
    """One finished trial."""

    params: Values  # The hyperparameters
    # ``complete``, ``pruned`` (stopped early, worse than most), ``too_costly`` (above the bound, not run), or
    # ``lost: ...`` (with the reason why no worker survived it)
    state: str
    value: float | None  # Validation mean absolute error of the whole hybrid [N]; None unless complete
    multiply_adds: int  # Operations of one step
    reported: list[float] = field(default_factory=list)  # Validation error of the network alone after each epoch [N]
    # Times at which it began and ended, and of each of ``reported`` [s since 1970]; not part of the result
    when_s: tuple[float, ...] = field(default=(), compare=False)

    def to_dict(self) -> dict[str, object]:
        """List the result as JSON-compatible values."""
        return {key: value for key, value in asdict(self).items() if key != "when_s"}


@dataclass(frozen=True)
class SearchPlan:
    """Plan of a search.

    ``batch`` trials are proposed at a time, independently of each other: this many can run side by side, and the
    sampler learns after each batch. The size of the batch changes the result; the number of workers does not.
    """

    trials: int
    startup_trials: int  # Trials drawn at random before the sampler learns
    seed: int
    maximum_multiply_adds: int  # Most operations of a step; trials above are not run
    batch: int = 1


def run_search(
    space: SearchSpace,
    plan: SearchPlan,
    cost: Cost,
    objective: Objective,
    journal: Path,
    after_trial: Callable[[], object] = lambda: None,
    workers: Workers | None = None,
) -> list[Trial]:
    """Run the remaining trials of the plan and return all trials in order.

    A tree-structured Parzen estimator (Bergstra et al. 2011) proposes hyperparameters, and a trial whose intermediate
    error is worse than the median is ``pruned``. Both use the batches before the trial's own.

    ``journal`` is the file of finished trials, read at the start and appended to; ``study_storage`` may replace it by a
    database. ``after_trial`` is called after each trial, and for each one of an earlier run. ``workers`` run the trials
    of a batch side by side; ``cost`` and ``objective`` must then be picklable.
    """
    workers = workers or Workers()
    search = _Search(_distributions(space), plan, cost, objective)
    storage, name = study_storage(journal)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(storage=storage, study_name=name, load_if_exists=True)
    finished = _finished(study)
    for _ in finished:
        after_trial()
    while len(finished) < plan.trials:
        earlier = finished[: len(finished) // plan.batch * plan.batch]
        following = range(len(finished), min(len(earlier) + plan.batch, plan.trials))
        proposed = [search.proposed(number, earlier) for number in following]
        results = workers.in_order([partial(search.tried, values, earlier) for values in proposed])
        for values, result in zip(proposed, results, strict=True):
            trial = search.lost(values, result.reason) if isinstance(result, LostPiece) else result
            trial.set_user_attr(_NUMBER, len(finished))
            study.add_trial(trial)
            finished.append(trial)
            after_trial()
    return [search.trial(each) for each in finished]


def _finished(study: optuna.Study) -> list[FrozenTrial]:
    """List the finished trials in order; if two processes finished the same number, one of the equal results."""
    found = {trial.user_attrs[_NUMBER]: trial for trial in study.get_trials(deepcopy=False)}
    return [found[number] for number in range(len(found))]


@dataclass(frozen=True)
class _Search:
    """One search, as it is sent to workers."""

    distributions: dict[str, BaseDistribution]
    plan: SearchPlan
    cost: Cost
    objective: Objective

    def study(self, trials: Sequence[FrozenTrial], sampler: BaseSampler | None = None) -> optuna.Study:
        """Make a study in memory that knows these trials."""
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        pruner = optuna.pruners.MedianPruner(n_startup_trials=self.plan.startup_trials, n_warmup_steps=2)
        study = optuna.create_study(sampler=sampler, pruner=pruner)
        study.add_trials(trials)
        return study

    def proposed(self, number: int, earlier: Sequence[FrozenTrial]) -> Values:
        """Propose the values of a trial, from the seed, its number and the trials before its batch."""
        sampler = optuna.samplers.TPESampler(
            seed=self.plan.seed * 10_007 + number, n_startup_trials=self.plan.startup_trials
        )
        return dict(self.study(earlier, sampler).ask(self.distributions).params)

    def tried(self, values: Values, earlier: Sequence[FrozenTrial]) -> FrozenTrial:
        """Build the finished trial of these values."""
        study = self.study(earlier)
        study.enqueue_trial(values)
        trial = study.ask(self.distributions)
        reported_s: list[float] = []

        def report(error: float) -> None:
            reported_s.append(time.time())
            trial.report(error, len(reported_s))  # from 1: the first is never compared
            if trial.should_prune():
                raise DiscardedTrial("pruned")

        state, value = TrialState.COMPLETE, None
        try:
            if self.cost(trial.params) > self.plan.maximum_multiply_adds:
                raise DiscardedTrial("too_costly")
            value = self.objective(dict(trial.params), report)
        except DiscardedTrial as discarded:
            trial.set_user_attr(_REASON, str(discarded))
            state = TrialState.PRUNED
        trial.set_user_attr(_REPORTED_S, reported_s)
        return study.tell(trial, value, state)

    def lost(self, values: Values, reason: str) -> FrozenTrial:
        """Build the trial of values that no worker survived."""
        attributes = {_REASON: f"lost: {reason}"}
        return create_trial(
            state=TrialState.FAIL, params=values, distributions=self.distributions, user_attrs=attributes
        )

    def trial(self, found: FrozenTrial) -> Trial:
        """Make a finished trial without Optuna."""
        reported = [value for _, value in sorted(found.intermediate_values.items())]
        value = found.value if found.state == TrialState.COMPLETE else None
        moments = [each.timestamp() for each in (found.datetime_start, found.datetime_complete) if each]
        when_s = (*moments, *found.user_attrs.get(_REPORTED_S, ()))
        state = found.user_attrs.get(_REASON, "complete")
        return Trial(dict(found.params), state, value, self.cost(found.params), reported, when_s)


def study_of(trials: Sequence[Trial], space: SearchSpace) -> optuna.Study:
    """Make an in-memory Optuna study that holds these trials, for Optuna's plots."""
    study = optuna.create_study(study_name="search", direction="minimize")
    for trial in trials:
        study.add_trial(
            create_trial(
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


def _distribution(name: str, values: Sequence[Value]) -> BaseDistribution:
    if name not in RANGES:
        return CategoricalDistribution(values)
    lowest, highest = values
    if name == "learning_rate":
        return FloatDistribution(lowest, highest, log=True)
    return IntDistribution(int(lowest), int(highest))

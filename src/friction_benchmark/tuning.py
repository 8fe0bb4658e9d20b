"""The same number of trials for everybody: the first guess first, then what a seeded sampler proposes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import optuna

from cylinder_friction.tuning.trials import TuningPlan, reason_of, run_trials
from friction_benchmark.registry.model import OneOf, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from optuna.distributions import BaseDistribution

    from friction_benchmark.registry.model import RegisteredModel, Value


@dataclass(frozen=True)
class Tuned:
    """What tuning found.

    Attributes:
        choice: The best, one value for each name in the space.
        validation_percent: What it reached on validation sessions [%]; None where there was nothing to tune.
        trials: Error of each trial [%]; None where it failed.
    """

    choice: Mapping[str, Value]
    validation_percent: float | None
    trials: tuple[float | None, ...] = field(default=())


class TuningError(RuntimeError):
    """Not one trial of a participant succeeded; the message is the first one's."""


def tune(
    entry: RegisteredModel,
    trials: int,
    seed: int,
    percent_of: Callable[[Mapping[str, Value]], float],
) -> Tuned:
    """Return the best of ``trials`` choices, the earliest among equals.

    Args:
        entry: The participant; one without a space has nothing to tune.
        trials: How many, its ``first`` included.
        seed: Of the sampler (tree-structured Parzen, Bergstra et al. 2011).
        percent_of: Teaches with a choice and returns the error on validation sessions [%].

    Raises:
        TuningError: Every trial failed.
    """
    if not entry.space:
        return Tuned(dict(entry.defaults), None)
    plan = TuningPlan(trials, max(2, trials // 2), seed)
    space = {name: _distribution(where) for name, where in entry.space.items()}
    tried = run_trials(
        space,
        plan,
        lambda choice, _: percent_of(choice),
        first=entry.defaults,
        failures=(Exception,),  # whatever a model does must not stop the others
    )
    values = tuple(None if reason_of(trial) else trial.value for trial in tried)
    succeeded = [(value, trial.params) for value, trial in zip(values, tried, strict=True) if value is not None]
    if not succeeded:
        raise TuningError(f"none of {trials} trials succeeded; the first: {reason_of(tried[0])}")
    best_percent, best = min(succeeded, key=lambda pair: pair[0])
    return Tuned(best, best_percent, values)


def _distribution(where: Range | OneOf) -> BaseDistribution:
    if isinstance(where, OneOf):
        return optuna.distributions.CategoricalDistribution(where.values)
    if where.integer:
        return optuna.distributions.IntDistribution(int(where.low), int(where.high), log=where.logarithmic)
    return optuna.distributions.FloatDistribution(where.low, where.high, log=where.logarithmic)

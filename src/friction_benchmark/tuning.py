"""The same number of trials for every model: its defaults first, then what a seeded sampler proposes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

from cylinder_friction.tuning.trials import TuningPlan, reason_of, run_trials
from friction_benchmark.registry.model import OneOf

if TYPE_CHECKING:
    from collections.abc import Callable

    from optuna.distributions import BaseDistribution

    from friction_benchmark.registry.model import Range, RegisteredModel, Values


@dataclass(frozen=True)
class Tuned:
    """What tuning found.

    Attributes:
        choice: The best, one value for each name in the space.
        validation_percent: What it reached on validation sessions [%]; None where there was nothing to tune.
        trials: Error of each trial [%]; None where it failed.
    """

    choice: Values
    validation_percent: float | None
    trials: tuple[float | None, ...] = ()


class TuningError(RuntimeError):
    """Not one trial of a model succeeded; the message is the first one's."""


def tune(model: RegisteredModel, trials: int, seed: int, error_percent: Callable[[Values], float]) -> Tuned:
    """Return the best of ``trials`` choices, the earliest among equals.

    Args:
        model: One without a space has nothing to tune.
        trials: How many, the defaults included.
        seed: Seeds the sampler (tree-structured Parzen, Bergstra et al. 2011).
        error_percent: Trains with given hyperparameters and returns the error on validation sessions [%].

    Raises:
        TuningError: Every trial failed.
    """
    if not model.space:
        return Tuned(dict(model.defaults), None)
    tried = run_trials(
        {name: _distribution(where) for name, where in model.space.items()},
        TuningPlan(trials, max(2, trials // 2), seed),
        lambda choice, _: error_percent(choice),
        first=model.defaults,
        failures=(Exception,),  # whatever one trial does must not stop the others
    )
    values = tuple(None if reason_of(trial) else trial.value for trial in tried)
    succeeded = [(value, trial.params) for value, trial in zip(values, tried, strict=True) if value is not None]
    if not succeeded:
        raise TuningError(f"none of {trials} trials succeeded; the first: {reason_of(tried[0])}")
    best_percent, best = min(succeeded, key=lambda pair: pair[0])
    return Tuned(best, best_percent, values)


def _distribution(where: Range | OneOf) -> BaseDistribution:
    if isinstance(where, OneOf):
        return CategoricalDistribution(where.values)
    if where.integer:
        return IntDistribution(int(where.low), int(where.high), log=where.logarithmic)
    return FloatDistribution(where.low, where.high, log=where.logarithmic)

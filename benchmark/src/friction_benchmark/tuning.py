"""The same number of trials for every model: its defaults first, then what a seeded sampler proposes, in batches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import create_trial

from cylinder_friction.tuning.trials import TuningPlan, failed, next_batch, reason_of
from friction_benchmark.registry.model import OneOf

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.trial import FrozenTrial

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


class Tuning:
    """The trials of one model, proposed by a tree-structured Parzen estimator (Bergstra et al. 2011).

    Args:
        model: One with a space.
        trials: How many, the defaults included.
        batch: How many are proposed at a time, none of which knows of the others.
        seed: Seeds the sampler.
    """

    def __init__(self, model: RegisteredModel, trials: int, batch: int, seed: int) -> None:
        self._space = {name: _distribution(where) for name, where in model.space.items()}
        self._plan = TuningPlan(trials, max(2, trials // 2), seed, batch=batch)
        self._defaults = model.defaults
        self._trials: list[FrozenTrial] = []

    @property
    def finished(self) -> bool:
        return len(self._trials) == self._plan.trials

    def next_batch(self) -> list[Values]:
        """Return the choices to try next, the defaults before all."""
        return list(next_batch(self._space, self._plan, self._trials, self._defaults))

    def finish(self, choice: Values, result: float | str) -> None:
        """Take in the error of a choice on validation sessions [%], or why it failed; in the order of the choices."""
        values = dict(choice)
        if isinstance(result, str):
            trial = failed(self._space, values, result)
        else:
            trial = create_trial(value=result, params=values, distributions=self._space)
        self._trials.append(trial)

    def best(self) -> Tuned:
        """Return the best choice, the earliest among equals.

        Raises:
            TuningError: Every trial failed.
        """
        values = tuple(None if reason_of(trial) else trial.value for trial in self._trials)
        found = [(value, trial.params) for value, trial in zip(values, self._trials, strict=True) if value is not None]
        if not found:
            reason = reason_of(self._trials[0])
            raise TuningError(f"none of {len(values)} trials succeeded; the first: {reason}")
        best_percent, choice = min(found, key=lambda pair: pair[0])
        return Tuned(choice, best_percent, values)


def _distribution(where: Range | OneOf) -> BaseDistribution:
    if isinstance(where, OneOf):
        return CategoricalDistribution(where.values)
    if where.integer:
        return IntDistribution(int(where.low), int(where.high), log=where.logarithmic)
    return FloatDistribution(where.low, where.high, log=where.logarithmic)

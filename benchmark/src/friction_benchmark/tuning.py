"""The same number of trials for every model: its defaults first, then what Optuna's seeded sampler proposes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import optuna

from friction_benchmark.registry import OneOf, Range, RegisteredModel, Value, Values

REASON = "reason"


@dataclass(frozen=True)
class Tuned:
    """What tuning found."""

    choice: Values  # The best, one value for each name in the space
    validation_percent: float | None  # What it reached on validation sessions [%]; None if there was nothing to tune


class TuningError(RuntimeError):
    """Not one trial of a model succeeded; the message is the first one's."""


def tune(model: RegisteredModel, trials: int, seed: int, percent: Callable[[Values], float]) -> Tuned:
    """Return the best choice, the earliest among equals (tree-structured Parzen estimator; Bergstra et al. 2011).

    Args:
        model: One with a space.
        trials: How many, the defaults included.
        seed: Seeds the sampler.
        percent: Returns the error of a choice on validation sessions [%]; a trial that raises counts as failed.

    Raises:
        TuningError: Every trial failed.
    """

    def objective(trial: optuna.Trial) -> float:
        choice = {name: _suggested(trial, name, where) for name, where in model.space.items()}
        try:
            return percent(choice)
        except Exception as error:
            trial.set_user_attr(REASON, f"{type(error).__name__}: {error}")
            raise optuna.TrialPruned from None

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(n_startup_trials=max(2, trials // 2), seed=seed))
    study.enqueue_trial(dict(model.defaults))
    study.optimize(objective, n_trials=trials)
    finished = study.get_trials(deepcopy=False, states=[optuna.trial.TrialState.COMPLETE])
    if not finished:
        raise TuningError(f"none of {trials} trials succeeded; the first: {study.trials[0].user_attrs[REASON]}")
    return Tuned(study.best_params, study.best_value)


def _suggested(trial: optuna.Trial, name: str, where: Range | OneOf) -> Value:
    if isinstance(where, OneOf):
        chosen: Any = trial.suggest_categorical(name, where.values)  # its types know no tuple of values
        return chosen
    if where.integer:
        return trial.suggest_int(name, int(where.low), int(where.high), log=where.logarithmic)
    return trial.suggest_float(name, where.low, where.high, log=where.logarithmic)

"""The same number of trials for every model: its defaults first, then what Optuna's seeded sampler proposes."""

from collections.abc import Callable
from dataclasses import dataclass

import optuna

from friction_benchmark.registry import RegisteredModel, Values

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

    ``percent`` returns the error of a choice on validation sessions [%]; a trial in which it raises counts as failed.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(n_startup_trials=max(2, trials // 2), seed=seed))
    study.enqueue_trial(dict(model.defaults))
    for _ in range(trials):
        trial = study.ask({name: distribution for name, (distribution, _) in model.space.items()})
        try:
            study.tell(trial, percent(trial.params))
        except Exception as error:
            trial.set_user_attr(REASON, f"{type(error).__name__}: {error}")
            study.tell(trial, state=optuna.trial.TrialState.PRUNED)
    finished = study.get_trials(deepcopy=False, states=[optuna.trial.TrialState.COMPLETE])
    if not finished:
        raise TuningError(f"none of {trials} trials succeeded; the first: {study.trials[0].user_attrs[REASON]}")
    return Tuned(study.best_params, study.best_value)

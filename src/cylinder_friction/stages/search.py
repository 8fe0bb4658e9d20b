"""Stage ``search``: the hybrid's best hyperparameters, by their error on the validation recordings."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.estimators.front_end import feature_count
from cylinder_friction.evaluation.validation import mean_absolute_error_n
from cylinder_friction.realtime.lstm import lstm_multiply_adds
from cylinder_friction.realtime.position_load import channel_names
from cylinder_friction.recordings.files import whole_folder, write_json
from cylinder_friction.reporting.search_figures import write_search_page
from cylinder_friction.run_record import RunRecord, Times, now_ms
from cylinder_friction.stages._stage import (
    BEST_FILE,
    SEARCH_FOLDER,
    SPACE_FILE,
    artifacts,
    cylinder_from,
    flat,
)
from cylinder_friction.stages._training import NETWORK_MAE, RESUMED_CODE, LearningData, hybrid_from, resume_folder
from cylinder_friction.tuning.search import SearchPlan, TimedTrial, Trial, best_trial, run_search
from cylinder_friction.tuning.space import SearchSpace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import SearchParams
    from cylinder_friction.tuning.search import Value
    from cylinder_friction.tuning.trials import Report

SEARCHED_CODE = ("cylinder_friction.tuning.search", "cylinder_friction.evaluation.validation", *RESUMED_CODE)

CURVE = f"{NETWORK_MAE}/validation"


def run(params: Params) -> RunRecord:
    """Read the training and validation recordings, write the trials, the best parameters and the plots."""
    settings = params.search
    data = LearningData.read()
    cylinder = cylinder_from(params.cylinder)
    journal = resume_folder("search", SEARCHED_CODE, settings, params.cylinder, data.hashes) / "trials.log"
    epochs = settings.training.epochs
    bar = tqdm(total=settings.trials * epochs, desc="search", unit="epoch", disable=None)

    def objective(values: dict[str, Value], report: Report) -> float:
        seeds = (settings.seed, settings.device)
        estimator = hybrid_from(cylinder, settings.hybrid, values, settings.training, *seeds, data)

        def after_epoch(_epoch: int, _train_mae_n: float, validation_mae_n: float) -> None:
            bar.update(1)
            epochs_ms.append(now_ms())
            report(validation_mae_n)

        estimator.fit(data.train, data.validation, data.calibration, report=after_epoch)
        return mean_absolute_error_n(estimator, data.validation)

    epochs_ms: list[int] = []
    times: list[Times] = []

    def after_trial(timed: TimedTrial) -> None:
        ended = int(1000 * timed.started_s), int(1000 * timed.ended_s)
        times.append(Times(*ended, {CURVE: epochs_ms.copy()}))
        epochs_ms.clear()
        bar.update(len(times) * epochs - bar.n)

    channels = channel_names(data.inputs, data.position_load)
    plan = SearchPlan(settings.trials, settings.startup_trials, settings.seed, settings.maximum_multiply_adds)
    space = SearchSpace(**{key: tuple(value) for key, value in settings.space.model_dump().items()})
    trials = run_search(space, plan, lambda values: _cost(settings, values, channels), objective, journal, after_trial)
    bar.close()
    best = best_trial(trials)
    with whole_folder(SEARCH_FOLDER) as folder:
        write_json(folder / "trials.json", [asdict(trial) for trial in trials])
        write_json(folder / BEST_FILE.name, {"design": settings.hybrid, **best.params})
        write_json(folder / SPACE_FILE.name, settings.space.model_dump())
        write_search_page(trials, space, plan, folder / "search.html")
    return RunRecord(
        name="search",
        params=flat(settings) | {f"best.{name}": value for name, value in best.params.items()},
        metrics={"best_validation_mae_n": best.value or 0.0, "best_multiply_adds": float(best.multiply_adds)}
        | {"completed_trials": float(sum(trial.value is not None for trial in trials))},
        artifacts=artifacts(SEARCH_FOLDER),
        datasets=data.datasets,
        children=tuple(_child(number, *each) for number, each in enumerate(zip(trials, times, strict=True))),
    )


def _cost(settings: SearchParams, values: dict[str, Value], channels: Sequence[str]) -> int:
    features = feature_count(settings.hybrid, channels)
    network = lstm_multiply_adds(int(values["layers"]), int(values["nodes"]), features)
    return network + int(values["forest_trees"]) * int(values["forest_depth"])


def _child(number: int, trial: Trial, times: Times) -> RunRecord:
    metrics = {"multiply_adds": float(trial.multiply_adds)}
    if trial.value is not None:
        metrics["validation_mae_n"] = trial.value
    return RunRecord(
        name=f"trial {number:03d}",
        params=dict(trial.params),
        metrics=metrics,
        curves={CURVE: trial.reported} if trial.reported else {},
        tags={"state": trial.state},
        times=times,
    )

"""Stage ``search``: find the hyperparameters of the hybrid with the least error on the validation recordings."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.estimators.front_end import feature_count
from cylinder_friction.evaluation.validation import mean_absolute_error_n
from cylinder_friction.execution.measuring import Took
from cylinder_friction.execution.progress import progress
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.files.whole_files import whole_folder, write_json
from cylinder_friction.realtime.lstm import lstm_multiply_adds
from cylinder_friction.realtime.position_load import channel_names
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.reporting.search_figures import write_search_page
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import BEST_FILE, FINALS_FILE, SEARCH_FOLDER, SPACE_FILE, artifacts, flat
from cylinder_friction.stages._training import NETWORK_MAE, RESUMED_CODE, LearningData, hybrid_from, resume_folder
from cylinder_friction.tuning.finals import Final, best_final, finalists
from cylinder_friction.tuning.search import SearchPlan, Trial, run_search

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.execution.workers import Workers
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import SearchParams
    from cylinder_friction.tuning.search import Report, Values

SEARCHED_CODE = ("cylinder_friction.tuning.search", "cylinder_friction.evaluation.validation", *RESUMED_CODE)

CURVE = f"{NETWORK_MAE}/validation"


def run(params: Params) -> RunRecord:
    """Read the training and validation recordings; write the trials, the best parameters and the plots."""
    settings, cylinder, data = params.search, params.cylinder, LearningData.read()
    depends_on = (settings.model_dump(), flat(cylinder.to_dict()), data.hashes)
    journal = resume_folder("search", SEARCHED_CODE, *depends_on) / "trials.log"
    cost = partial(_cost, settings, channel_names(data.inputs, data.position_load))
    plan = SearchPlan(
        settings.trials, settings.startup_trials, settings.seed, settings.maximum_multiply_adds, settings.batch
    )
    with (
        workers_from_environment() as workers,
        progress(words="search", total=settings.trials, unit="trial") as bar,
    ):
        objective = partial(error_of, settings, cylinder, data if workers.here else data.hashes)
        trials = run_search(settings.space, plan, cost, objective, journal, bar.update, workers)
        finals = _finals(settings, cylinder, data, trials, workers)
    best = best_final(finals)
    with whole_folder(SEARCH_FOLDER) as folder:
        write_json(folder / "trials.json", [trial.to_dict() for trial in trials])
        write_json(folder / BEST_FILE.name, {"design": settings.hybrid, **best.params})
        write_json(folder / FINALS_FILE.name, [final.to_dict() for final in finals])
        write_json(folder / SPACE_FILE.name, settings.model_dump()["space"])
        write_search_page(trials, settings.space, plan, folder / "search.html")
    return RunRecord(
        name="search",
        params=flat(settings) | {f"best.{name}": value for name, value in best.params.items()},
        metrics={"best_validation_mae_n": best.error_n, "best_multiply_adds": float(best.multiply_adds)}
        | {"completed_trials": float(sum(trial.value is not None for trial in trials))},
        artifacts=artifacts(SEARCH_FOLDER),
        datasets=data.datasets,
        children=tuple(_child(number, trial) for number, trial in enumerate(trials)),
    )


def _finals(
    settings: SearchParams, cylinder: Cylinder, data: LearningData, trials: Sequence[Trial], workers: Workers
) -> list[Final]:
    """Train the finalists of a search for longer and with several seeds; return them, the best trial first."""
    longer = {"epochs": settings.final_epochs, "patience": settings.final_epochs}
    training = settings.training.model_copy(update=longer)
    seeds = [settings.seed + 1 + more for more in range(settings.final_seeds)]
    given = data if workers.here else data.hashes
    chosen = finalists(trials, settings.finalists)
    work, names = [], []
    for number, trial in enumerate(chosen):
        for seed in seeds:
            own = settings.model_copy(update={"training": training, "seed": seed})
            work.append(partial(error_of, own, cylinder, given, trial.params))
            names.append(f"finalist {number}, seed {seed}")
    results = workers.all_in_order(work, names)
    errors_n = list(progress(results, "finals", len(work), unit="training"))
    count = len(seeds)
    return [
        Final(trial.params, tuple(errors_n[count * place : count * (place + 1)]), trial.multiply_adds)
        for place, trial in enumerate(chosen)
    ]


def error_of(
    settings: SearchParams,
    cylinder: Cylinder,
    given: LearningData | dict[str, str],
    values: Values,
    report: Report | None = None,
) -> float:
    """Train a hybrid with these hyperparameters; return its error on the validation recordings [N].

    ``given`` is the data, or its hashes for a worker in another process, which reads the data itself. ``report`` is
    called after each epoch with the network's validation error [N].
    """
    data = given if isinstance(given, LearningData) else _read_once(Path.cwd(), tuple(sorted(given.items())))
    estimator = hybrid_from(cylinder, settings.hybrid, values, settings, data)
    with progress(words="trial", total=settings.training.epochs, unit="epoch", leave=False) as bar:

        def after_epoch(_epoch: int, _train_mae_n: float, validation_mae_n: float) -> None:
            bar.update(1)
            if report is not None:
                report(validation_mae_n)

        estimator.fit(data.train, data.validation, data.calibration, report=after_epoch)
    return mean_absolute_error_n(estimator, data.validation)


@lru_cache(maxsize=1)
def _read_once(folder: Path, hashes: tuple[tuple[str, str], ...]) -> LearningData:
    data = LearningData.read()
    if tuple(sorted(data.hashes.items())) != hashes:
        raise RecordingError(
            f"{folder}: this worker sees other recordings than the command; share the folder with the workers"
        )
    return data


def _cost(settings: SearchParams, channels: Sequence[str], values: Values) -> int:
    features = feature_count(settings.hybrid, channels)
    network = lstm_multiply_adds(int(values["layers"]), int(values["nodes"]), features)
    return network + int(values["forest_trees"]) * int(values["forest_depth"])


def _child(number: int, trial: Trial) -> RunRecord:
    started_ms, ended_ms = (int(1000 * moment) for moment in trial.when_s[:2])
    metrics = {"multiply_adds": float(trial.multiply_adds)}
    if trial.value is not None:
        metrics["validation_mae_n"] = trial.value
    return RunRecord(
        name=f"trial {number:03d}",
        params=dict(trial.params),
        metrics=metrics,
        curves={CURVE: trial.reported} if trial.reported else {},
        tags={"state": trial.state},
        took=Took(started_ms, ended_ms),
    )

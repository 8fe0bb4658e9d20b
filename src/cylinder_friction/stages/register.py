"""Stage ``register``: make the candidate a version in the registry, and the champion if the gate promotes it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.dvc_hashes import data_hashes, known_hash
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.saved_folder import DESCRIPTION_FILE
from cylinder_friction.evaluation.comparison import compare
from cylinder_friction.evaluation.reported import error_metrics, reported_errors
from cylinder_friction.evaluation.truth import known_truth
from cylinder_friction.files.whole_files import read_json, read_yaml, write_json
from cylinder_friction.params.composing import as_run_params
from cylinder_friction.params.file import PARAMS_FILE
from cylinder_friction.recordings.storage import read_recording, read_stored, recording_paths
from cylinder_friction.reporting.model_card import model_card
from cylinder_friction.run_record import RunRecord, by_columns
from cylinder_friction.stages._stage import (
    CHOSEN_FILE,
    COVERAGE_FILE,
    HYBRID_FOLDER,
    INGESTED_FILE,
    METRICS_FILE,
    PROCESSED_FOLDERS,
    TRAINING_DATA_FILE,
    artifacts,
    datasets,
    estimator_folders,
    flat,
)
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.lineage import shaping_params
from cylinder_friction.tracking.registry import REGISTERED_FILE, register
from cylinder_friction.tracking.repository import TrackingError

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

EXAMPLE_S = 4.0
"""Duration of the example [s], long enough that its last rows are no longer flagged as settling."""


def run(params: Params) -> RunRecord:
    """Register the candidate and write ``models/registered.json``: the decision and its grounds.

    Raises:
        TrackingError: The candidate was not compared or has no real-time step; or the registry cannot be reached, and
            without it the incumbent is unknown, so nothing is decided.
        RecordingError: ``dvc.lock`` does not state the data of the candidate.
    """
    settings, content = params.register_, read_yaml(PARAMS_FILE)
    reference, errors_percent = reported_errors(_reported(settings.candidate))
    folder, ingested = candidate_folder(settings.candidate), read_json(INGESTED_FILE)
    data = data_hashes([ingested["source"], *(path.as_posix() for path in PROCESSED_FOLDERS.values())])
    candidate = Candidate(
        model_name=params.registered_name,
        folder=folder.as_posix(),
        model_md5=known_hash(folder),
        errors_percent=errors_percent,
        reference=reference,
        tolerance_percent=settings.tolerance_percent,
        data=data,
        params=shaping_params(content),
        example=_example(folder),
        pipeline=as_run_params(content),
        card=_card(params, folder)
        + "\n\n"
        + "\n".join(["**Made from**", "", *(f"- `{k}` {v}" for k, v in data.items())]),
    )

    def measure(saved: Path) -> dict[str, float]:
        recordings = read_stored(PROCESSED_FOLDERS["test"])
        truth_n = known_truth(ingested["truth"], recordings)
        compared = compare({"champion": load_estimator(saved)}, recordings, truth_n=truth_n)
        scores = compared.truth if reference == "truth" else compared.label
        return {condition: score.errors.percent for condition, score in scores["champion"].items()}

    decided = register(candidate, Path(), measure)
    write_json(REGISTERED_FILE, decided.to_dict())
    return RunRecord(
        name="register",
        params=flat(settings) | {"reference": reference},
        metrics=error_metrics(errors_percent, reference) | {"promoted": float(decided.promote)},
        tables={"decision": by_columns(_decision(decided))},
        note=decided.reason,
        artifacts=artifacts(REGISTERED_FILE, METRICS_FILE),
        datasets=datasets({"test": PROCESSED_FOLDERS["test"]}),
    )


def candidate_folder(name: str) -> Path:
    """Find the folder of the estimator to register.

    Raises:
        TrackingError: The estimator has no real-time step, which the served model needs.
    """
    folders = estimator_folders()
    if not load_estimator(folders[name]).has_step:
        stepped = [other for other, folder in folders.items() if folder.is_dir() and load_estimator(folder).has_step]
        raise TrackingError(
            f"register.candidate is {name!r}, which has no real-time step to serve; name one of {', '.join(stepped)}"
        )
    return folders[name]


def _card(params: Params, folder: Path) -> str:
    """Write the candidate's model card; coverage of bounds is known only for the comparison's main estimator."""
    candidate = params.register_.candidate
    own = (folder / TRAINING_DATA_FILE).is_file()  # other estimators use the same training recordings
    sources = read_json((folder if own else HYBRID_FOLDER) / TRAINING_DATA_FILE)
    return model_card(
        candidate,
        params.cylinder,
        read_json(folder / DESCRIPTION_FILE),
        read_json(folder / CHOSEN_FILE) if own else {},
        {role: len(recordings) for role, recordings in sources.items() if own or role == "train"},
        _reported(candidate),
        [each for each in read_json(COVERAGE_FILE) if each["estimator"] == candidate],
    )


def _decision(candidate: Candidate) -> list[dict[str, str | float]]:
    """List the errors that the gate decided on, a row per condition."""
    incumbent = candidate.incumbent or {}
    return [
        {
            "condition": name,
            "candidate_percent": error,
            "incumbent_percent": incumbent.get(name, math.nan),
            "tolerance_percent": candidate.tolerance_percent,
        }
        for name, error in candidate.errors_percent.items()
    ]


def _reported(candidate: str) -> dict[str, dict[str, float]]:
    """Read the candidate's numbers by condition from the comparison's report."""
    report: dict[str, dict[str, dict[str, float]]] = read_json(METRICS_FILE)
    if candidate not in report:
        raise TrackingError(
            f"{METRICS_FILE}: has no estimator {candidate!r}, but {sorted(report)}; run the compare stage"
        )
    return report[candidate]


def _example(model: Path) -> dict[str, list[float]]:
    """Read the first rows of the first held-out recording as the sensors gave them, by input of the model."""
    first = next(map(read_recording, recording_paths(PROCESSED_FOLDERS["test"])), None)
    if first is None:
        raise TrackingError(f"{PROCESSED_FOLDERS['test']}: holds no held-out recording; run the split stage")
    inputs = read_json(model / DESCRIPTION_FILE)["input"]
    readings = first.readings(inputs)[: round(EXAMPLE_S / first.sample_time_s)]
    return dict(zip(inputs, readings.T.tolist(), strict=True))

"""Stage ``register``: the trained hybrid becomes a version in the registry, and the champion if the gate lets it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.evaluation.metrics import errors
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.files import hash_of, read_json, write_json
from cylinder_friction.recordings.storage import iterate_recordings, read_recording, recording_paths
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import (
    HYBRID_FOLDER,
    INGESTED_FILE,
    METRICS_FILE,
    PAPER_HYBRID_FOLDER,
    PROCESSED_FOLDERS,
    REGISTERED_FILE,
    artifacts,
    flat,
)
from cylinder_friction.tracking.errors import TrackingError
from cylinder_friction.tracking.versions import origin_of

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

EXAMPLE_ROWS = 5
_FOLDERS = {"hybrid": HYBRID_FOLDER, "paper_hybrid": PAPER_HYBRID_FOLDER}


def run(params: Params) -> RunRecord:
    """Register the candidate and write ``models/registered.json``: the decision and what it was made on.

    Raises:
        TrackingError: The registry cannot be reached: without it nobody knows the incumbent, so nothing is decided.
        LineageError: ``dvc.lock`` does not state which data the candidate was made from.
    """
    from cylinder_friction.tracking.candidate import Candidate
    from cylinder_friction.tracking.registry import register

    settings = params.register_
    folder = _FOLDERS[settings.candidate]
    test_folder = PROCESSED_FOLDERS["test"]
    origin = origin_of(
        Path(), read_json(INGESTED_FILE)["source"], [path.as_posix() for path in PROCESSED_FOLDERS.values()]
    )
    candidate = Candidate(
        model_name=settings.model_name,
        folder=folder.as_posix(),
        model_key=hash_of(folder),
        errors_percent=_reported_errors(settings.candidate),
        test_data_md5=origin.data[test_folder.as_posix()],
        origin=origin,
        example=_example(test_folder),
    )
    registered = register(candidate, Path(), settings.tolerance_percent, measured_errors)
    write_json(REGISTERED_FILE, asdict(registered))
    return RunRecord(
        name="register",
        params=flat(settings),
        metrics={f"condition_{condition}.label_percent": value for condition, value in candidate.errors_percent.items()}
        | {"promoted": float(registered.promote)},
        tags={"gate_reason": registered.reason, "model_key": candidate.model_key, **origin.tags()},
        artifacts=artifacts(REGISTERED_FILE, METRICS_FILE),
        datasets={"test": candidate.test_data_md5},
    )


def measured_errors(folder: Path) -> dict[str, float]:
    """Return the error by condition [percent of mean |label|] of a saved estimator on the held-out recordings."""
    estimator = load_estimator(folder)
    labels: dict[str, list[np.ndarray]] = {}
    estimates: dict[str, list[np.ndarray]] = {}
    for recording in iterate_recordings(PROCESSED_FOLDERS["test"]):
        usable = recording.usable()
        condition = recording.metadata.condition
        labels.setdefault(condition, []).append(recording.column("friction_n")[usable])
        estimates.setdefault(condition, []).append(estimator.estimate(recording)[usable])
    result = {}
    for condition in sorted(labels):
        label, estimate = np.concatenate(labels[condition]), np.concatenate(estimates[condition])
        result[condition] = errors(label, estimate, np.ones(len(label), dtype=np.bool_)).percent
    return result


def _reported_errors(candidate: str) -> dict[str, float]:
    """Return the candidate's error by condition from the comparison's report."""
    report = read_json(METRICS_FILE)
    if candidate not in report:
        raise TrackingError(
            f"{METRICS_FILE}: has no estimator {candidate!r}, but {sorted(report)}; run the compare stage"
        )
    return {condition: numbers["label_percent"] for condition, numbers in sorted(report[candidate].items())}


def _example(folder: Path) -> dict[str, list[float]]:
    """Return the first rows of the first held-out recording, by column."""
    paths = recording_paths(folder)
    if not paths:
        raise TrackingError(f"{folder}: holds no held-out recording; run the split stage")
    first = read_recording(paths[0])
    return {column: first.column(column)[:EXAMPLE_ROWS].tolist() for column in SAMPLE_COLUMNS}

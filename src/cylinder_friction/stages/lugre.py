"""Stage ``lugre``: LuGre, plain and pressure-scaled, identified on the training recordings of one condition alone."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.recordings.files import hash_of, whole_folder, write_json
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.storage import read_metadata, read_recording, recording_paths
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import LUGRE_FOLDER, PROCESSED_FOLDERS, artifacts, cylinder_from, flat

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.friction_models.identification.procedure import Identification
    from cylinder_friction.params.checking import Params

STRIBECK_FILE = "stribeck_points.json"


def run(params: Params) -> RunRecord:
    """Read ``data/processed/train``, write ``models/lugre`` with one folder per estimator and the Stribeck points.

    Raises:
        RecordingError: No training recording is of the condition that ``lugre.condition`` names.
    """
    paths = paths_of_condition(PROCESSED_FOLDERS["train"], params.lugre.condition)
    recordings = [read_recording(path) for path in paths]
    estimators = [kind(cylinder_from(params.cylinder), **params.lugre.model_dump()) for kind in KINDS]
    metrics: dict[str, float] = {}
    curves: dict[str, list[float]] = {}
    with whole_folder(LUGRE_FOLDER) as folder:
        for estimator in estimators:
            estimator.fit(recordings)
            estimator.save(folder / estimator.kind)
            found = estimator.identification
            assert found is not None
            metrics |= _metrics(estimator.kind, found)
            curves[f"{estimator.kind}.search_error_n"] = list(found.history)
        plain = estimators[0].identification
        assert plain is not None
        write_json(folder / STRIBECK_FILE, _stribeck_content(plain))
    return RunRecord(
        name="lugre",
        params=flat(params.lugre),
        metrics=metrics,
        curves=curves,
        tags={f"{estimator.kind}.velocity": repr(estimator.causal_velocity) for estimator in estimators},
        artifacts=artifacts(LUGRE_FOLDER),
        datasets={"train": hashlib.sha256("".join(hash_of(path) for path in paths).encode()).hexdigest()},
    )


KINDS = (LugreEstimator, PressureLugreEstimator)


def paths_of_condition(folder: Path, condition: str) -> list[Path]:
    """Return the recordings of one condition in a folder, sorted; raises ``RecordingError`` if there is none."""
    conditions = {path: read_metadata(path).condition for path in recording_paths(folder)}
    chosen = [path for path, its_condition in conditions.items() if its_condition == condition]
    if not chosen:
        raise RecordingError(
            f"{folder}: no recording of condition {condition!r}; got conditions {sorted(set(conditions.values()))}; "
            "name one of them as lugre.condition in params.yaml"
        )
    return chosen


def _metrics(kind: str, found: Identification) -> dict[str, float]:
    metrics = {
        f"{kind}.train_mae_n": found.error_n,
        f"{kind}.train_mae_percent": found.error_percent,
        f"{kind}.steady_curve_mae_n": found.first_error_n,
    }
    metrics |= {f"{kind}.{name}": value for name, value in asdict(found.parameters).items()}
    for name, (lower, upper) in found.intervals.items():
        metrics |= {f"{kind}.{name}.lower": lower, f"{kind}.{name}.upper": upper}
    return metrics


def _stribeck_content(found: Identification) -> dict[str, Any]:
    return {
        "points": [asdict(point) for point in found.points],
        "curve": asdict(found.curve),
        "units": {"velocity_m_s": "m/s", "friction_n": "N", "rows": "samples"},
    }

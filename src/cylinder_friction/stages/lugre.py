"""Stage ``lugre``: LuGre, plain and pressure-scaled, identified in one condition, as published, and in all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.friction_models.identification.procedure import SearchEffort
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.recordings.files import hash_of, whole_folder, write_json
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_metadata, read_recordings, recording_paths
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import LUGRE_FOLDER, PROCESSED_FOLDERS, artifacts, cylinder_from, flat

if TYPE_CHECKING:
    from cylinder_friction.friction_models.identification.procedure import Identification
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import LugreParams

STRIBECK_FILE = "stribeck_points.json"
PIECE_S = 7.5
"""Simulated of each recording where all conditions are identified: an eighth of the rig's, so that four times as many
recordings cost half of what one condition does."""


def run(params: Params) -> RunRecord:
    """Read ``data/processed/train``, write ``models/lugre`` with one folder per estimator and the Stribeck points.

    Raises:
        RecordingError: No training recording is of the condition that ``lugre.condition`` names.
    """
    paths_of_condition(PROCESSED_FOLDERS["train"], params.lugre.condition)
    recordings = read_recordings(PROCESSED_FOLDERS["train"])
    cylinder, settings = cylinder_from(params.cylinder), params.lugre
    estimators: dict[str, AnalyticalEstimator] = {
        "lugre": LugreEstimator(cylinder, **settings.model_dump()),
        "pressure_lugre": PressureLugreEstimator(cylinder, **settings.model_dump()),
        "pressure_lugre_all": AnalyticalEstimator(
            cylinder,
            LuGre(pressure_scaled=True),
            effort=_effort_on_all(settings, recordings),
            velocity_dead_band_m_s=settings.velocity_dead_band_m_s,
            damping_ratio=settings.damping_ratio,
            confidence=settings.confidence,
        ),
    }
    metrics: dict[str, float] = {}
    curves: dict[str, list[float]] = {}
    with whole_folder(LUGRE_FOLDER) as folder:
        for name, estimator in estimators.items():
            estimator.fit(recordings)
            estimator.save(folder / name)
            found = estimator.identification
            assert found is not None
            metrics |= _metrics(name, found)
            curves[f"{name}.search_error_n"] = list(found.history)
        plain = estimators["lugre"].identification
        assert plain is not None
        write_json(folder / STRIBECK_FILE, _stribeck_content(plain))
    return RunRecord(
        name="lugre",
        params=flat(params.lugre),
        metrics=metrics,
        curves=curves,
        tags={f"{name}.velocity": repr(estimator.causal_velocity) for name, estimator in estimators.items()},
        artifacts=artifacts(LUGRE_FOLDER),
        datasets={"train": hash_of(PROCESSED_FOLDERS["train"])},
    )


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


def _effort_on_all(settings: LugreParams, recordings: Sequence[Recording]) -> SearchEffort:
    """Return the search over all conditions: as many recordings of each as of one, and a piece of each."""
    conditions = len({recording.metadata.condition for recording in recordings})
    return SearchEffort(
        settings.seed,
        settings.population,
        settings.generations,
        conditions * settings.simulated_recordings,
        piece_s=PIECE_S,
        polished_piece_s=PIECE_S,
    )


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

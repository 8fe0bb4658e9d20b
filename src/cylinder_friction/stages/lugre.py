"""Stage ``lugre``: identify LuGre, plain and pressure-scaled, in one condition as published and in all conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.files.whole_files import whole_folder, write_json
from cylinder_friction.friction_models.identification.procedure import SearchEffort
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.run_record import RunRecord, Table, by_columns
from cylinder_friction.stages._stage import LUGRE_FOLDER, PROCESSED_FOLDERS, artifacts, datasets, flat

if TYPE_CHECKING:
    from cylinder_friction.friction_models.identification.procedure import Identification
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import LugreParams

STRIBECK_FILE = "stribeck_points.json"
PIECE_S = 7.5
"""Duration simulated of each recording if all conditions are identified [s]. It is an eighth of the rig's recordings,
so four times as many recordings cost half as much as one condition."""


def run(params: Params) -> RunRecord:
    """Read ``data/processed/train``; write ``models/lugre`` with one folder per estimator and the Stribeck points.

    Raises:
        RecordingError: No training recording has the condition ``lugre.condition``.
    """
    recordings = read_stored(PROCESSED_FOLDERS["train"])
    cylinder, settings = params.cylinder, params.lugre
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
    identified: dict[str, Identification] = {}
    with whole_folder(LUGRE_FOLDER) as folder:
        for name, estimator in estimators.items():
            estimator.fit(recordings)
            estimator.save(folder / name)
            assert estimator.identification is not None
            identified[name] = estimator.identification
        write_json(folder / STRIBECK_FILE, _stribeck_content(identified["lugre"], settings.condition))
    return RunRecord(
        name="lugre",
        params=flat(params.lugre),
        metrics={f"train_mae_percent/{name}": found.error_percent for name, found in identified.items()},
        curves={f"search_mae_n/{name}": list(found.history) for name, found in identified.items()},
        tables={"parameters": _parameters(identified)},
        artifacts=artifacts(LUGRE_FOLDER),
        datasets=datasets({"train": PROCESSED_FOLDERS["train"]}),
    )


def _effort_on_all(settings: LugreParams, recordings: Sequence[Recording]) -> SearchEffort:
    """Plan the search over all conditions: as many recordings per condition as usual, and a piece of each recording."""
    conditions = len({recording.metadata.condition for recording in recordings})
    return SearchEffort(
        settings.seed,
        settings.population,
        settings.generations,
        conditions * settings.simulated_recordings,
        piece_s=PIECE_S,
        polished_piece_s=PIECE_S,
    )


def _parameters(identified: Mapping[str, Identification]) -> Table:
    """List every identified parameter with its interval, if it has one; names carry their units."""
    return by_columns(
        {"estimator": kind, "parameter": name, "value": value}
        | dict(zip(("lower", "upper"), found.intervals.get(name, (None, None)), strict=True))
        for kind, found in identified.items()
        for name, value in asdict(found.parameters).items()
    )


def _stribeck_content(found: Identification, condition: str) -> dict[str, Any]:
    return {
        "condition": condition,
        "points": [asdict(point) for point in found.points],
        "curve": asdict(found.curve),
        "units": {"velocity_m_s": "m/s", "friction_n": "N", "rows": "samples"},
    }

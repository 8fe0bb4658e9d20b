"""What every stage shares: where things lie, and how a stage begins and ends."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.files import hash_of

if TYPE_CHECKING:
    from pydantic import BaseModel

    from cylinder_friction.params.data import CylinderParams
    from cylinder_friction.run_record import Scalar

RIG_FOLDER = Path("data/raw/rig")
RIG_TRUTH_FOLDER = Path("data/raw/rig_truth")
RECORDINGS_FOLDER = Path("data/interim/recordings")
SIGNALS_FOLDER = Path("data/interim/signals")
LABELLED_FOLDER = Path("data/processed/labelled")
PROCESSED_FOLDERS = {role: Path("data/processed") / role for role in ("train", "validation", "calibration", "test")}
AUDIT_FOLDER = Path("data/processed/audit")
SEARCH_FOLDER = Path("models/search")
HYBRID_FOLDER = Path("models/hybrid")
LSTM_FOLDER = Path("models/lstm")
PAPER_HYBRID_FOLDER = Path("models/paper_hybrid")
BASELINES_FOLDER = Path("models/baselines")
LUGRE_FOLDER = Path("models/lugre")
REPORTS_FOLDER = Path("reports")
AUDIT_FILE = AUDIT_FOLDER / "audit.json"
METRICS_FILE = REPORTS_FOLDER / "metrics.json"
COVERAGE_FILE = REPORTS_FOLDER / "coverage.json"

# What an earlier stage decided, for the later ones: nobody looks into another stage's section of the parameters.
INGESTED_FILE = Path("data/interim/ingested.json")
"""From ``ingest``: the folders ``source`` and ``truth``; ``load``, what the rod worked against; ``oil_temperature``,
whether estimators take it."""
FILTERS_FILE = SIGNALS_FOLDER / "filters.json"
"""From ``filter``: the ``method`` that smoothed the signals, and the settings of every method."""
IDENTIFIED_FILE = Path("data/processed/identified.json")
"""From ``label``: load and moving mass of each session."""
SPLIT_FILE = Path("data/processed/split.json")
"""From ``split``: the names of the recordings of each role."""
OFFSET_FILE = Path("data/processed/offset.json")
"""From ``offset``: the sensors' offset of each session, or why none was identified."""
ESTIMATORS_FILE = Path("data/processed/estimators.json")
"""From ``offset``: what every estimator is given. ``inputs``, the columns of a sample; ``position_load``, the load that
position decides, or null; ``offset_tracker``, how the sensors' offset is learned while running, or null."""
BEST_FILE = SEARCH_FOLDER / "best.json"
"""From ``search``: the ``design`` and the best hyperparameters of the hybrid."""
SPACE_FILE = SEARCH_FOLDER / "space.json"
"""From ``search``: the ranges that were searched."""
CHOSEN_FILE = "chosen.json"
"""In a hybrid's folder, from ``train`` and ``baselines``: the hyperparameters that it was trained with."""
TRAINING_DATA_FILE = "training_data.json"
"""Beside it: the hash of every source file, by role and recording."""


def cylinder_from(params: CylinderParams) -> Cylinder:
    return Cylinder(**params.model_dump())


def flat(section: BaseModel, prefix: str = "", *, exclude_defaults: bool = False) -> dict[str, Scalar]:
    """Return a section's parameters as ``{"outer.inner": value}``; lists become text."""
    result: dict[str, Scalar] = {}
    for key, value in section.model_dump(exclude_defaults=exclude_defaults).items():
        _flatten(f"{prefix}{key}", value, result)
    return result


def _flatten(key: str, value: Any, into: dict[str, Scalar]) -> None:
    if isinstance(value, dict):
        for inner, content in value.items():
            _flatten(f"{key}.{inner}", content, into)
    else:
        into[key] = value if isinstance(value, str | int | float | bool) else str(value)


def artifacts(*paths: Path) -> dict[str, str]:
    """Return ``{path: hash}`` for a run record."""
    return {path.as_posix(): hash_of(path) for path in paths}

"""What every stage shares: where things lie, and the parts of its run record."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.recordings.storage import columns_and_rows
from cylinder_friction.run_record import Dataset, Scalar

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
HEADLINE_FILE = Path("metrics.json")
"""The ten figures that DVC shows and compares; it lies in Git, so that a fresh clone has those of every commit."""
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
FINALS_FILE = SEARCH_FOLDER / "finals.json"
"""From ``search``: the ranges that were searched."""
CHOSEN_FILE = "chosen.json"
"""In a hybrid's folder, from ``train`` and ``baselines``: the hyperparameters that it was trained with."""
TRAINING_DATA_FILE = "training_data.json"
"""Beside it: the hash of every source file, by role and recording."""


def flat(section: Any, prefix: str = "", *, exclude_defaults: bool = False) -> dict[str, Scalar]:
    """Return a section's parameters as ``{"outer.inner": value}``; lists become text."""
    content = TypeAdapter(type(section)).dump_python(section, exclude_defaults=exclude_defaults)
    result: dict[str, Scalar] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            result |= flat(value, f"{prefix}{key}.")
        else:
            result[prefix + key] = value if isinstance(value, str | int | float | bool) else str(value)
    return result


def artifacts(*paths: Path) -> dict[str, str]:
    """Return ``{path: hash}`` for a run record."""
    return {path.as_posix(): hash_of(path) for path in paths}


def datasets(folders: Mapping[str, Path], *, written: bool = False) -> dict[str, Dataset]:
    """Return folders of recordings for a run record, by role; ``written`` if the stage made them.

    Raises:
        FileNotFoundError: A folder is not there.
    """
    return {
        role: Dataset(folder.as_posix(), hash_of(folder), *columns_and_rows(folder), written)
        for role, folder in folders.items()
    }

"""What every stage shares: where things lie, and the parts of its run record."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from cylinder_friction.dvc_hashes import known_hash
from cylinder_friction.estimators.saved_folder import DESCRIPTION_FILE
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


def artifacts(*paths: Path) -> tuple[str, ...]:
    """Return paths for a run record."""
    return tuple(path.as_posix() for path in paths)


def datasets(folders: Mapping[str, Path]) -> dict[str, Dataset]:
    """Return folders of recordings that a stage reads, by role, for its run record.

    Raises:
        FileNotFoundError: A folder is not there.
    """
    return {
        role: Dataset(folder.as_posix(), known_hash(folder), *columns_and_rows(folder))
        for role, folder in folders.items()
    }


def estimator_folders() -> dict[str, Path]:
    """Return the folder of every estimator that the pipeline made, by name: LuGre, baselines, hybrids.

    Raises:
        FileNotFoundError: The folder of baselines is not there.
    """
    if not BASELINES_FOLDER.is_dir():
        raise FileNotFoundError(f"{BASELINES_FOLDER}: no such folder of baselines; run `dvc repro` to make it")
    known = [folder.name for folder in BASELINES_FOLDER.iterdir() if (folder / DESCRIPTION_FILE).is_file()]
    folders = {name: LUGRE_FOLDER / name for name in ("lugre", "pressure_lugre", "pressure_lugre_all")}
    folders |= {name: BASELINES_FOLDER / name for name in sorted(known, key=_place)}
    return folders | {folder.name: folder for folder in (LSTM_FOLDER, PAPER_HYBRID_FOLDER, HYBRID_FOLDER)}


_ORDER = (
    "force_balance_unfiltered",
    "force_balance_paper",
    "force_balance_low_pass",
    "ridge",
    "random_forest",
    "paper_lstm",
)
SERVABLE = (*_ORDER, LSTM_FOLDER.name, PAPER_HYBRID_FOLDER.name, HYBRID_FOLDER.name)
"""The pipeline's own estimators that have a real-time step, which the served model runs."""


def _place(name: str) -> tuple[int, str]:
    """From simple to elaborate; a baseline the project does not know comes after those it does, by name."""
    return (_ORDER.index(name) if name in _ORDER else len(_ORDER), name)

"""Paths of the pipeline's files, and the parts of a run record that all stages share."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from pydantic import TypeAdapter

from cylinder_friction.dvc_hashes import known_hash
from cylinder_friction.estimators.saved_folder import DESCRIPTION_FILE
from cylinder_friction.recordings.storage import recording_paths
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
"""The ten figures that DVC shows and compares. Git holds the file, so a fresh clone has the figures of every commit."""
COVERAGE_FILE = REPORTS_FOLDER / "coverage.json"

# Decisions of earlier stages for later ones: no stage reads another stage's section of the parameters.
INGESTED_FILE = Path("data/interim/ingested.json")
"""From ``ingest``: the folders ``source`` and ``truth``; ``load``, the source of the load on the rod;
``oil_temperature``, whether it is an input of the estimators."""
FILTERS_FILE = SIGNALS_FOLDER / "filters.json"
"""From ``filter``: the ``method`` that smoothed the signals, and the settings of every method."""
IDENTIFIED_FILE = Path("data/processed/identified.json")
"""From ``label``: load and moving mass of each session."""
SPLIT_FILE = Path("data/processed/split.json")
"""From ``split``: the names of the recordings of each role."""
OFFSET_FILE = Path("data/processed/offset.json")
"""From ``offset``: the sensors' offset of each session, or the reason why none was identified."""
ESTIMATORS_FILE = Path("data/processed/estimators.json")
"""From ``offset``, for every estimator: ``inputs``, the columns of a sample; ``position_load``, the load that depends
on position, or null; ``offset_tracker``, the tracker that learns the sensors' offset at run time, or null."""
BEST_FILE = SEARCH_FOLDER / "best.json"
"""From ``search``: the ``design`` and the best hyperparameters of the hybrid."""
SPACE_FILE = SEARCH_FOLDER / "space.json"
"""From ``search``: the ranges that were searched."""
FINALS_FILE = SEARCH_FOLDER / "finals.json"
CHOSEN_FILE = "chosen.json"
"""From ``train`` and ``baselines``, in a hybrid's folder: the hyperparameters of its training."""
TRAINING_DATA_FILE = "training_data.json"
"""In the same folder: the hash of every source file, by role and recording."""


def flat(section: Any, prefix: str = "", *, exclude_defaults: bool = False) -> dict[str, Scalar]:
    """Flatten a section's parameters to ``{"outer.inner": value}``; lists become text."""
    content = TypeAdapter(type(section)).dump_python(section, exclude_defaults=exclude_defaults)
    result: dict[str, Scalar] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            result |= flat(value, f"{prefix}{key}.")
        else:
            result[prefix + key] = value if isinstance(value, str | int | float | bool) else str(value)
    return result


def artifacts(*paths: Path) -> tuple[str, ...]:
    """Convert paths to the artifacts of a run record."""
    return tuple(path.as_posix() for path in paths)


def datasets(folders: Mapping[str, Path]) -> dict[str, Dataset]:
    """Describe the folders of recordings that a stage reads, by role, for its run record.

    Raises:
        FileNotFoundError: A folder does not exist.
    """
    return {
        role: Dataset(folder.as_posix(), known_hash(folder), *_columns_and_rows(folder))
        for role, folder in folders.items()
    }


def _columns_and_rows(folder: Path) -> tuple[dict[str, str], int]:
    """Return the Arrow type of each column in a folder of recordings, and the total number of rows."""
    heads = [pq.read_metadata(path) for path in recording_paths(folder)]
    columns = {field.name: str(field.type) for head in heads[:1] for field in head.schema.to_arrow_schema()}
    return columns, sum(head.num_rows for head in heads)


def estimator_folders() -> dict[str, Path]:
    """List the folder of every estimator that the pipeline made, by name: LuGre, baselines, hybrids.

    Raises:
        FileNotFoundError: The folder of baselines does not exist.
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
"""The pipeline's own estimators with a real-time step; only these can be served."""


def _place(name: str) -> tuple[int, str]:
    """Sort key of a baseline: known baselines from simple to elaborate, then other baselines by name."""
    return (_ORDER.index(name) if name in _ORDER else len(_ORDER), name)

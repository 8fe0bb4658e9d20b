"""What every stage shares: where things lie, and how a stage begins and ends."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

if TYPE_CHECKING:
    from cylinder_friction.params import CylinderParams
    from cylinder_friction.tracking.run_record import Scalar

from cylinder_friction.cylinder import Cylinder

RIG_FOLDER = Path("data/raw/rig")
RIG_TRUTH_FOLDER = Path("data/raw/rig_truth")
RECORDINGS_FOLDER = Path("data/interim/recordings")
SIGNALS_FOLDER = Path("data/interim/signals")
PROCESSED_FOLDERS = {role: Path("data/processed") / role for role in ("train", "validation", "test")}
AUDIT_FOLDER = Path("data/processed/audit")
SEARCH_FOLDER = Path("models/search")
HYBRID_FOLDER = Path("models/hybrid")
PAPER_HYBRID_FOLDER = Path("models/paper_hybrid")
BASELINES_FOLDER = Path("models/baselines")
LUGRE_FOLDER = Path("models/lugre")
REGISTERED_FILE = Path("models/registered.json")
REPORTS_FOLDER = Path("reports")
RUNS_FOLDER = Path("reports/runs")
"""One ``<stage>.json`` each: the stage's ``RunRecord``, from which its MLflow run is logged, now or later."""


def cylinder_from(params: CylinderParams) -> Cylinder:
    return Cylinder(**params.model_dump())


def flat(section: BaseModel, prefix: str = "") -> dict[str, Scalar]:
    """Returns a section's parameters as ``{"outer.inner": value}``; lists become text."""
    result: dict[str, Scalar] = {}
    for key, value in section.model_dump().items():
        _flatten(f"{prefix}{key}", value, result)
    return result


def _flatten(key: str, value: Any, into: dict[str, Scalar]) -> None:
    if isinstance(value, dict):
        for inner, content in value.items():
            _flatten(f"{key}.{inner}", content, into)
    else:
        into[key] = value if isinstance(value, str | int | float | bool) else str(value)


def hash_of(path: Path) -> str:
    """Returns the SHA-256 of a file, or of a folder's relative names and bytes."""
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            digest.update(file.relative_to(path).as_posix().encode() if path.is_dir() else b"")
            digest.update(file.read_bytes())
    return digest.hexdigest()


def artifacts(*paths: Path) -> dict[str, str]:
    """Returns ``{path: hash}`` for a run record."""
    return {path.as_posix(): hash_of(path) for path in paths}

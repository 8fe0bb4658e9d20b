"""What every stage shares: where things lie, and how a stage begins and ends."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

if TYPE_CHECKING:
    from cylinder_friction.params.data import CylinderParams
    from cylinder_friction.tracking.run_record import Scalar

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.tracking.content import hash_of as hash_of  # noqa: PLC0414 - stages take it from here

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
    """Return a section's parameters as ``{"outer.inner": value}``; lists become text."""
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


def artifacts(*paths: Path) -> dict[str, str]:
    """Return ``{path: hash}`` for a run record."""
    return {path.as_posix(): hash_of(path) for path in paths}


def resume_folder(stage: str, *depends_on: BaseModel | dict[str, str] | dict[str, Any]) -> Path:
    """Return where a killed stage finds what it had finished; a hash of all it depends on, the code included."""
    content = [part.model_dump() if isinstance(part, BaseModel) else part for part in depends_on]
    code = hash_of(Path(__file__).parent.parent / "estimators")
    key = hashlib.sha256(json.dumps([content, code], sort_keys=True).encode()).hexdigest()[:16]
    return Path(".cylinder-friction/resume") / f"{stage}-{key}"

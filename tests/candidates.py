"""A candidate for the champion's place in a written pipeline, and what the registry holds then."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from mlflow import MlflowClient

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.store import tracking_uri
from cylinder_friction.tracking.versions import origin_of

if TYPE_CHECKING:
    from pathlib import Path

    from mlflow.entities.model_registry import ModelVersion

NAME = "friction-estimator"


def candidate_in(root: Path, errors: dict[str, float] | None = None) -> Candidate:
    processed = [f"data/processed/{role}" for role in ("train", "validation", "test")]
    origin = origin_of(root, "data/raw/rig", processed)
    return Candidate(
        NAME,
        "models/hybrid",
        hash_of(root / "models/hybrid"),
        errors or {"1": 2.0, "2": 2.0},
        origin.data["data/processed/test"],
        origin,
        {"pressure_1_pa": [1e6, 1.1e6], "pressure_2_pa": [9e5, 9e5], "position_m": [0.12, 0.121]},
    )


def other_model(root: Path) -> None:
    """Make the candidate's folder another model, which works as well."""
    path = root / "models/hybrid/estimator.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    content["parameters"]["target_mean_n"] += 1.0
    path.write_text(json.dumps(content), encoding="utf-8")
    record_model(root)


def record_model(root: Path) -> None:
    """State in the record of the training that it wrote the model that lies there."""
    path = root / "reports/runs/train.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    content["artifacts"] = {"models/hybrid": hash_of(root / "models/hybrid")}
    path.write_text(json.dumps(content), encoding="utf-8")


def never(folder: Path) -> dict[str, float]:
    raise AssertionError(f"{folder} was measured again without need")


def versions(root: Path) -> list[ModelVersion]:
    client = MlflowClient(tracking_uri(root))
    found = client.search_model_versions(f"name = '{NAME}'")
    return sorted((client.get_model_version(NAME, one.version) for one in found), key=lambda one: int(one.version))


def champion(root: Path) -> str:
    return str(MlflowClient(tracking_uri(root)).get_model_version_by_alias(NAME, "champion").version)

"""The model registry: a candidate becomes a version once, and the champion only if the gate lets it."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import pandas as pd
from mlflow.entities import LoggedModelOutput
from mlflow.entities.logged_model_status import LoggedModelStatus
from mlflow.exceptions import MlflowException
from mlflow.models import Model

from cylinder_friction.tracking.content import hash_of
from cylinder_friction.tracking.errors import TrackingError
from cylinder_friction.tracking.gate import Decision, decide
from cylinder_friction.tracking.log_run import log_in
from cylinder_friction.tracking.model_folder import (
    ESTIMATOR_ARTIFACT,
    artifact_path,
    download_model,
    save_model_folder,
)
from cylinder_friction.tracking.repository import commit_of
from cylinder_friction.tracking.run_record import RunRecord
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.tracking.versions import Origin

if TYPE_CHECKING:
    from collections.abc import Callable

    from mlflow.entities.model_registry import ModelVersion

ALIAS = "champion"
REGISTERED_FILE = "models/registered.json"
TRAIN_RECORD = "reports/runs/train.json"

_KEY = "model_key"
_TEST_DATA = "gate_test_data_md5"
_ERRORS = "gate_errors_percent"
_INCUMBENT = "gate_incumbent"
_REASON = "gate_reason"
_DECISION = "gate_decision"

Errors = dict[str, float]
"""Error a test [percent of mean |label|]."""


@dataclass(frozen=True)
class Candidate:
    """A trained estimator that asks for the champion's place.

    Attributes:
        model_name: Name in the registry.
        folder: Folder of the saved estimator, relative to the repository's root.
        model_key: Hash of that folder's content.
        errors_percent: Its error a test on the held-out recordings.
        test_data_md5: Hash of these recordings.
        origin: What it was made from.
        example: A few rows of raw samples, by column.
    """

    model_name: str
    folder: str
    model_key: str
    errors_percent: Errors
    test_data_md5: str
    origin: Origin
    example: dict[str, list[float]]


@dataclass(frozen=True)
class Incumbent:
    """The model in use when the gate decided."""

    model_key: str
    errors_percent: Errors


@dataclass(frozen=True)
class Registered:
    """What a registration came to, without time and version numbers: equal work gives equal bytes."""

    candidate: Candidate
    alias: str
    promote: bool
    reason: str
    tolerance_percent: float
    incumbent: Incumbent | None

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        stored = content["candidate"]
        candidate = Candidate(**{**stored, "origin": Origin.from_dict(stored["origin"])})
        incumbent = None if content["incumbent"] is None else Incumbent(**content["incumbent"])
        return cls(**{**content, "candidate": candidate, "incumbent": incumbent})


def register(
    candidate: Candidate, root: Path, tolerance_percent: float, measure_again: Callable[[Path], Errors]
) -> Registered:
    """Makes the candidate a version of the registered model and, if the gate lets it, the champion.

    A refused candidate becomes a version too, without the alias: the registry then shows what was tried and why it
    was refused. Whatever moment a kill comes at, calling it again ends in the same state: a model is recognised by
    its content, a half-logged one is deleted, and the alias moves last, in one step.

    Args:
        candidate: The trained estimator.
        root: The repository's root.
        tolerance_percent: Of the gate.
        measure_again: Returns the errors of the estimator saved in a folder on the present held-out recordings;
            called only where the champion was measured on other ones.

    Raises:
        TrackingError: The registry cannot be reached, or the candidate's folder is not the one that was measured.
    """
    with open_store(root) as store:
        version = _ensure_version(store, candidate, root)
        champion = _champion(store, candidate.model_name)
        if _same(champion, version) and _DECISION in version.tags:
            return _decided_before(candidate, version, tolerance_percent)
        incumbent = _incumbent(store, champion, candidate, measure_again)
        decision = decide(
            candidate.errors_percent, None if incumbent is None else incumbent.errors_percent, tolerance_percent
        )
        result = Registered(candidate, ALIAS, decision.promote, decision.reason, tolerance_percent, incumbent)
        _write_decision(store, version, result)
        if decision.promote:
            _promote(store, version, champion)
        return result


def register_again(root: Path) -> str | None:
    """Makes what ``models/registered.json`` says true of the store in use; returns it in words, None without the file.

    The decision stands as it was made. The alias goes to the version only where it was promoted and nobody else has
    taken the place since.

    Raises:
        TrackingError: The store cannot be reached, or the model's folder is missing or not the registered one.
    """
    path = root / REGISTERED_FILE
    if not path.is_file():
        return None
    registered = Registered.from_dict(json.loads(path.read_text(encoding="utf-8")))
    candidate = registered.candidate
    with open_store(root) as store:
        version = _ensure_version(store, candidate, root)
        if _DECISION not in version.tags:
            _write_decision(store, version, registered)
        champion = _champion(store, candidate.model_name)
        beaten = None if registered.incumbent is None else registered.incumbent.model_key
        if registered.promote and (champion is None or champion.tags.get(_KEY) == beaten):
            _promote(store, version, champion)
            champion = version
        role = f"{ALIAS}" if _same(champion, version) else f"not {ALIAS}"
    return f"{candidate.model_name} version {version.version} ({role})"


def _ensure_version(store: Store, candidate: Candidate, root: Path) -> ModelVersion:
    _refuse_changed_model(candidate, root)
    found = _version_of(store, candidate)
    if found is not None:
        return found
    model_id, run_id = _ensure_logged_model(store, candidate, root)
    try:
        store.client.create_registered_model(
            candidate.model_name,
            description="Friction inside a hydraulic cylinder [N] from two pressures and position.",
        )
    except MlflowException as error:
        if error.error_code != "RESOURCE_ALREADY_EXISTS":
            raise
    store.client.create_model_version(
        candidate.model_name,
        source=f"models:/{model_id}",
        run_id=run_id,
        model_id=model_id,
        tags={_KEY: candidate.model_key, **commit_of(root).tags(), **candidate.origin.tags()},
    )
    made = _version_of(store, candidate)
    if made is None:
        raise TrackingError(f"{candidate.model_name}: the registry at {store.uri} took a version but does not show it")
    return made


def _version_of(store: Store, candidate: Candidate) -> ModelVersion | None:
    query = f"name = '{candidate.model_name}' and tags.`{_KEY}` = '{candidate.model_key}'"
    versions = sorted(store.client.search_model_versions(query), key=lambda version: int(version.version))
    return store.client.get_model_version(candidate.model_name, versions[0].version) if versions else None


def _ensure_logged_model(store: Store, candidate: Candidate, root: Path) -> tuple[str, str]:
    """Returns the ids of the logged model and of the run that made it; logs both where they are not there whole."""
    run_id = log_in(store, _training_record(candidate, root), root)
    query = f"tags.`{_KEY}` = '{candidate.model_key}'"
    for model in store.client.search_logged_models([store.experiment_id], filter_string=query):
        if model.status == LoggedModelStatus.READY and model.source_run_id == run_id:
            return str(model.model_id), run_id
        store.client.delete_logged_model(model.model_id)
    model = store.client.create_logged_model(
        store.experiment_id,
        name=Path(candidate.folder).name,
        source_run_id=run_id,
        tags={_KEY: candidate.model_key},
        params={"candidate": candidate.folder},
        model_type="friction estimator",
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "model"
        origin = candidate.origin
        lineage = {
            _KEY: candidate.model_key,
            **asdict(commit_of(root)),
            **origin.to_dict(),
            "params_sha256": origin.params_sha256,
        }
        mlflow_model = Model(
            artifact_path=model.artifact_location, model_uuid=model.model_id, run_id=run_id, model_id=model.model_id
        )
        save_model_folder(folder, root / candidate.folder, lineage, pd.DataFrame(candidate.example), mlflow_model)
        for cache in folder.rglob("__pycache__"):
            shutil.rmtree(cache)
        store.client.log_model_artifacts(model.model_id, str(folder))
    store.client.log_outputs(run_id, [LoggedModelOutput(model.model_id, step=0)])
    store.client.finalize_logged_model(model.model_id, LoggedModelStatus.READY)
    return str(model.model_id), run_id


def _training_record(candidate: Candidate, root: Path) -> RunRecord:
    """Returns the record of the stage that made the model; a short one of its own where that file is not there."""
    path = root / TRAIN_RECORD
    if path.is_file():
        return RunRecord.from_dict(json.loads(path.read_text(encoding="utf-8")))
    return RunRecord(name="train", artifacts={candidate.folder: candidate.model_key})


def _refuse_changed_model(candidate: Candidate, root: Path) -> None:
    folder = root / candidate.folder
    if not folder.is_dir():
        raise TrackingError(f"{folder}: not there; run `dvc pull` or `dvc repro` to have the model")
    found = hash_of(folder)
    if found != candidate.model_key:
        raise TrackingError(
            f"{folder}: its content hash is {found[:12]}…, but {candidate.model_key[:12]}… was measured; run `dvc "
            "checkout` or `dvc repro`"
        )


def _champion(store: Store, model_name: str) -> ModelVersion | None:
    try:
        return store.client.get_model_version_by_alias(model_name, ALIAS)
    except MlflowException as error:
        if error.error_code in ("RESOURCE_DOES_NOT_EXIST", "INVALID_PARAMETER_VALUE"):
            return None
        raise


def _same(champion: ModelVersion | None, version: ModelVersion) -> bool:
    return champion is not None and str(champion.version) == str(version.version)


def _incumbent(
    store: Store, champion: ModelVersion | None, candidate: Candidate, measure_again: Callable[[Path], Errors]
) -> Incumbent | None:
    """Returns the champion's figures: its own where they were measured on the same recordings, else measured anew."""
    if champion is None:
        return None
    key = champion.tags.get(_KEY, "unknown")
    if champion.tags.get(_TEST_DATA) == candidate.test_data_md5:
        return Incumbent(key, json.loads(champion.tags[_ERRORS]))
    with tempfile.TemporaryDirectory() as scratch:
        folder = download_model(store, champion, Path(scratch))
        return Incumbent(key, measure_again(artifact_path(folder, ESTIMATOR_ARTIFACT)))


def _decided_before(candidate: Candidate, version: ModelVersion, tolerance_percent: float) -> Registered:
    """The candidate is the champion already: the decision that made it so stands."""
    stored = json.loads(version.tags[_INCUMBENT])
    decision = Decision(version.tags[_DECISION] == "promoted", version.tags[_REASON])
    incumbent = None if stored is None else Incumbent(**stored)
    return Registered(candidate, ALIAS, decision.promote, decision.reason, tolerance_percent, incumbent)


def _write_decision(store: Store, version: ModelVersion, registered: Registered) -> None:
    tags = {
        _ERRORS: json.dumps(registered.candidate.errors_percent, sort_keys=True),
        _TEST_DATA: registered.candidate.test_data_md5,
        "gate_tolerance_percent": str(registered.tolerance_percent),
        _INCUMBENT: json.dumps(None if registered.incumbent is None else asdict(registered.incumbent)),
        _REASON: registered.reason,
        _DECISION: "promoted" if registered.promote else "refused",
    }
    for key, value in tags.items():  # the decision itself last: where it stands, the rest stands
        store.client.set_model_version_tag(version.name, version.version, key, value)
    store.client.update_model_version(version.name, version.version, registered.reason)


def _promote(store: Store, version: ModelVersion, champion: ModelVersion | None) -> None:
    """Moves the alias, last and in one step; tags say from where to where, since MLflow keeps no history of it."""
    tags = {
        "promoted_from": "none" if champion is None else f"version {champion.version}",
        "promoted_to": f"version {version.version}",
        "promoted_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    for key, value in tags.items():
        store.client.set_model_version_tag(version.name, version.version, key, value)
    store.client.set_registered_model_alias(version.name, ALIAS, version.version)

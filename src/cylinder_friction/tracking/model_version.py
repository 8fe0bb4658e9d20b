"""A candidate becomes a version of the registered model, once, whatever moment a kill comes at."""

import json
import shutil
import tempfile
from dataclasses import asdict
from pathlib import Path

import pandas as pd
from mlflow.entities import LoggedModelOutput
from mlflow.entities.logged_model_status import LoggedModelStatus
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.run_record import RunRecord
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.log_run import log_in
from cylinder_friction.tracking.model_folder import save_model_folder
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store

MODEL_KEY = "model_key"
"""Tag of a version and of its logged model: the hash of the candidate's folder, by which it is recognised."""

TRAINING_STAGES = ("train", "baselines")  # The stages that make what can be registered


def ensure_version(store: Store, candidate: Candidate, root: Path) -> ModelVersion:
    """Return the candidate's version of the registered model; logs the model and makes the version where they lack.

    Raises:
        TrackingError: The candidate's folder is not the one that was measured, or the registry lost the version.
    """
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
        tags={MODEL_KEY: candidate.model_key, **commit_of(root).tags(), **candidate.origin.tags()},
    )
    made = _version_of(store, candidate)
    if made is None:
        raise TrackingError(f"{candidate.model_name}: the registry at {store.uri} took a version but does not show it")
    return made


def _version_of(store: Store, candidate: Candidate) -> ModelVersion | None:
    query = f"name = '{candidate.model_name}' and tags.`{MODEL_KEY}` = '{candidate.model_key}'"
    versions = sorted(store.client.search_model_versions(query), key=lambda version: int(version.version))
    return store.client.get_model_version(candidate.model_name, versions[0].version) if versions else None


def _ensure_logged_model(store: Store, candidate: Candidate, root: Path) -> tuple[str, str]:
    """Return the ids of the logged model and of the run that made it; logs both where they are not there whole."""
    run_id = log_in(store, _training_record(candidate, root), root)
    query = f"tags.`{MODEL_KEY}` = '{candidate.model_key}'"
    for model in store.client.search_logged_models([store.experiment_id], filter_string=query):
        if model.status == LoggedModelStatus.READY and model.source_run_id == run_id:
            return str(model.model_id), run_id
        store.client.delete_logged_model(model.model_id)
    model = store.client.create_logged_model(
        store.experiment_id,
        name=Path(candidate.folder).name,
        source_run_id=run_id,
        tags={MODEL_KEY: candidate.model_key},
        params={"candidate": candidate.folder},
        model_type="friction estimator",
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "model"
        origin = candidate.origin
        lineage = {
            MODEL_KEY: candidate.model_key,
            **asdict(commit_of(root)),
            **asdict(origin),
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
    """Return the record of the stage that made the model; a short one of its own where that file is not there."""
    for stage in TRAINING_STAGES:
        path = root / f"reports/runs/{stage}.json"
        if path.is_file():
            record = RunRecord.from_dict(json.loads(path.read_text(encoding="utf-8")))
            if candidate.folder in record.artifacts:
                return record
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

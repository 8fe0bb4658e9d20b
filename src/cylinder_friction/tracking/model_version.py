"""A candidate becomes a version of the registered model, once, whatever moment a kill comes at."""

import json
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
from mlflow.entities import LoggedModel, LoggedModelOutput
from mlflow.entities.logged_model_status import LoggedModelStatus
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS, MLFLOW_PARENT_RUN_ID

from cylinder_friction.recordings.files import hash_of, json_hash
from cylinder_friction.run_record import STAGES, RunRecord, records_in
from cylinder_friction.tracking.executions import CANDIDATE_KEY, allowed, digest_of
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.log_run import log_in
from cylinder_friction.tracking.measurement import SYSTEM_PREFIX
from cylinder_friction.tracking.model_folder import save_model_folder
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store

MODEL_KEY = "model_key"
"""Tag of a version and of its logged model: the hash of the candidate's folder."""
CONTENT_KEY = "content_sha256"
"""Tag of both: the hash of all files of the logged model."""
WRITTEN_ON_LOADING = "registered_model_meta"
"""File that MLflow adds to a model in a local store when it is loaded by its registered name; it counts for nothing."""
GATE = "gate"
"""Tag of both, JSON: what the gate is asked."""
RUN_KEY = "run"
"""In ``lineage.json``: figures of the run that made the model, and the digests of what it used."""
LINEAGE = "lineage"
"""Tag of both, JSON: the commit, the data's hashes and the parameters' hash."""
DECISION = "gate_decision"
"""Tag of a version, written last: while a version lacks it, versions after it wait."""
ABANDONED = "abandoned"
"""Decision on a version whose machine stopped before it was decided; the candidate may ask again."""

_SHARED_TAGS = (MODEL_KEY, CANDIDATE_KEY, CONTENT_KEY, GATE, LINEAGE)
TRAINING_STAGES = ("train", "baselines")  # The stages that make what can be registered
_BEFORE_TRAINING = STAGES[: STAGES.index("train")]


def ensure_version(
    store: Store, candidate: Candidate, root: Path, decision: Mapping[str, str] | None = None
) -> ModelVersion:
    """Return the candidate's version of the registered model; logs the model and makes the version where they lack.

    ``decision`` are tags of a version that is made: of one that is already decided.

    Raises:
        TrackingError: The candidate's folder is not the one that was measured, or the registry lost the version.
    """
    _refuse_changed_model(candidate, root)
    version = find_version(store, candidate) or _make_version(store, candidate, root, decision or {})
    _show_as_registered(store, version)
    return version


def _make_version(store: Store, candidate: Candidate, root: Path, decision: Mapping[str, str]) -> ModelVersion:
    model = _ensure_logged_model(store, candidate, root)
    try:
        store.client.create_registered_model(
            candidate.model_name,
            description="Friction inside a hydraulic cylinder [N] from two pressures and position.",
        )
    except MlflowException as error:
        if error.error_code != "RESOURCE_ALREADY_EXISTS":
            raise
    made = store.client.create_model_version(
        candidate.model_name,
        source=f"models:/{model.model_id}",
        run_id=model.source_run_id,
        model_id=model.model_id,
        tags={**{key: model.tags[key] for key in _SHARED_TAGS}, **decision},
    )
    first = find_version(store, candidate)
    if first is None:
        raise TrackingError(f"{candidate.model_name}: the registry at {store.uri} took a version but does not show it")
    if first.version != made.version:  # another machine has made the same one just before
        store.client.delete_model_version(made.name, made.version)
    return first


def find_version(store: Store, candidate: Candidate) -> ModelVersion | None:
    """Return the candidate's version, the first where there are several."""
    query = f"name = '{candidate.model_name}' and tags.`{CANDIDATE_KEY}` = '{candidate.key()}'"
    found = [one for one in store.client.search_model_versions(query) if one.tags.get(DECISION) != ABANDONED]
    return min(found, key=lambda version: int(version.version), default=None)


def _show_as_registered(store: Store, version: ModelVersion) -> None:
    """Let the logged model name its version, as ``mlflow.register_model`` does, which can give a version no run."""
    model = store.logged_model(version)
    known = json.loads(model.tags.get(MLFLOW_MODEL_VERSIONS, "[]"))
    own = {"name": version.name, "version": str(version.version)}
    if own not in known:
        store.client.set_logged_model_tags(model.model_id, {MLFLOW_MODEL_VERSIONS: json.dumps([*known, own])})


def tags_of(lineage: Mapping[str, Any]) -> dict[str, str]:
    """Return the tags of a version that follow from the ``lineage.json`` inside its model."""
    origin = {
        "git_commit": lineage["sha"],
        "git_dirty": lineage["dirty"],
        "data": lineage["data"],
        "params_sha256": json_hash(lineage["params"]),
    }
    return {
        **{key: lineage[key] for key in (MODEL_KEY, CANDIDATE_KEY)},
        GATE: json.dumps(lineage["gate"], sort_keys=True),
        LINEAGE: json.dumps(origin, sort_keys=True),
    }


def run_content(metrics: Mapping[str, float], datasets: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Return what of a run is compared with the store, by the names that MLflow takes."""
    own = {allowed(name): value for name, value in metrics.items() if not name.startswith(SYSTEM_PREFIX)}
    return {"metrics": own, "datasets": dict(datasets)}


def _ensure_logged_model(store: Store, candidate: Candidate, root: Path) -> LoggedModel:
    """Return the logged model; logs it and the run that made it where they are not there whole."""
    record = _training_record(candidate, root)
    run_id = log_in(store, record, root)
    query = f"tags.`{CANDIDATE_KEY}` = '{candidate.key()}'"
    for model in store.client.search_logged_models([store.experiment_id], filter_string=query):
        if model.status == LoggedModelStatus.READY and model.source_run_id == run_id:
            return model
        store.client.delete_logged_model(model.model_id)
    model = store.client.create_logged_model(
        store.experiment_id,
        name=Path(candidate.folder).name,
        source_run_id=run_id,
        tags={CANDIDATE_KEY: candidate.key()},
        params={allowed(key): str(value) for key, value in record.params.items()},
        model_type="friction estimator",
    )
    metrics = record.metrics | {name: values[-1] for name, values in record.curves.items() if values}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "model"
        lineage = {
            MODEL_KEY: candidate.model_key,
            CANDIDATE_KEY: candidate.key(),
            "gate": candidate.gate(),
            "code": _code(root, record),
            RUN_KEY: run_content(metrics, {role: digest_of(each) for role, each in record.datasets.items()}),
            **asdict(commit_of(root, record.name, record.code)),
            **asdict(candidate.origin),
            "params_sha256": candidate.origin.params_sha256,
        }
        mlflow_model = Model(
            artifact_path=model.artifact_location, model_uuid=model.model_id, run_id=run_id, model_id=model.model_id
        )
        save_model_folder(folder, root / candidate.folder, lineage, pd.DataFrame(candidate.example), mlflow_model)
        for cache in folder.rglob("__pycache__"):
            shutil.rmtree(cache)
        tags = {**tags_of(lineage), CONTENT_KEY: hash_of(folder, WRITTEN_ON_LOADING)}
        store.client.set_logged_model_tags(model.model_id, tags)
        store.client.log_model_artifacts(model.model_id, str(folder))
    execution = store.client.get_run(run_id).data.tags.get(MLFLOW_PARENT_RUN_ID)
    for run in filter(None, (run_id, execution)):
        store.client.log_outputs(run, [LoggedModelOutput(model.model_id, step=0)])
    return store.client.finalize_logged_model(model.model_id, LoggedModelStatus.READY)


def _code(root: Path, trained: RunRecord) -> dict[str, str]:
    """Return the hash of the code of each stage that made the model, from the records of their runs."""
    known = {stage: record for stage, record in records_in(root).items() if stage in _BEFORE_TRAINING}
    return {stage: record.code for stage, record in {**known, trained.name: trained}.items()}


def _training_record(candidate: Candidate, root: Path) -> RunRecord:
    """Return the record of the stage that made the model; a short one of its own where that file is not there."""
    known = records_in(root)
    made = [known[stage] for stage in TRAINING_STAGES if stage in known and candidate.folder in known[stage].artifacts]
    return made[0] if made else RunRecord(name="train", artifacts={candidate.folder: candidate.model_key})


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

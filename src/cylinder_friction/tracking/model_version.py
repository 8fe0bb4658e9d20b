"""Make a candidate a version of the registered model exactly once, even if the process is killed at any moment."""

import json
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pandas as pd
from mlflow.entities import LoggedModel, LoggedModelOutput, Metric
from mlflow.entities.logged_model_status import LoggedModelStatus
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS

from cylinder_friction.deployment.served_model import save_model_folder
from cylinder_friction.dvc_hashes import known_hash
from cylinder_friction.evaluation.reported import error_metrics
from cylinder_friction.execution.measuring import now_ms
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.run_record import RunRecord, records_in
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.log_run import allowed, log_pipeline
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store

# Tags of a version: first the tags for people, then hashes.
DECISION, REASON, COMMIT = "decision", "reason", "commit"
PENDING = "pending"
"""Value of ``DECISION`` while the gate decides on a version; later versions wait."""
CANDIDATE, MODEL, FILES = "hash_candidate", "hash_model", "hash_files"
WRITTEN_ON_LOADING = "registered_model_meta"
"""File that MLflow adds to a model when it loads the model by its registered name; the hash leaves the file out."""


def ensure_version(store: Store, candidate: Candidate, root: Path) -> ModelVersion:
    """Find the candidate's version of the registered model, or log the model and make the version.

    Raises:
        TrackingError: The candidate's folder is missing or has changed since its errors were measured.
    """
    if known := find_version(store, candidate):
        return known
    client, model = store.client, _ensure_logged_model(store, candidate, root)
    with suppress(MlflowException):  # the registered model already exists
        about = "Friction inside a hydraulic cylinder [N] from two pressures and position."
        client.create_registered_model(candidate.model_name, description=about)
    tags = {
        DECISION: PENDING,
        "error_percent": candidate.error_words(),
        "recipe": candidate.pipeline["recipe"],
        COMMIT: model.tags[COMMIT],
        REASON: "being decided",
        **{name: model.tags[name] for name in (CANDIDATE, MODEL, FILES)},
    }
    source = f"models:/{model.model_id}"
    made = client.create_model_version(candidate.model_name, source, model.source_run_id, tags, model_id=model.model_id)
    first = find_version(store, candidate) or made
    if first.version != made.version:  # another machine made the same version just before
        client.delete_model_version(made.name, made.version)
    shown = json.dumps([{"name": first.name, "version": str(first.version)}])
    client.set_logged_model_tags(model.model_id, {MLFLOW_MODEL_VERSIONS: shown})  # as `mlflow.register_model` does
    return first


def find_version(store: Store, candidate: Candidate) -> ModelVersion | None:
    """Find the candidate's version: the first if there are several, None if there is none."""
    query = f"name = '{candidate.model_name}' and tags.`{CANDIDATE}` = '{candidate.key()}'"
    return min(store.client.search_model_versions(query), key=lambda each: int(each.version), default=None)


def _ensure_logged_model(store: Store, candidate: Candidate, root: Path) -> LoggedModel:
    """Find the logged model; if it is missing or incomplete, log it with the pipeline's run."""
    records, client, folder = records_in(root), store.client, root / candidate.folder
    compared = replace(records.get("compare", RunRecord("compare")), pipeline=candidate.pipeline)
    trained = next((each for each in records.values() if candidate.folder in each.artifacts), RunRecord("train"))
    experiment, run_id = store.experiment(compared.experiment), log_pipeline(store, compared, root)
    for model in client.search_logged_models([experiment], filter_string=f"tags.`{CANDIDATE}` = '{candidate.key()}'"):
        if model.status == LoggedModelStatus.READY and model.source_run_id == run_id:
            return model
        client.delete_logged_model(model.model_id)
    found = known_hash(folder, root) if folder.is_dir() else ""
    if found != candidate.model_md5:
        there = f"its hash is {found[:12]}…" if found else "it is not there"
        raise TrackingError(
            f"{folder}: {there}, but {candidate.model_md5[:12]}… was measured; run `dvc checkout`, `dvc pull` or "
            "`dvc repro`"
        )
    commit = trained.commit or commit_of(root)
    tags = {COMMIT: commit["git_commit"], CANDIDATE: candidate.key(), MODEL: candidate.model_md5}
    params = {allowed(key): str(value) for key, value in trained.params.items()}
    model = client.create_logged_model(experiment, folder.name, run_id, tags, params)
    origin = {"run_id": run_id, "recipe": candidate.pipeline["recipe"]}
    origin |= {**commit, "data": candidate.data, "params": candidate.params}
    about = Model(model.artifact_location, run_id, model_uuid=model.model_id, model_id=model.model_id)
    with tempfile.TemporaryDirectory() as scratch:
        written = Path(scratch) / "model"
        save_model_folder(written, folder, origin, pd.DataFrame(candidate.example), about)
        client.set_logged_model_tags(model.model_id, {FILES: hash_of(written, WRITTEN_ON_LOADING)})
        client.log_model_artifacts(model.model_id, str(written))
    client.log_outputs(run_id, [LoggedModelOutput(model.model_id, step=0)])
    test = compared.datasets.get("test")
    of = (model.model_id, "test", test.md5) if test else (model.model_id,)
    errors = error_metrics(candidate.errors_percent, candidate.reference)
    client.log_batch(run_id, [Metric(allowed(name), value, now_ms(), 0, *of) for name, value in errors.items()])
    return client.finalize_logged_model(model.model_id, LoggedModelStatus.READY)

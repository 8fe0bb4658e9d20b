"""One run record becomes one MLflow run, however often it is logged."""

import getpass
import json
import logging
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from mlflow.entities import Dataset, DatasetInput, InputTag, Metric, Param, Run
from mlflow.exceptions import MlflowException
from mlflow.utils.mlflow_tags import (
    MLFLOW_DATASET_CONTEXT,
    MLFLOW_GIT_COMMIT,
    MLFLOW_PARENT_RUN_ID,
    MLFLOW_RUN_NAME,
    MLFLOW_SOURCE_NAME,
    MLFLOW_SOURCE_TYPE,
    MLFLOW_USER,
)

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.run_record import RunRecord
from cylinder_friction.tracking.repository import Commit, TrackingError, commit_of
from cylinder_friction.tracking.resources import resource_metrics
from cylinder_friction.tracking.store import Store, open_store

KEY_TAG = "record_key"  # Content key of a top-level run's record: how a run is recognised
_METRICS_A_REQUEST = 1000
_PARAMS_A_REQUEST = 100
_LONGEST_PARAM = 6000
_LONGEST_DIGEST = 36

_Item = TypeVar("_Item")

_log = logging.getLogger(__name__)


def log_run(record: RunRecord, root: Path) -> str:
    """Log a record as an MLflow run with its children below it, and return the run's id.

    A run that is already there whole is returned as it is; one that a kill left half-written is deleted and
    logged anew. Two records with equal content are one run.

    Raises:
        TrackingError: The store cannot be reached, or an artifact is missing or not the one that was recorded.
    """
    with open_store(root) as store:
        return log_in(store, record, root)


def track_or_warn(record: RunRecord, root: Path) -> str | None:
    """Log a record like ``log_run``; where that fails, warn and name the command that catches up."""
    try:
        return log_run(record, root)
    except Exception as error:  # whatever the store does must not cost a finished stage its result
        _log.warning(
            "%s: its results are written, but its MLflow run is not: %s. Run `cylinder-friction track` to log it "
            "from the files when the tracking store can be reached.",
            record.name,
            error,
        )
        return None


def find_run(store: Store, record: RunRecord) -> str | None:
    """Return the id of the finished run of this very record, if there is one."""
    finished = [run for run in _runs_of(store, record) if run.info.status == "FINISHED"]
    return finished[0].info.run_id if finished else None


def log_in(store: Store, record: RunRecord, root: Path) -> str:
    """Do what ``log_run`` does, in a store that is already open."""
    found = find_run(store, record)
    if found is not None:
        return found
    _refuse_changed_artifacts(record, root)
    for half_written in _runs_of(store, record):
        _delete_with_children(store, half_written)
    return _write_run(
        store, record, root, commit_of(root, record.name, record.code), store.experiment(record.experiment), parent=None
    )


def _runs_of(store: Store, record: RunRecord) -> list[Run]:
    return list(store.client.search_runs([store.experiment(record.experiment)], f"tags.{KEY_TAG} = '{record.key()}'"))


def _delete_with_children(store: Store, run: Run) -> None:
    below = f"tags.`{MLFLOW_PARENT_RUN_ID}` = '{run.info.run_id}'"
    for child in store.client.search_runs([run.info.experiment_id], below, max_results=10_000):
        _delete_with_children(store, child)
    store.client.delete_run(run.info.run_id)


def _write_run(
    store: Store, record: RunRecord, root: Path, commit: Commit, experiment_id: str, parent: str | None
) -> str:
    started_ms = int(time.time() * 1000)
    tags = _tags(record, commit, parent)
    run_id = str(store.client.create_run(experiment_id, started_ms, tags, run_name=record.name).info.run_id)
    try:
        _write_values(store, run_id, record, root, started_ms, parent)
        for path in sorted(record.artifacts):
            _write_artifact(store, run_id, root, path)
        _write_datasets(store, run_id, record)
    except MlflowException as error:
        raise TrackingError(f"run {record.name!r}: MLflow refused it: {error.message}") from error
    for child in record.children:
        _write_run(store, child, root, commit, experiment_id, parent=run_id)
    store.client.set_terminated(run_id, "FINISHED")
    return run_id


def _tags(record: RunRecord, commit: Commit, parent: str | None) -> dict[str, str]:
    tags = {
        **record.tags,
        **commit.tags(),
        MLFLOW_RUN_NAME: record.name,
        MLFLOW_SOURCE_NAME: f"cylinder-friction {record.name}",
        MLFLOW_SOURCE_TYPE: "PROJECT",
        MLFLOW_GIT_COMMIT: commit.sha,
        MLFLOW_USER: getpass.getuser(),
    }
    if "DVC_EXP_NAME" in os.environ:
        tags["dvc_exp_name"] = os.environ["DVC_EXP_NAME"]
    return {**tags, MLFLOW_PARENT_RUN_ID: parent} if parent else {**tags, "stage": record.name, KEY_TAG: record.key()}


def _write_values(
    store: Store, run_id: str, record: RunRecord, root: Path, started_ms: int, parent: str | None
) -> None:
    params = [Param(_allowed(key), str(value)[:_LONGEST_PARAM]) for key, value in record.params.items()]
    for params_chunk in _chunks(params, _PARAMS_A_REQUEST):
        store.client.log_batch(run_id, params=params_chunk)
    metrics = [
        Metric(_allowed(name), value, started_ms + step, step)
        for name, values in record.curves.items()
        for step, value in enumerate(values)
    ]
    for name, value in record.metrics.items():
        step = len(record.curves.get(name, ()))  # the figure stands after a curve of the same name
        metrics.append(Metric(_allowed(name), value, started_ms + step, step))
    if parent is None:
        metrics += resource_metrics(root, record)
    for metrics_chunk in _chunks(metrics, _METRICS_A_REQUEST):
        store.client.log_batch(run_id, metrics=metrics_chunk)


def _write_artifact(store: Store, run_id: str, root: Path, path: str) -> None:
    source = root / path
    if source.is_dir():
        store.client.log_artifacts(run_id, str(source), path)
    else:
        store.client.log_artifact(run_id, str(source), path.rpartition("/")[0] or None)


def _write_datasets(store: Store, run_id: str, record: RunRecord) -> None:
    inputs = [
        DatasetInput(
            Dataset(
                name=role,
                digest=sha256[:_LONGEST_DIGEST],
                source_type="dvc",
                source=json.dumps({"role": role, "sha256": sha256}),
            ),
            [InputTag(MLFLOW_DATASET_CONTEXT, role)],
        )
        for role, sha256 in sorted(record.datasets.items())
    ]
    if inputs:
        store.client.log_inputs(run_id, inputs)


def _refuse_changed_artifacts(record: RunRecord, root: Path) -> None:
    for path, expected in sorted(record.artifacts.items()):
        if not (root / path).exists():
            raise TrackingError(f"run {record.name!r}: {path} is not there; run `dvc pull` or `dvc repro` to have it")
        found = hash_of(root / path)
        if found != expected:
            raise TrackingError(
                f"run {record.name!r}: {path} is not what the stage wrote: its hash is {found[:12]}…, but "
                f"{expected[:12]}… was recorded; run `dvc checkout` or `dvc repro`"
            )
    for child in record.children:
        _refuse_changed_artifacts(child, root)


def _allowed(name: str) -> str:
    """Return a name that MLflow takes: letters, digits, ``_ - . / :`` and spaces."""
    return re.sub(r"[^\w\-./: ]", "_", name)


def _chunks(items: list[_Item], size: int) -> Iterator[list[_Item]]:
    for start in range(0, len(items), size):
        yield items[start : start + size]

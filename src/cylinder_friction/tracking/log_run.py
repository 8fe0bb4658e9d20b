"""One run record becomes one MLflow run, however often it is logged."""

import getpass
import logging
import os
from pathlib import Path

import pandas as pd
from mlflow.entities import LoggedModelInput, Metric, Param, Run
from mlflow.exceptions import MlflowException
from mlflow.utils import chunk_list
from mlflow.utils.mlflow_tags import (
    MLFLOW_GIT_COMMIT,
    MLFLOW_PARENT_RUN_ID,
    MLFLOW_RUN_NOTE,
    MLFLOW_SOURCE_NAME,
    MLFLOW_SOURCE_TYPE,
    MLFLOW_USER,
)

from cylinder_friction.evaluation.reported import ERROR_PERCENT
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.run_record import STAGES, RunRecord, Times
from cylinder_friction.tracking.executions import (
    CANDIDATE_KEY,
    STAGE_TAG,
    allowed,
    dataset_input,
    digest_of,
    execution_of,
    stage_ended,
)
from cylinder_friction.tracking.measurement import times_of, with_times
from cylinder_friction.tracking.repository import Commit, TrackingError, commit_of
from cylinder_friction.tracking.store import Store, open_store

KEY_TAG = "record_key"  # Content key of a top-level run's record: how a run is recognised
TIMES_UNKNOWN = "of logging: the stage ran on another machine"
_PARAMS_A_REQUEST = 100
_LONGEST_PARAM = 6000

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
    timed, samples = with_times(record, root)
    tags = _common_tags(commit_of(root, record.name, record.code))
    own = {STAGE_TAG: record.name, KEY_TAG: record.key()} | ({} if samples else {"times": TIMES_UNKNOWN})
    parent = None
    if record.name in STAGES and not record.experiment:
        parent = execution_of(store, record, root, tags, times_of(timed).started_ms)
    run_id = _write_run(store, timed, root, store.experiment(record.experiment), {**tags, **own}, parent)
    store.log_metrics(run_id, samples)
    for child in timed.children:
        child_id = _write_run(store, child, root, store.experiment(record.experiment), tags, run_id)
        store.client.set_terminated(child_id, "FINISHED", times_of(child).ended_ms)
    if parent is not None:
        stage_ended(store, parent, record, root, times_of(timed).ended_ms)
    store.client.set_terminated(run_id, "FINISHED", times_of(timed).ended_ms)  # last: what is not finished is redone
    return run_id


def _runs_of(store: Store, record: RunRecord) -> list[Run]:
    return list(store.client.search_runs([store.experiment(record.experiment)], f"tags.{KEY_TAG} = '{record.key()}'"))


def _delete_with_children(store: Store, run: Run) -> None:
    below = f"tags.`{MLFLOW_PARENT_RUN_ID}` = '{run.info.run_id}'"
    for child in store.client.search_runs([run.info.experiment_id], below, max_results=10_000):
        _delete_with_children(store, child)
    store.client.delete_run(run.info.run_id)


def _write_run(
    store: Store, record: RunRecord, root: Path, experiment_id: str, tags: dict[str, str], parent: str | None
) -> str:
    times, model_id = times_of(record), _measured_model(store, record)
    tags = {**tags, **record.tags, MLFLOW_SOURCE_NAME: f"cylinder-friction {record.name}"}
    tags |= {MLFLOW_RUN_NOTE: record.note} if record.note else {}
    tags |= {MLFLOW_PARENT_RUN_ID: parent} if parent else {}
    run_id = str(store.client.create_run(experiment_id, times.started_ms, tags, run_name=record.name).info.run_id)
    try:
        if record.datasets or model_id:
            used = [dataset_input(role, each) for role, each in record.datasets.items()]
            store.client.log_inputs(run_id, used, [LoggedModelInput(model_id)] if model_id else None)
        _write_values(store, run_id, record, times, model_id)
        for path in sorted(record.artifacts):
            _write_artifact(store, run_id, root, path)
        for name, table in record.tables.items():
            if table:
                store.client.log_table(run_id, pd.DataFrame(table, dtype=object), f"{name}.json")
    except MlflowException as error:
        raise TrackingError(f"run {record.name!r}: MLflow refused it: {error.message}") from error
    return run_id


def _common_tags(commit: Commit) -> dict[str, str]:
    tags = {
        MLFLOW_SOURCE_TYPE: "PROJECT",
        MLFLOW_GIT_COMMIT: commit.sha,
        "git_dirty": str(commit.dirty).lower(),
        MLFLOW_USER: getpass.getuser(),
    }
    return tags | ({"dvc_exp_name": os.environ["DVC_EXP_NAME"]} if "DVC_EXP_NAME" in os.environ else {})


def _measured_model(store: Store, record: RunRecord) -> str | None:
    """Return the id of the logged model whose errors a record states, as that of ``register`` does."""
    if CANDIDATE_KEY not in record.tags:
        return None
    query = f"tags.`{CANDIDATE_KEY}` = '{record.tags[CANDIDATE_KEY]}'"
    found = store.client.search_logged_models([store.experiment_id], filter_string=query)
    return str(found[0].model_id) if found else None


def _write_values(store: Store, run_id: str, record: RunRecord, times: Times, model_id: str | None) -> None:
    params = [Param(allowed(key), str(value)[:_LONGEST_PARAM]) for key, value in record.params.items()]
    for some in chunk_list(params, _PARAMS_A_REQUEST):
        store.client.log_batch(run_id, params=some)
    measured: tuple[str, ...] = ()  # What errors are of: the model, and the name and digest of the recordings
    if model_id is not None and len(record.datasets) == 1:
        ((role, dataset),) = record.datasets.items()
        measured = model_id, role, digest_of(dataset)
    metrics = [
        Metric(allowed(name), value, times.ended_ms, 0, *(measured if name.startswith(ERROR_PERCENT) else ()))
        for name, value in record.metrics.items()
    ]
    for name, values in record.curves.items():
        known_ms = times.steps_ms.get(name, [])[-len(values) :]
        # The first steps of what was resumed were done by a process that was killed.
        steps_ms = [times.started_ms if known_ms else times.ended_ms] * (len(values) - len(known_ms)) + known_ms
        metrics += [
            Metric(allowed(name), value, step_ms, step)
            for step, (value, step_ms) in enumerate(zip(values, steps_ms, strict=True))
        ]
    store.log_metrics(run_id, metrics)


def _write_artifact(store: Store, run_id: str, root: Path, path: str) -> None:
    source = root / path
    if source.is_dir():
        store.client.log_artifacts(run_id, str(source), path)
    else:
        store.client.log_artifact(run_id, str(source), path.rpartition("/")[0] or None)


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

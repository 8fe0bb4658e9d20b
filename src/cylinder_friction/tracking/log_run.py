"""One run record becomes one MLflow run, however often it is logged; a comparison also becomes a pipeline's run."""

import getpass
import json
import logging
import os
import re
import socket
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from mlflow.entities import Dataset as MlflowDataset
from mlflow.entities import DatasetInput, InputTag, Metric, Param, RunTag
from mlflow.exceptions import MlflowException
from mlflow.types import ColSpec, DataType, Schema, TensorSpec
from mlflow.utils import chunk_list
from mlflow.utils.mlflow_tags import (
    MLFLOW_DATASET_CONTEXT,
    MLFLOW_GIT_COMMIT,
    MLFLOW_PARENT_RUN_ID,
    MLFLOW_RUN_NOTE,
    MLFLOW_SOURCE_NAME,
    MLFLOW_SOURCE_TYPE,
    MLFLOW_USER,
)

from cylinder_friction.execution.measuring import Took, now_ms
from cylinder_friction.files.whole_files import json_hash
from cylinder_friction.run_record import STAGES, Dataset, RunRecord, records_in
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store, open_store

STAGE_TAG = "stage"
"""Tag of a top-level run: which stage it is, or ``pipeline``."""
KEY_TAG = "record_key"
"""Tag of a run and those below it: the key of its record, by which it is recognised."""
PIPELINE = "pipeline"
_REGISTERED = "register_key"  # Tag of a pipeline's run: the key of the record of ``register`` that belongs to it
_TYPES: dict[str, str] = {"float": "float", "int64": "long", "int32": "integer", "bool": "boolean", "double": "double"}
_WRITER = "writer"  # Tag: the machine and repository that logged a run
_LONGEST_PARAM, _LONGEST_NAME, _PARAMS_A_REQUEST = 6000, 80, 100

_log = logging.getLogger(__name__)


def log_run(record: RunRecord, root: Path) -> str:
    """Log a record as an MLflow run with its children below it, and return the run's id.

    A run that is already there whole is returned as it is; one that a kill left half-written is deleted and
    logged anew. Two records with equal keys are one run.

    Raises:
        TrackingError: The store cannot be reached, or an artifact is missing.
    """
    with open_store(root) as store:
        return log_in(store, record, root)


def track_or_warn(record: RunRecord, root: Path) -> str | None:
    """Log a record like ``log_run``; if that fails, warn and name the command that catches up."""
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


def log_in(store: Store, record: RunRecord, root: Path) -> str:
    """Do what ``log_run`` does, in a store that is already open."""
    run_id = find_run(store, record)
    if run_id is None:
        if missing := [path for path in record.artifacts if not (root / path).exists()]:
            raise TrackingError(
                f"run {record.name!r}: {missing[0]} is not there; run `dvc pull` or `dvc repro` to have it"
            )
        experiment = store.experiment(record.experiment)
        tags = _tags(store, record, record.key())
        _delete(store, experiment, tags)
        try:
            run_id = _write(store, experiment, record, root, {**tags, STAGE_TAG: record.name})
            for child in record.children:
                child_id = _write(store, experiment, child, root, {**tags, MLFLOW_PARENT_RUN_ID: run_id})
                store.client.set_terminated(child_id, "FINISHED", _took(child).ended_ms)
        except MlflowException as error:
            raise TrackingError(f"run {record.name!r}: MLflow refused it: {error.message}") from error
        store.client.set_terminated(run_id, "FINISHED", _took(record).ended_ms)  # last: what is not finished is redone
        _delete(store, experiment, tags, "RUNNING")
    if record.name in ("compare", "register"):
        log_pipeline(store, record, root)
    return run_id


def find_run(store: Store, record: RunRecord) -> str | None:
    """Return the id of the finished run of this very record, if there is one."""
    query = f"tags.{KEY_TAG} = '{record.key()}' and tags.{STAGE_TAG} = '{record.name}'"
    query += " and attributes.status = 'FINISHED'"
    found = store.client.search_runs([store.experiment(record.experiment)], query, max_results=1)
    return str(found[0].info.run_id) if found else None


def log_pipeline(store: Store, last: RunRecord, root: Path) -> str:
    """Log the run of a pipeline, whose comparison or registration ``last`` is, and return its id.

    It states how the pipeline was configured and the errors of its model, and takes the runs of the stages below it.
    It is recognised by the records of the stages up to ``compare``. A second registration of the same comparison, with
    another tolerance for example, is another run.
    """
    records = {**records_in(root), last.name: last}
    stages = {stage: records[stage] for stage in STAGES if stage in records and stage != "register"}
    key = json_hash([record.key() for record in stages.values()])
    tags = _tags(store, last, key) | {STAGE_TAG: PIPELINE, MLFLOW_SOURCE_NAME: "dvc repro"}
    if last.name == "register":
        stages["register"], tags[_REGISTERED] = last, last.key()
    experiment, run_id = store.experiment(last.experiment), _pipeline_run(store, tags, last)
    if run_id is None:
        stated = [str(last.pipeline.get(name, "none")) for name in ("recipe", "changes")]
        name = ", ".join(each for each in stated if each != "none") or PIPELINE
        started_ms = min(_took(each).started_ms for each in stages.values())
        run_id = str(store.client.create_run(experiment, started_ms, tags, run_name=name[:_LONGEST_NAME]).info.run_id)
    run, below = store.client.get_run(run_id), _take_stages(store, run_id, stages)
    shown = [stages[name] for name in ("train", "compare", "register") if name in stages]
    used = {role: each for record in shown for role, each in record.datasets.items()}
    params = {**last.pipeline, **_sizes(stages, used)}
    new = [Param(allowed(name), str(value)) for name, value in params.items() if allowed(name) not in run.data.params]
    shown, ended_ms = [each for each in shown if each.name != "train"], _took(last).ended_ms
    metrics = [Metric(allowed(name), value, ended_ms, 0) for each in shown for name, value in each.metrics.items()]
    earlier = [stage for stage in stages if stage not in below]
    notes = [*(each.note for each in shown), f"Ran: {', '.join(below)}." if below else ""]
    notes += [f"Up to date, from an earlier run: {', '.join(earlier)}."] if earlier else []
    tags[MLFLOW_RUN_NOTE] = "\n\n".join(filter(None, notes))
    store.client.log_inputs(run_id, [dataset_input(role, each) for role, each in used.items()])
    store.client.log_batch(run_id, metrics, new, [RunTag(name, value) for name, value in tags.items()])
    store.client.set_terminated(run_id, "FINISHED", max(ended_ms, run.info.end_time or 0))
    _delete(store, experiment, tags, "RUNNING")
    return run_id


def _pipeline_run(store: Store, tags: Mapping[str, str], last: RunRecord) -> str | None:
    """Return the id of the pipeline's run that is there already: for a registration, one without another."""
    query = f"tags.{KEY_TAG} = '{tags[KEY_TAG]}' and tags.{STAGE_TAG} = '{PIPELINE}'"
    known = store.client.search_runs([store.experiment(last.experiment)], query)
    own = tags.get(_REGISTERED)
    fitting = [run for run in known if own in (None, run.data.tags.get(_REGISTERED, own))]
    fitting.sort(key=lambda run: _REGISTERED not in run.data.tags)
    return str(fitting[0].info.run_id) if fitting else None


def _take_stages(store: Store, run_id: str, stages: Mapping[str, RunRecord]) -> list[str]:
    """Put the stages' runs below a pipeline's run, unless they lie below another one; return those that do."""
    below = []
    for stage, record in stages.items():
        found = find_run(store, record)
        parent = None if found is None else store.client.get_run(found).data.tags.get(MLFLOW_PARENT_RUN_ID)
        if parent is not None and store.client.get_run(parent).info.lifecycle_stage == "deleted":
            parent = None
        if found is not None and parent is None:
            store.client.set_tag(found, MLFLOW_PARENT_RUN_ID, run_id)
        below += [stage] if found is not None and parent in (None, run_id) else []
    return below


def _sizes(stages: Mapping[str, RunRecord], used: Mapping[str, Dataset]) -> dict[str, int]:
    """Return the sessions and rows of each role."""
    counted = stages["split"].metrics.items() if "split" in stages else ()
    sessions = {name.replace("/", "."): int(value) for name, value in counted if name.startswith("sessions/")}
    return {**sessions, **{f"rows.{role}": each.rows for role, each in used.items()}}


def allowed(name: str) -> str:
    """Return a name that MLflow takes: letters, digits, ``_ - . / :`` and spaces."""
    return re.sub(r"[^\w\-./: ]", "_", name)


def dataset_input(role: str, dataset: Dataset) -> DatasetInput:
    """Return a dataset as the input of a run. Its source is a path that MLflow resolves within the repository."""
    columns: list[ColSpec | TensorSpec] = [
        ColSpec(DataType[_TYPES.get(kind, "string")], name) for name, kind in dataset.columns.items()
    ]
    schema = json.dumps({"mlflow_colspec": Schema(columns).to_dict()}) if columns else None
    source, profile = json.dumps({"uri": dataset.path}), json.dumps({"num_rows": dataset.rows})
    found = MlflowDataset(role, dataset.md5, "local", source, schema, profile)
    return DatasetInput(found, [InputTag(MLFLOW_DATASET_CONTEXT, role)])


def _tags(store: Store, record: RunRecord, key: str) -> dict[str, str]:
    """Return the tags of every run of a record: by what it is found, by whom and at which commit it was made."""
    commit = record.commit or commit_of(store.root)
    writer = json_hash([socket.gethostname(), str(store.root)])[:12]
    tags = {MLFLOW_SOURCE_TYPE: "PROJECT", MLFLOW_USER: getpass.getuser(), MLFLOW_GIT_COMMIT: commit["git_commit"]}
    tags |= {name: value for name, value in commit.items() if name != "git_commit"}
    tags |= {"dvc_exp_name": os.environ["DVC_EXP_NAME"]} if "DVC_EXP_NAME" in os.environ else {}
    return {**tags, KEY_TAG: key, _WRITER: writer}


def _delete(store: Store, experiment: str, tags: Mapping[str, str], status: str = "") -> None:
    """Delete what this repository left of a record's runs: a kill half of them, a gateway that lost answers twins."""
    query = f"tags.{KEY_TAG} = '{tags[KEY_TAG]}' and tags.{_WRITER} = '{tags[_WRITER]}'"
    query += f" and attributes.status = '{status}'" if status else ""
    for run in store.client.search_runs([experiment], query, max_results=10_000):
        store.client.delete_run(run.info.run_id)


def _write(store: Store, experiment: str, record: RunRecord, root: Path, tags: Mapping[str, str]) -> str:
    took = _took(record)
    tags = {**tags, **record.tags, MLFLOW_SOURCE_NAME: f"cylinder-friction {record.name}"}
    tags |= {MLFLOW_RUN_NOTE: record.note} if record.note else {}
    run_id = str(store.client.create_run(experiment, took.started_ms, tags, run_name=record.name).info.run_id)
    if record.datasets:
        store.client.log_inputs(run_id, [dataset_input(role, each) for role, each in record.datasets.items()])
    params = [Param(allowed(key), str(value)[:_LONGEST_PARAM]) for key, value in record.params.items()]
    for some in chunk_list(params, _PARAMS_A_REQUEST):
        store.client.log_batch(run_id, params=some)
    curves = {name: [(took.ended_ms, value) for value in values] for name, values in record.curves.items()}
    curves |= {name: [(took.ended_ms, value)] for name, value in record.metrics.items()}
    for sample in took.samples:
        for name, value in sample.items():
            if name != "time_ms":
                curves.setdefault(f"system/{name}", []).append((int(sample["time_ms"]), value))
    if took.peak_memory_mb:
        curves["system/peak_memory_mb"] = [(took.ended_ms, took.peak_memory_mb)]
    store.log_metrics(
        run_id,
        [
            Metric(allowed(name), value, time_ms, step)
            for name, steps in curves.items()
            for step, (time_ms, value) in enumerate(steps)
        ],
    )
    for path in sorted(record.artifacts):
        if (root / path).is_dir():
            store.client.log_artifacts(run_id, str(root / path), path)
        else:
            store.client.log_artifact(run_id, str(root / path), path.rpartition("/")[0] or None)
    for name, table in record.tables.items():
        if table:
            store.client.log_table(run_id, pd.DataFrame(table, dtype=object), f"{name}.json")
    return run_id


def _took(record: RunRecord) -> Took:
    return record.took or Took(now_ms(), now_ms())

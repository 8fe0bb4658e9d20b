"""Log a run record as one MLflow run, however often it is logged; a comparison also logs the pipeline's run."""

import getpass
import json
import logging
import os
import re
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from mlflow import MlflowClient, MlflowException
from mlflow.entities import Dataset as MlflowDataset
from mlflow.entities import DatasetInput, InputTag, Metric, Param, RunTag
from mlflow.types import ColSpec, DataType
from mlflow.utils import mlflow_tags as tag

from cylinder_friction.execution.measuring import Took
from cylinder_friction.files.whole_files import json_hash
from cylinder_friction.run_record import Dataset, RunRecord, records_in
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store, open_store

STAGE_TAG = "stage"  # Tag of a run: the name of its stage or trial, or ``pipeline``
KEY_TAG = "record_key"  # Tag of a run and its children: the key of the record, which identifies the run
PIPELINE = "pipeline"
VIEW = "errors"  # Name of the shared view of an experiment's runs, with the columns that a decision needs
_TYPES: dict[str, str] = {"float": "float", "int64": "long", "int32": "integer", "bool": "boolean", "double": "double"}
_WRITER = "writer"  # Tag: the machine and repository that logged a run
_LONGEST_PARAM, _LONGEST_NAME = 6000, 80

_log = logging.getLogger(__name__)


def track_or_warn(record: RunRecord, root: Path) -> str | None:
    """Log a record like ``log_run``; if that fails, warn and name the command that logs it later."""
    try:
        return log_run(record, root)
    except Exception as error:  # whatever the store does must not cost a finished stage its result
        way = "Run `cylinder-friction track` to log it from the files when the tracking store can be reached."
        _log.warning("%s: its results are written, but its MLflow run is not: %s. %s", record.name, error, way)
        return None


def log_run(record: RunRecord, root: Path) -> str:
    """Log a record as an MLflow run with its children below it; return the run's id.

    If the run already exists, nothing is logged. A run that a kill left incomplete is deleted and logged again.

    Raises:
        TrackingError: The store cannot be reached, or an artifact is missing.
    """
    with open_store(root) as store:
        return log_in(store, record, root)


def log_in(store: Store, record: RunRecord, root: Path) -> str:
    """Log a record like ``log_run``, in a store that is already open."""
    run_id = find_run(store, record) or _log_whole(store, record, root, record.key())
    if record.name in ("compare", "register"):
        log_pipeline(store, record, root)
    return run_id


def find_run(store: Store, record: RunRecord, key: str = "") -> str | None:
    """Find the id of the finished run of this record, or of another ``key``; None if there is none."""
    stage = record.tags.get(STAGE_TAG, record.name)
    query = f"tags.{KEY_TAG} = '{key or record.key()}' and tags.{STAGE_TAG} = '{stage}' and status = 'FINISHED'"
    found = store.client.search_runs([store.experiment(record.experiment)], query, max_results=1)
    return str(found[0].info.run_id) if found else None


def log_pipeline(store: Store, last: RunRecord, root: Path) -> str:
    """Log the run of a pipeline that ends with ``last``, a comparison or a registration; return the run's id.

    The run states the configuration of the pipeline and the errors of its model. The runs of the stages become its
    children, also those that were children of an earlier pipeline. The records of the stages up to ``compare`` and
    ``last.pipeline`` identify the run, so another tolerance of the gate makes another run.
    """
    records = {**records_in(root), last.name: last}
    stages = {name: each for name, each in records.items() if name != "register" or last.name == name}
    key = json_hash([[each.key() for name, each in stages.items() if name != "register"], last.pipeline])
    shown = [stages[name] for name in ("train", "compare", "register") if name in stages]
    used = {role: each for record in shown for role, each in record.datasets.items()}
    counted = stages["split"].metrics if "split" in stages else {}
    pipeline = RunRecord(
        _pipeline_name(last),
        params={
            **last.pipeline,
            **{f"rows.{role}": each.rows for role, each in used.items()},
            **{name.replace("/", "."): int(value) for name, value in counted.items() if name.startswith("sessions/")},
        },
        metrics={name: value for each in shown if each.name != "train" for name, value in each.metrics.items()},
        note="\n\n".join(each.note for each in shown if each.note),
        tags={tag.MLFLOW_SOURCE_NAME: "dvc repro", STAGE_TAG: PIPELINE},
        datasets=used,
        experiment=last.experiment,
        took=Took(min(each.took.started_ms for each in stages.values()), last.took.ended_ms),
        commit=last.commit,
    )
    run_id = _log_whole(store, pipeline, root, key, find_run(store, pipeline, key) or "")
    for stage in filter(None, (find_run(store, each) for each in stages.values())):
        store.client.set_tag(stage, tag.MLFLOW_PARENT_RUN_ID, run_id)
    view, experiment = json.dumps(_view(pipeline.metrics)), store.experiment(last.experiment)
    store.client.set_experiment_tag(experiment, f"mlflow.sharedViewState.{VIEW}", view)
    return run_id


def _pipeline_name(last: RunRecord) -> str:
    """Name a pipeline's run after its recipe, its changes to the recipe, and the commit."""
    stated = [str(last.pipeline.get(name, "none")) for name in ("recipe", "changes")]
    name = (", ".join(each for each in stated if each != "none") or PIPELINE)[:_LONGEST_NAME]
    commit = last.commit.get("git_commit", "unknown")
    modified = "" if last.commit.get("git_dirty") == "false" else ", modified"
    return name if commit == "unknown" else f"{name} ({commit[:7]}{modified})"


def _view(metrics: Mapping[str, float]) -> dict[str, Any]:
    """Build a view of the runs for the MLflow UI: one row per pipeline, the smallest mean error first."""
    means = [f"metrics.`{name}`" for name in metrics if name.endswith("_error_percent/mean")]
    columns = [*means, "params.`changes`", "params.`seed`", "attributes.`Models`"]
    query = f"tags.{STAGE_TAG} = '{PIPELINE}'"
    return {"searchFilter": query, "orderByKey": columns[0], "orderByAsc": True, "selectedColumns": columns}


def allowed(name: str) -> str:
    """Replace characters that MLflow does not accept in a name by ``_``."""
    return re.sub(r"[^\w\-./: ]", "_", name)


def dataset_input(role: str, dataset: Dataset) -> DatasetInput:
    """Convert a dataset to the input of a run. Its source is a path that MLflow resolves within the repository."""
    columns = [ColSpec(DataType[_TYPES.get(kind, "string")], name).to_dict() for name, kind in dataset.columns.items()]
    schema = json.dumps({"mlflow_colspec": columns}) if columns else None
    source, profile = json.dumps({"uri": dataset.path}), json.dumps({"num_rows": dataset.rows})
    found = MlflowDataset(role, dataset.md5, "local", source, schema, profile)
    return DatasetInput(found, [InputTag(tag.MLFLOW_DATASET_CONTEXT, role)])


def log_datasets(client: MlflowClient, run_id: str, datasets: Mapping[str, Dataset]) -> None:
    """Link a run to datasets, also when another machine logs the same new datasets at the same moment.

    MLflow looks whether a dataset is known and then inserts it, so that the later of two machines is refused. When it
    asks again, the dataset is known.
    """
    inputs = [dataset_input(role, each) for role, each in datasets.items()]
    try:
        client.log_inputs(run_id, inputs)
    except MlflowException:
        client.log_inputs(run_id, inputs)


def _log_whole(store: Store, record: RunRecord, root: Path, key: str, known: str = "") -> str:
    """Write a new run or the ``known`` one; delete what a kill or a lost reply left of it in this repository."""
    if missing := [path for path in record.artifacts if not (root / path).exists()]:
        raise TrackingError(f"run {record.name!r}: {missing[0]} is not there; run `dvc pull` or `dvc repro` to have it")
    experiment, commit = store.experiment(record.experiment), record.commit or commit_of(store.root)
    writer = json_hash([socket.gethostname(), str(store.root)])[:12]
    tags = {tag.MLFLOW_SOURCE_TYPE: "PROJECT", tag.MLFLOW_USER: getpass.getuser(), KEY_TAG: key, _WRITER: writer}
    tags |= {tag.MLFLOW_GIT_COMMIT if name == "git_commit" else name: value for name, value in commit.items()}
    tags |= {"dvc_exp_name": os.environ["DVC_EXP_NAME"]} if "DVC_EXP_NAME" in os.environ else {}
    run_id = _write(store, experiment, record, root, tags, known)
    query = f"tags.{KEY_TAG} = '{key}' and tags.{_WRITER} = '{writer}'"
    for run in store.client.search_runs([experiment], query, max_results=10_000):
        own = run_id in (run.info.run_id, run.data.tags.get(tag.MLFLOW_PARENT_RUN_ID))
        if not own or run.info.status == "RUNNING":
            store.client.delete_run(run.info.run_id)
    return run_id


def _write(store: Store, experiment: str, record: RunRecord, root: Path, tags: dict[str, str], known: str = "") -> str:
    """Write a new run or the ``known`` one, with its children; return its id."""
    client, took = store.client, record.took
    own = {tag.MLFLOW_SOURCE_NAME: f"cylinder-friction {record.name}", STAGE_TAG: record.name, **tags, **record.tags}
    own |= {tag.MLFLOW_RUN_NOTE: record.note} if record.note else {}
    run_id = known or str(client.create_run(experiment, took.started_ms, own, run_name=record.name).info.run_id)
    log_datasets(client, run_id, record.datasets)
    points = {name: [(value, took.ended_ms) for value in values] for name, values in record.curves.items()}
    points |= {name: [(value, took.ended_ms)] for name, value in record.metrics.items()}
    for name in ("memory_mb", "processor_s") if took.samples else ():
        points[f"system/{name}"] = [(sample[name], int(sample["time_ms"])) for sample in took.samples]
    if took.peak_memory_mb:
        points["system/peak_memory_mb"] = [(took.peak_memory_mb, took.ended_ms)]
    client.log_batch(
        run_id,
        [Metric(allowed(name), *point, step) for name, each in points.items() for step, point in enumerate(each)],
        [Param(allowed(name), str(value)[:_LONGEST_PARAM]) for name, value in record.params.items()],
        [RunTag(*each) for each in own.items()],
    )
    for path in sorted(record.artifacts):
        if (root / path).is_dir():
            client.log_artifacts(run_id, str(root / path), path)
        else:
            client.log_artifact(run_id, str(root / path), path.rpartition("/")[0] or None)
    for name, table in record.tables.items():
        if table:
            client.log_table(run_id, pd.DataFrame(table, dtype=object), f"{name}.json")
    for child in record.children:
        _write(store, experiment, child, root, {**tags, tag.MLFLOW_PARENT_RUN_ID: run_id})
    client.set_terminated(run_id, "FINISHED", took.ended_ms)  # last, as an unfinished run is logged again
    return run_id

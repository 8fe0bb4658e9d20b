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
from mlflow.entities import Dataset as MlflowDataset
from mlflow.entities import DatasetInput, InputTag, Metric, Param, RunTag
from mlflow.types import ColSpec, DataType, Schema, TensorSpec
from mlflow.utils import mlflow_tags as tag

from cylinder_friction.execution.measuring import Took, now_ms
from cylinder_friction.files.whole_files import json_hash
from cylinder_friction.run_record import Dataset, RunRecord, records_in
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store, open_store

STAGE_TAG = "stage"
"""Tag of a run: the name of its stage or trial, or ``pipeline``."""
KEY_TAG = "record_key"
"""Tag of a run and its children: the key of the record, which identifies the run."""
PIPELINE = "pipeline"
VIEW = "errors"
"""Name of the shared view of an experiment's runs, with the columns that a decision needs."""
_TYPES: dict[str, str] = {"float": "float", "int64": "long", "int32": "integer", "bool": "boolean", "double": "double"}
_WRITER = "writer"  # Tag: the machine and repository that logged a run
_LONGEST_PARAM, _LONGEST_NAME = 6000, 80

_log = logging.getLogger(__name__)


def log_run(record: RunRecord, root: Path) -> str:
    """Log a record as an MLflow run with its children below it; return the run's id.

    If the run already exists, nothing is logged. A run that a kill left incomplete is deleted and logged again.

    Raises:
        TrackingError: The store cannot be reached, or an artifact is missing.
    """
    with open_store(root) as store:
        return log_in(store, record, root)


def track_or_warn(record: RunRecord, root: Path) -> str | None:
    """Log a record like ``log_run``; if that fails, warn and name the command that logs it later."""
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
    """Log a record like ``log_run``, in a store that is already open."""
    run_id = find_run(store, record)
    if run_id is None:
        if missing := [path for path in record.artifacts if not (root / path).exists()]:
            raise TrackingError(
                f"run {record.name!r}: {missing[0]} is not there; run `dvc pull` or `dvc repro` to have it"
            )
        experiment, tags = store.experiment(record.experiment), _tags(store, record, record.key())
        _delete(store, experiment, tags)
        run_id = _write(store, experiment, record, root, tags)
        _delete(store, experiment, tags, "RUNNING")
    if record.name in ("compare", "register"):
        log_pipeline(store, record, root)
    return run_id


def find_run(store: Store, record: RunRecord) -> str | None:
    """Find the id of the finished run of this record; None if there is none."""
    return _find(store, store.experiment(record.experiment), record.key(), record.name)


def _find(store: Store, experiment: str, key: str, stage: str) -> str | None:
    query = f"tags.{KEY_TAG} = '{key}' and tags.{STAGE_TAG} = '{stage}' and attributes.status = 'FINISHED'"
    found = store.client.search_runs([experiment], query, max_results=1)
    return str(found[0].info.run_id) if found else None


def log_pipeline(store: Store, last: RunRecord, root: Path) -> str:
    """Log the run of a pipeline that ends with ``last``, a comparison or a registration; return the run's id.

    The run states the configuration of the pipeline and the errors of its model. The runs of the stages become its
    children. The records of the stages up to ``compare`` and ``last.pipeline`` identify the run, so another tolerance
    of the gate makes another run.
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
        tags={tag.MLFLOW_SOURCE_NAME: "dvc repro", STAGE_TAG: PIPELINE},
        datasets=used,
        took=Took(min(_took(each).started_ms for each in stages.values()), _took(last).ended_ms),
    )
    experiment, tags = store.experiment(last.experiment), _tags(store, last, key)
    run_id = _write(store, experiment, pipeline, root, tags, _find(store, experiment, key, PIPELINE))
    below = _take_stages(store, run_id, stages)
    earlier = ", ".join(stage for stage in stages if stage not in below)
    notes = [*(each.note for each in shown), f"Ran: {', '.join(below)}." if below else ""]
    notes += [f"Up to date, from an earlier run: {earlier}."] if earlier else []
    store.client.set_tag(run_id, tag.MLFLOW_RUN_NOTE, "\n\n".join(filter(None, notes)))
    store.client.set_experiment_tag(experiment, f"mlflow.sharedViewState.{VIEW}", json.dumps(_view(pipeline.metrics)))
    _delete(store, experiment, tags, "RUNNING")
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


def _take_stages(store: Store, run_id: str, stages: Mapping[str, RunRecord]) -> list[str]:
    """Make the stages' runs children of a pipeline's run unless they have another parent; return its children."""
    below = []
    for stage, record in stages.items():
        if found := find_run(store, record):
            parent = store.client.get_run(found).data.tags.get(tag.MLFLOW_PARENT_RUN_ID)
            if parent is None or store.client.get_run(parent).info.lifecycle_stage == "deleted":
                store.client.set_tag(found, tag.MLFLOW_PARENT_RUN_ID, parent := run_id)
            below += [stage] if parent == run_id else []
    return below


def allowed(name: str) -> str:
    """Replace characters that MLflow does not accept in a name by ``_``."""
    return re.sub(r"[^\w\-./: ]", "_", name)


def dataset_input(role: str, dataset: Dataset) -> DatasetInput:
    """Convert a dataset to the input of a run. Its source is a path that MLflow resolves within the repository."""
    columns: list[ColSpec | TensorSpec] = [
        ColSpec(DataType[_TYPES.get(kind, "string")], name) for name, kind in dataset.columns.items()
    ]
    schema = json.dumps({"mlflow_colspec": Schema(columns).to_dict()}) if columns else None
    source, profile = json.dumps({"uri": dataset.path}), json.dumps({"num_rows": dataset.rows})
    found = MlflowDataset(role, dataset.md5, "local", source, schema, profile)
    return DatasetInput(found, [InputTag(tag.MLFLOW_DATASET_CONTEXT, role)])


def _tags(store: Store, record: RunRecord, key: str) -> dict[str, str]:
    """Collect the tags of every run of a record: its key, who logged it, and the commit of its stage."""
    commit = record.commit or commit_of(store.root)
    writer = json_hash([socket.gethostname(), str(store.root)])[:12]
    tags = {tag.MLFLOW_SOURCE_TYPE: "PROJECT", tag.MLFLOW_USER: getpass.getuser(), KEY_TAG: key, _WRITER: writer}
    tags |= {tag.MLFLOW_GIT_COMMIT if name == "git_commit" else name: value for name, value in commit.items()}
    return tags | ({"dvc_exp_name": os.environ["DVC_EXP_NAME"]} if "DVC_EXP_NAME" in os.environ else {})


def _delete(store: Store, experiment: str, tags: Mapping[str, str], status: str = "") -> None:
    """Delete this repository's leftovers of a record: incomplete runs after a kill, duplicates after a lost reply."""
    query = f"tags.{KEY_TAG} = '{tags[KEY_TAG]}' and tags.{_WRITER} = '{tags[_WRITER]}'"
    query += f" and attributes.status = '{status}'" if status else ""
    for run in store.client.search_runs([experiment], query, max_results=10_000):
        store.client.delete_run(run.info.run_id)


def _write(
    store: Store, experiment: str, record: RunRecord, root: Path, tags: Mapping[str, str], known: str | None = None
) -> str:
    """Write a new run or the ``known`` one, with its children; return its id."""
    client, took = store.client, _took(record)
    own = {tag.MLFLOW_SOURCE_NAME: f"cylinder-friction {record.name}", STAGE_TAG: record.name, **tags, **record.tags}
    own |= {tag.MLFLOW_RUN_NOTE: record.note} if record.note else {}
    run_id = known or str(client.create_run(experiment, took.started_ms, own, run_name=record.name).info.run_id)
    client.log_inputs(run_id, [dataset_input(role, each) for role, each in record.datasets.items()])
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


def _took(record: RunRecord) -> Took:
    return record.took or Took(now_ms(), now_ms())

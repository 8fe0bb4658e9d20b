"""One execution of the pipeline: a run of its own in MLflow, with the runs of the stages that ran in it below.

Which execution a stage's run belongs to follows from the records alone, so that it is the same whether the run is
logged as the stage ends or later from files. An execution knows the key of the record of every stage that it ran or
found up to date. A stage belongs to the one that knows its very record; else to the newest one that has not come to
this stage yet and whose records all are those that lie in ``reports/runs``; else it begins a new one.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from mlflow.entities import Dataset as MlflowDataset
from mlflow.entities import DatasetInput, InputTag, Metric, Param, Run, RunTag
from mlflow.types import ColSpec, DataType, Schema, TensorSpec
from mlflow.utils.mlflow_tags import MLFLOW_DATASET_CONTEXT, MLFLOW_RUN_NOTE, MLFLOW_SOURCE_NAME

from cylinder_friction.run_record import STAGES, Dataset, RunRecord, comes_after, records_in
from cylinder_friction.tracking.store import Store

STAGE_TAG = "stage"
"""Tag of a top-level run and of a stage's: which stage it is, or ``pipeline``."""
CANDIDATE_KEY = "candidate_key"
"""Tag of a version, of its logged model and of the run of ``register`` by which a candidate is recognised."""
EXECUTION = "pipeline"
_KEYS = "stage_keys"
_RAN = "stages_run"
_SHOWN_DATA = ("train", "compare")
_LONGEST_DIGEST = 36
_TYPES = {
    "double": DataType.double,
    "float": DataType.float,
    "int64": DataType.long,
    "int32": DataType.integer,
    "bool": DataType.boolean,
}


def execution_of(store: Store, record: RunRecord, root: Path, tags: dict[str, str], started_ms: int) -> str:
    """Return the id of the execution that a stage's run belongs to; makes it where it is not there.

    One that is made has ``tags``, its commit, user and so on, and began at ``started_ms`` [ms since 1970].
    """
    keys = {stage: each.key() for stage, each in records_in(root).items()} | {record.name: record.key()}
    before = {stage: key for stage, key in keys.items() if comes_after(record.name, stage)}
    executions = _executions(store)
    found = _find(executions, record.name, keys)
    if found is None:
        name = f"{EXECUTION} {_next_number(executions)}"
        tags = {**tags, MLFLOW_SOURCE_NAME: "dvc repro", STAGE_TAG: EXECUTION, _KEYS: "{}", _RAN: ""}
        found = store.client.create_run(store.experiment_id, started_ms, tags, run_name=name)
    run_id = str(found.info.run_id)
    known = {**before, record.name: record.key(), **_keys(found)}
    store.client.set_tag(run_id, _KEYS, json.dumps(known))
    return run_id


def stage_ended(store: Store, run_id: str, record: RunRecord, root: Path, ended_ms: int) -> None:
    """Show in the run of an execution what one of its stages came to: what was trained, and the errors of that."""
    run = store.client.get_run(run_id)
    ran = sorted({*filter(None, run.data.tags[_RAN].split(", ")), record.name}, key=STAGES.index)
    known = {**records_in(root), record.name: record}
    known = {stage: known[stage] for stage, key in _keys(run).items() if stage in known and known[stage].key() == key}
    params = [Param(name, str(value)) for name, value in (known["train"].params if "train" in known else {}).items()]
    metrics = [
        Metric(allowed(name), value, ended_ms, 0)
        for stage in ("compare", "register")
        if stage in known
        for name, value in known[stage].metrics.items()
        if allowed(name) not in run.data.metrics
    ]
    used = {role: each for stage in _SHOWN_DATA if stage in known for role, each in known[stage].datasets.items()}
    store.client.log_inputs(run_id, [dataset_input(role, each) for role, each in used.items()])
    others = [stage for stage in STAGES if stage in known and stage not in ran]
    notes = [known[stage].note for stage in ("compare", "register") if stage in known]
    notes += [
        f"Ran: {', '.join(ran)}.",
        f"Up to date, from an earlier execution: {', '.join(others)}." if others else "",
    ]
    tags = [RunTag(MLFLOW_RUN_NOTE, "\n\n".join(filter(None, notes))), RunTag(_RAN, ", ".join(ran))]
    store.client.log_batch(run_id, metrics, params, tags)
    store.client.set_terminated(run_id, "FINISHED", max(ended_ms, run.info.end_time or 0))


def allowed(name: str) -> str:
    """Return a name that MLflow takes: letters, digits, ``_ - . / :`` and spaces."""
    return re.sub(r"[^\w\-./: ]", "_", name)


def dataset_input(role: str, dataset: Dataset) -> DatasetInput:
    """Return a dataset as the input of a run; in MLflow what a run wrote is an input too, so its context states it.

    Its source is a path within the repository, which MLflow resolves wherever it is.
    """
    columns: list[ColSpec | TensorSpec] = [
        ColSpec(_TYPES.get(kind, DataType.string), name) for name, kind in dataset.columns.items()
    ]
    return DatasetInput(
        MlflowDataset(
            name=role,
            digest=digest_of(dataset),
            source_type="local",
            source=json.dumps({"uri": dataset.path}),
            schema=json.dumps({"mlflow_colspec": Schema(columns).to_dict()}) if columns else None,
            profile=json.dumps({"num_rows": dataset.rows, "num_elements": dataset.rows * len(dataset.columns)}),
        ),
        [InputTag(MLFLOW_DATASET_CONTEXT, "written" if dataset.written else role)],
    )


def digest_of(dataset: Dataset) -> str:
    """Return the digest by which MLflow knows a dataset: as much of its SHA-256 as MLflow takes."""
    return dataset.sha256[:_LONGEST_DIGEST]


def _executions(store: Store) -> list[Run]:
    """Return the runs of all executions, the newest first."""
    return list(store.client.search_runs([store.experiment_id], f"tags.{STAGE_TAG} = '{EXECUTION}'"))


def _find(executions: Sequence[Run], stage: str, keys: Mapping[str, str]) -> Run | None:
    """Return the execution that a stage with a record of this key belongs to."""
    knowing = [run for run in executions if _keys(run).get(stage) == keys[stage]]
    waiting = [run for run in executions if stage not in _keys(run) and _keys(run).items() <= keys.items()]
    return next(iter([*knowing, *waiting]), None)


def _keys(run: Run) -> dict[str, str]:
    keys: dict[str, str] = json.loads(run.data.tags[_KEYS])
    return keys


def _next_number(executions: Sequence[Run]) -> int:
    numbers = [(run.info.run_name or "").removeprefix(f"{EXECUTION} ") for run in executions]
    return 1 + max((int(number) for number in numbers if number.isdigit()), default=0)

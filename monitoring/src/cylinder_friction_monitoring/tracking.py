"""Log a fleet's health to MLflow: one run per cylinder, one step per session, the baselines as an artifact."""

from collections.abc import Iterable
from pathlib import Path

import pyarrow.parquet as pq
from mlflow.entities import Metric, Run
from mlflow.utils.mlflow_tags import MLFLOW_RUN_NOTE

from cylinder_friction.files.whole_files import read_json
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction_monitoring.trends.moments import moment

CYLINDER_TAG, STATE_TAG = "cylinder", "health_state"
COUNTED = "duration_s"  # Metric of every session, whose steps show which sessions a run contains


def track_health(root: Path, cylinders: Iterable[tuple[str, str, Path, Path]]) -> int:
    """Bring each cylinder's run up to date. Return how many runs changed.

    The step of a session is its start in seconds since 1970, or its number if it has no start. A session that was
    processed again is not logged again. ``cylinders`` lists name, state, table of sessions and assessment of each.
    ``RuntimeError`` is raised if the store cannot be reached.
    """
    changed = 0
    with open_store(root) as store:
        experiment = store.experiment("health")
        for name, state, sessions, known in cylinders:
            run = _run_of(store, experiment, name)
            if run.data.tags.get(STATE_TAG) == state:
                continue
            _log(store, run, sessions, known)
            store.client.set_tag(run.info.run_id, STATE_TAG, state)
            changed += 1
    return changed


def _run_of(store: Store, experiment: str, name: str) -> Run:
    quoted = name.replace("'", "\\'")
    found = store.client.search_runs([experiment], f"tags.{CYLINDER_TAG} = '{quoted}'", max_results=1)
    return found[0] if found else store.client.create_run(experiment, tags={CYLINDER_TAG: name}, run_name=name)


def _log(store: Store, run: Run, sessions: Path, known: Path) -> None:
    about, table = read_json(known), pq.read_table(sessions, use_threads=False).to_pylist()
    client, run_id = store.client, run.info.run_id
    logged = {each.step for each in client.get_metric_history(run_id, COUNTED)} if COUNTED in run.data.metrics else ()
    metrics = []
    for number, row in enumerate(table, start=1):
        second = round(moment(row["start"]).timestamp()) if row["start"] else None
        step = number if second is None else second
        if step in logged or row["left_out"]:
            continue
        values = {name: value for name, value in row.items() if isinstance(value, float)}
        counted = {COUNTED: values.pop(COUNTED)}  # logged last, so that a session of a killed run is logged again
        at_ms = 1000 * (second or 0)
        metrics += [Metric(name, value, at_ms, step) for name, value in {**values, **counted}.items()]
    client.log_batch(run_id, metrics)
    client.log_dict(run_id, about["assessment"]["trends"], "baselines.json")
    client.log_dict(run_id, about["assessment"], "assessment.json")
    client.set_tag(run_id, "answer", about["assessment"]["answer"])
    client.set_tag(run_id, MLFLOW_RUN_NOTE, about["assessment"]["words"])
    client.set_terminated(run_id, "FINISHED")

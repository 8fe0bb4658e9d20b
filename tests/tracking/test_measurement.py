"""When a run went on and what it cost: true times where it ran on this machine, and none that are invented."""

import time
from pathlib import Path

import pytest
from mlflow import MlflowClient
from mlflow.entities import Run

from cylinder_friction.run_record import RunRecord, Times, now_ms
from cylinder_friction.tracking.log_run import TIMES_UNKNOWN, log_run
from cylinder_friction.tracking.measurement import FOLDER, measured
from cylinder_friction.tracking.store import tracking_uri


def run_of(root: Path, run_id: str) -> Run:
    return MlflowClient(tracking_uri(root)).get_run(run_id)


def ran(root: Path, record: RunRecord, seconds: float = 0.2) -> RunRecord:
    """Run a stage as ``run_stage`` does."""
    with measured(interval_s=0.05) as measurement:
        time.sleep(seconds)
    measurement.keep(record, root)
    return record


def test_a_run_has_the_times_and_the_cost_of_the_stage_however_late_it_is_logged(root: Path) -> None:
    before = now_ms()
    record = ran(root, RunRecord("label", metrics={"rows": 5.0}))
    after = now_ms()
    time.sleep(0.2)
    client = MlflowClient(tracking_uri(root))
    run = run_of(root, log_run(record, root))
    assert before <= run.info.start_time < run.info.end_time <= after
    assert run.info.end_time - run.info.start_time >= 200
    (rows,) = client.get_metric_history(run.info.run_id, "rows")
    assert rows.timestamp == run.info.end_time
    assert "times" not in run.data.tags
    assert 0.0 <= run.data.metrics["system/cpu_utilization_percentage"] <= 100.0
    assert run.data.metrics["system/stage_memory_megabytes"] > 1.0
    samples = client.get_metric_history(run.info.run_id, "system/stage_memory_megabytes")
    assert len(samples) >= 3
    assert all(run.info.start_time <= sample.timestamp <= run.info.end_time for sample in samples)


def test_each_step_of_a_curve_and_each_trial_has_its_own_time(root: Path) -> None:
    trial = RunRecord("trial 0", curves={"mae": [3.0, 2.0]}, times=Times(2_000, 4_000, {"mae": [2_500, 3_500]}))
    resumed = Times(0, 0, {"mae": [7_000]})  # two steps were done by a process that was killed
    record = RunRecord("search", curves={"mae": [9.0, 8.0, 7.0]}, children=(trial,), times=resumed)
    ran(root, record)
    client = MlflowClient(tracking_uri(root))
    search = run_of(root, log_run(RunRecord.from_dict(record.to_dict()), root))
    history = client.get_metric_history(search.info.run_id, "mae")
    started_ms = search.info.start_time
    assert sorted((each.step, each.timestamp) for each in history) == [(0, started_ms), (1, started_ms), (2, 7_000)]
    (child,) = client.search_runs([search.info.experiment_id], f"tags.`mlflow.parentRunId` = '{search.info.run_id}'")
    assert (child.info.start_time, child.info.end_time) == (2_000, 4_000)
    assert [each.timestamp for each in client.get_metric_history(child.info.run_id, "mae")] == [2_500, 3_500]


@pytest.mark.parametrize("content", [None, "{broken", "[]", '{"times": null, "children": [], "samples": []}'])
def test_a_stage_that_ran_elsewhere_states_that_its_times_are_unknown(root: Path, content: str | None) -> None:
    record = RunRecord("search", children=(RunRecord("trial 0"),))
    if content is not None:
        (root / FOLDER).mkdir(parents=True)
        (root / FOLDER / f"{record.key()}.json").write_text(content, encoding="utf-8")
    before = now_ms()
    run = run_of(root, log_run(record, root))
    assert before <= run.info.start_time == run.info.end_time
    assert run.data.tags["times"] == TIMES_UNKNOWN
    assert not run.data.metrics

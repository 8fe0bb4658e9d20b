"""Run records in MLflow: whole, once, and never at the cost of a stage's result."""

import json
import logging
import socket
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mlflow.data
import pytest
from mlflow import MlflowClient
from mlflow.entities import Run

from candidates import runs_in
from cylinder_friction.dvc_hashes import dvc_hash
from cylinder_friction.execution.measuring import MOST_SAMPLES, Took, measured
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.run_record import Dataset, RunRecord
from cylinder_friction.stages._stage import datasets
from cylinder_friction.tracking import log_run as module
from cylinder_friction.tracking.log_run import dataset_input, log_run, track_or_warn
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import tracking_uri


@pytest.fixture
def record(root: Path) -> RunRecord:
    (root / "reports/figures").mkdir(parents=True)
    (root / "reports/table.md").write_text("a table", encoding="utf-8")
    (root / "reports/figures/one.png").write_bytes(b"a picture")
    return RunRecord(
        "train",
        params={"layers": 2, "hybrid.dropout": 0.1, "design": "paper"},
        metrics={"mae_n": 3.5, "MAE (%)": 2.0},
        curves={"validation_mae_n": [float(step) for step in range(2500)]},
        tags={"summary": "it went well"},
        artifacts=("reports/table.md", "reports/figures"),
        tables={"errors": {"condition": ["1", "2"], "percent": [1.5, None]}},
        note="It went **well**.",
        datasets={"train": Dataset("data/processed/train", "ab" * 16 + ".dir", {"friction_n": "double"}, rows=5)},
        children=tuple(RunRecord(f"trial {number}", {"number": number}, {"v": 1.0}) for number in range(3)),
        took=Took(1_000, 5_000, 3.25, 812.5, [{"time_ms": 2_000, "memory_mb": 500.0, "processor_s": 3.25}]),
        commit={"git_commit": "c" * 40, "git_dirty": "false"},
    )


def test_everything_in_a_record_is_in_the_run(root: Path, record: RunRecord) -> None:
    run_id = log_run(RunRecord.from_dict(json.loads(json.dumps(record.to_dict()))), root)
    client = MlflowClient(tracking_uri(root))
    run = client.get_run(run_id)
    assert run.info.status == "FINISHED"
    assert run.info.run_name == "train"
    assert run.data.params == {"layers": "2", "hybrid.dropout": "0.1", "design": "paper"}
    assert run.data.metrics["mae_n"] == 3.5
    assert run.data.metrics["MAE ___"] == 2.0, "characters that MLflow refuses become underscores"
    assert run.data.tags["summary"] == "it went well"
    assert run.data.tags["mlflow.source.git.commit"] == "c" * 40
    assert run.data.tags["git_dirty"] == "false"
    history = client.get_metric_history(run_id, "validation_mae_n")
    assert sorted((one.step, one.value) for one in history) == [(step, float(step)) for step in range(2500)]
    assert [one.path for one in client.list_artifacts(run_id)] == ["errors.json", "reports"]
    assert [one.path for one in client.list_artifacts(run_id, "reports")] == ["reports/figures", "reports/table.md"]
    assert [one.path for one in client.list_artifacts(run_id, "reports/figures")] == ["reports/figures/one.png"]
    assert run.data.tags["mlflow.note.content"] == "It went **well**."
    table = json.loads(Path(client.download_artifacts(run_id, "errors.json")).read_text(encoding="utf-8"))
    assert table == {"columns": ["condition", "percent"], "data": [["1", 1.5], ["2", None]]}
    (dataset,) = run.inputs.dataset_inputs
    assert (dataset.dataset.name, dataset.dataset.digest) == ("train", "ab" * 16 + ".dir")
    assert (run.info.start_time, run.info.end_time) == (1_000, 5_000), "as in the record, however late it is logged"
    assert (run.data.metrics["system/processor_s"], run.data.metrics["system/peak_memory_mb"]) == (3.25, 812.5)
    (sample,) = client.get_metric_history(run_id, "system/memory_mb")
    assert (sample.timestamp, sample.value) == (2_000, 500.0)
    children = runs_in(root, f"tags.`mlflow.parentRunId` = '{run_id}'")
    assert sorted(child.info.run_name for child in children) == ["trial 0", "trial 1", "trial 2"]
    assert all(child.info.status == "FINISHED" for child in children)


def test_a_long_run_has_few_samples_and_its_whole_cost() -> None:
    begun_s = time.process_time()
    with measured(interval_s=0.002) as took:
        while time.process_time() - begun_s < 0.5:
            pass
    found = took()
    assert 2 <= len(found.samples) <= MOST_SAMPLES + 1
    assert found.processor_s >= 0.4
    assert found.peak_memory_mb == max(found.peak_memory_mb, *(each["memory_mb"] for each in found.samples))
    assert found.started_ms < found.ended_ms


def test_a_record_is_logged_once_however_often_it_is_logged(root: Path, record: RunRecord) -> None:
    first = log_run(record, root)
    other = replace(record, took=Took(1, 2), commit={"git_commit": "unknown", "git_dirty": "true"})
    assert log_run(other, root) == first, "when it ran, and at which commit, is no part of what it did"
    assert len(runs_in(root)) == 1 + 3, "the stage, its trials"
    assert log_run(replace(record, metrics={"mae_n": 1.0}), root) != first, "another result"


def test_what_a_kill_left_half_written_is_done_again(
    root: Path, record: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(MlflowClient, "set_terminated", killed)
        with pytest.raises(KeyboardInterrupt):
            log_run(record, root)
    half = runs_in(root)
    assert {run.info.status for run in half} == {"RUNNING"}
    whole = log_run(record, root)
    assert whole not in {run.info.run_id for run in half}
    assert len(runs_in(root)) == 1 + 3
    assert len(MlflowClient(tracking_uri(root)).get_metric_history(whole, "validation_mae_n")) == 2500


def test_a_run_that_was_made_twice_because_an_answer_was_lost_leaves_none_that_runs_for_ever(
    root: Path, record: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    create = MlflowClient.create_run

    def twice(*arguments: object, **named: object) -> Run:
        create(*arguments, **named)
        return create(*arguments, **named)

    monkeypatch.setattr(MlflowClient, "create_run", twice)
    log_run(replace(record, name="compare", pipeline={"recipe": "default"}), root)
    runs = runs_in(root)
    assert {run.info.status for run in runs} == {"FINISHED"}
    assert len(runs) == 1 + 1 + 3


def test_a_record_of_another_recipe_lies_in_its_experiment_with_its_children(root: Path, record: RunRecord) -> None:
    of_smoke = replace(record, experiment="smoke")
    run_id = log_run(of_smoke, root)
    assert log_run(RunRecord.from_dict(json.loads(json.dumps(of_smoke.to_dict()))), root) == run_id
    assert runs_in(root) == [], "the default's table stays as it was"
    runs = runs_in(root, experiment_name="cylinder-friction-smoke")
    assert sorted(run.info.run_name for run in runs) == ["train", "trial 0", "trial 1", "trial 2"]


def test_an_artifact_that_is_missing_is_named(root: Path, record: RunRecord) -> None:
    (root / "reports/table.md").unlink()
    with pytest.raises(TrackingError, match=r"reports/table.md is not there; run `dvc pull` or `dvc repro`"):
        log_run(record, root)
    assert runs_in(root) == [], "nothing is half-logged"


def test_a_folder_of_recordings_is_a_dataset_that_mlflow_resolves(
    written_pipeline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written_pipeline)
    folder = Path("data/processed/test")
    (used,) = datasets({"test": folder}).values()
    found = dataset_input("test", used)
    assert [(tag.key, tag.value) for tag in found.tags] == [("mlflow.data.context", "test")]
    assert found.dataset.digest == dvc_hash(folder)
    schema = json.loads(found.dataset.schema or "")["mlflow_colspec"]
    recordings = read_stored(folder)
    types = {column["name"]: column["type"] for column in schema}
    assert list(types) == list(recordings[0].table.columns)
    assert (types["friction_n"], types["usable"]) == ("double", "boolean")
    assert json.loads(found.dataset.profile or "")["num_rows"] == sum(map(len, recordings))
    assert mlflow.data.get_source(found).load() == str(folder.resolve())


def test_while_dvc_runs_a_stage_its_lock_states_the_hashes_and_nothing_is_read(
    written_pipeline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written_pipeline)
    monkeypatch.setenv("DVC_STAGE", "train")
    monkeypatch.setattr("cylinder_friction.dvc_hashes.dvc_hash", lambda _: pytest.fail("it was hashed again"))
    monkeypatch.setattr("cylinder_friction.files.whole_files.hash_of", lambda _: pytest.fail("it was hashed again"))
    (used,) = datasets({"test": Path("data/processed/test")}).values()
    assert used.md5.endswith(".dir")


@pytest.fixture
def silent_server() -> Iterator[str]:
    """A server whose port accepts connections, and which never answers."""
    with socket.create_server(("127.0.0.1", 0), backlog=50) as listening:
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"


@pytest.mark.parametrize("is_silent", [False, True])
def test_a_server_that_is_gone_or_silent_costs_no_result_but_seconds_and_one_warning(
    root: Path, silent_server: str, is_silent: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", silent_server if is_silent else f"http://127.0.0.1:{free_port()}")
    begun_s = time.monotonic()
    with caplog.at_level(logging.WARNING):
        assert track_or_warn(RunRecord("label"), root) is None
    assert time.monotonic() - begun_s < 30.0
    (warning,) = caplog.records
    assert warning.name == module.__name__
    said = warning.getMessage()
    assert "label: its results are written, but its MLflow run is not: http://127.0.0.1:" in said
    assert ("is no MLflow store that can be opened" if is_silent else "start the server, correct MLFLOW_TRACK") in said
    assert ("timed out" if is_silent else "refused") in said
    assert "Run `cylinder-friction track`" in said

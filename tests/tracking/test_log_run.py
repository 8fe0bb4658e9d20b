"""Run records in MLflow: whole, once, and never at the cost of a stage's result."""

import json
import logging
import socket
from dataclasses import replace
from pathlib import Path

import pytest
from mlflow import MlflowClient
from mlflow.entities import Run

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.run_record import Dataset, RunRecord, Times
from cylinder_friction.tracking import log_run as module
from cylinder_friction.tracking.log_run import log_run, track_or_warn
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import EXPERIMENT, tracking_uri


def client_of(root: Path) -> MlflowClient:
    return MlflowClient(tracking_uri(root))


def runs_of(root: Path, condition: str = "", experiment_name: str = EXPERIMENT) -> list[Run]:
    client = client_of(root)
    experiment = client.get_experiment_by_name(experiment_name)
    assert experiment is not None
    return list(client.search_runs([experiment.experiment_id], condition))


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
        artifacts={path: hash_of(root / path) for path in ("reports/table.md", "reports/figures")},
        tables={"errors": {"condition": ["1", "2"], "percent": [1.5, None]}},
        note="It went **well**.",
        datasets={"train": Dataset("data/processed/train", "ab" * 32, {"friction_n": "double"}, rows=5)},
        children=tuple(RunRecord(f"trial {number}", {"number": number}, {"v": 1.0}) for number in range(3)),
    )


def test_everything_in_a_record_is_in_the_run(root: Path, record: RunRecord) -> None:
    run_id = log_run(record, root)
    client = client_of(root)
    run = client.get_run(run_id)
    assert run.info.status == "FINISHED"
    assert run.info.run_name == "train"
    assert run.data.params == {"layers": "2", "hybrid.dropout": "0.1", "design": "paper"}
    assert run.data.metrics["mae_n"] == 3.5
    assert run.data.metrics["MAE ___"] == 2.0, "characters that MLflow refuses become underscores"
    assert run.data.tags["summary"] == "it went well"
    assert run.data.tags["mlflow.source.git.commit"] == "unknown", "there is no git here"
    history = client.get_metric_history(run_id, "validation_mae_n")
    assert sorted((one.step, one.value) for one in history) == [(step, float(step)) for step in range(2500)]
    assert [one.path for one in client.list_artifacts(run_id)] == ["errors.json", "reports"]
    assert [one.path for one in client.list_artifacts(run_id, "reports")] == ["reports/figures", "reports/table.md"]
    assert [one.path for one in client.list_artifacts(run_id, "reports/figures")] == ["reports/figures/one.png"]
    assert run.data.tags["mlflow.note.content"] == "It went **well**."
    table = json.loads(Path(client.download_artifacts(run_id, "errors.json")).read_text(encoding="utf-8"))
    assert table == {"columns": ["condition", "percent"], "data": [["1", 1.5], ["2", None]]}
    assert json.loads(run.data.tags["mlflow.loggedArtifacts"]) == [{"path": "errors.json", "type": "table"}]
    (dataset,) = run.inputs.dataset_inputs
    assert (dataset.dataset.name, dataset.dataset.digest) == ("train", ("ab" * 32)[:36])
    children = runs_of(root, f"tags.`mlflow.parentRunId` = '{run_id}'")
    assert sorted(child.info.run_name for child in children) == ["trial 0", "trial 1", "trial 2"]
    assert all(child.info.status == "FINISHED" for child in children)


def test_a_record_is_logged_once_however_often_it_is_logged(root: Path, record: RunRecord) -> None:
    assert log_run(record, root) == log_run(RunRecord.from_dict(json.loads(json.dumps(record.to_dict()))), root)
    timed = replace(record, times=Times(1, 2))
    assert log_run(timed, root) == log_run(record, root), "when it ran is no part of what it did"
    assert len(runs_of(root)) == 1 + 1 + 3, "the execution, the stage, its trials"
    assert log_run(replace(record, metrics={"mae_n": 1.0}), root) != log_run(record, root), "another result"


def test_what_a_kill_left_half_written_is_done_again(
    root: Path, record: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(module, "stage_ended", killed)
        with pytest.raises(KeyboardInterrupt):
            log_run(record, root)
    (half,) = runs_of(root, "attributes.run_name = 'train'")
    assert half.info.status == "RUNNING"
    whole = log_run(record, root)
    assert whole != half.info.run_id
    assert len(runs_of(root)) == 5
    assert len(client_of(root).get_metric_history(whole, "validation_mae_n")) == 2500


def test_a_record_may_lie_in_another_experiment_with_its_children(root: Path, record: RunRecord) -> None:
    of_benchmark = replace(record, name="benchmark", experiment="benchmark")
    run_id = log_run(of_benchmark, root)
    assert log_run(RunRecord.from_dict(json.loads(json.dumps(of_benchmark.to_dict()))), root) == run_id
    assert runs_of(root) == [], "the main experiment's first page stays as it was"
    runs = runs_of(root, experiment_name="cylinder-friction-benchmark")
    assert sorted(run.info.run_name for run in runs) == ["benchmark", "trial 0", "trial 1", "trial 2"]
    assert [run.info.run_id for run in runs if "mlflow.parentRunId" not in run.data.tags] == [run_id]


def test_a_record_of_the_main_experiment_has_the_key_it_always_had() -> None:
    search = RunRecord("search", {"trials": 2}, children=(RunRecord("trial 0"),))
    assert search.key() == "bf6608845638456700e937e7efd9db6158f3e34c05a8b7c371f4ff3f1e12f96b"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.unlink(), "reports/table.md is not there; run `dvc pull` or `dvc repro`"),
        (lambda path: path.write_text("other"), "reports/table.md is not what the stage wrote: its hash is"),
    ],
)
def test_an_artifact_that_is_not_the_recorded_one_is_refused(
    root: Path, record: RunRecord, change: object, message: str
) -> None:
    assert callable(change)
    change(root / "reports/table.md")
    with pytest.raises(TrackingError, match=message):
        log_run(record, root)
    assert runs_of(root) == [], "nothing is half-logged"


def test_a_silent_server_costs_no_result(
    root: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://127.0.0.1:{probe.getsockname()[1]}")
        with caplog.at_level(logging.WARNING):
            assert track_or_warn(RunRecord("label"), root) is None
    assert "label: its results are written, but its MLflow run is not: MLFLOW_TRACKING_URI is http://" in caplog.text
    assert "Run `cylinder-friction track`" in caplog.text

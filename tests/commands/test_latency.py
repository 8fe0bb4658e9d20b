"""The command's work: files written, a run that can be logged again, errors in words."""

import json
import shutil
from pathlib import Path

import pytest

from cylinder_friction.commands import latency as command
from cylinder_friction.commands.cli import main
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.latency.measuring import Effort
from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.friction_models.catalogue import model_named
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.tracking import log_run

MODEL = Path(__file__).parents[1] / "golden/model"
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")


@pytest.fixture
def logged(tmp_path: Path, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch) -> list[RunRecord]:
    """Works in a repository with test recordings; returns the list of what MLflow is sent."""
    monkeypatch.chdir(tmp_path)
    write_recording(Path("data/processed/test"), labelled_recordings[0])
    records: list[RunRecord] = []
    monkeypatch.setattr(log_run, "track_or_warn", lambda record, root: records.append(record))
    return records


def test_it_writes_figures_and_run_and_logs_the_same_to_mlflow(logged: list[RunRecord]) -> None:
    text = command.measure_latency([MODEL], Effort(steps=4, rounds=2))
    figures = json.loads(Path("reports/latency.json").read_text(encoding="utf-8"))
    assert list(figures["models"]) == ["model"]
    assert "1x16 LSTM, 16 trees of depth 6" in text
    (record,) = logged
    assert RunRecord.from_dict(json.loads(Path("reports/runs/latency.json").read_text(encoding="utf-8"))) == record
    assert record.name == "latency"
    assert record.metrics["model.c.p50_us"] == figures["models"]["model"]["runtimes"]["c"]["p50_us"]
    assert list(record.artifacts) == ["reports/latency.json"]


def test_a_model_of_another_kind_is_refused_in_words(
    logged: list[RunRecord], cylinder: Cylinder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "load_estimator", lambda _: AnalyticalEstimator(cylinder, model_named("lugre")))
    assert main(["latency", "law", "--steps", "2"]) == 1
    assert "cylinder-friction latency: analytical: has no real-time step" in capsys.readouterr().err
    assert logged == []


def test_a_missing_model_is_named(logged: list[RunRecord], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["latency", "models/nothing"]) == 1
    assert "models/nothing" in capsys.readouterr().err

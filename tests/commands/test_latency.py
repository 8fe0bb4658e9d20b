"""The command's work: files written, a run that can be logged again, errors in words."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from cylinder_friction.commands import latency as command
from cylinder_friction.commands.cli import main
from cylinder_friction.deployment.latency.measuring import Effort
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.tracking.run_record import RunRecord

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording

MODEL = Path(__file__).parents[1] / "golden/model"
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")


@pytest.fixture
def told(tmp_path: Path, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch) -> list[RunRecord]:
    """Works in a repository with test recordings; returns the list of what MLflow is told."""
    monkeypatch.chdir(tmp_path)
    write_recording(Path("data/processed/test"), labelled_recordings[0])
    records: list[RunRecord] = []
    monkeypatch.setattr(command, "track_or_warn", lambda record, root: records.append(record))
    return records


def test_it_writes_figures_and_run_and_tells_mlflow_the_same(told: list[RunRecord]) -> None:
    text = command.bench([MODEL], Effort(steps=4, rounds=2))
    figures = json.loads(Path("reports/latency.json").read_text(encoding="utf-8"))
    assert list(figures["models"]) == ["model"]
    assert "1x16 LSTM, 16 trees of depth 6" in text
    (record,) = told
    assert RunRecord.from_dict(json.loads(Path("reports/runs/latency.json").read_text(encoding="utf-8"))) == record
    assert record.name == "latency"
    assert record.metrics["model.c.p50_us"] == figures["models"]["model"]["contenders"]["c"]["p50_us"]
    assert list(record.artifacts) == ["reports/latency.json"]


def test_a_model_of_another_kind_is_refused_in_words(
    told: list[RunRecord], labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    from cylinder_friction.estimators.linear import RidgeEstimator

    ridge = RidgeEstimator()
    ridge.fit(labelled_recordings[:1])
    ridge.save(Path("ridge"))
    assert main(["bench", "ridge", "--steps", "2"]) == 1
    assert "cylinder-friction bench: ridge: cannot be measured here" in capsys.readouterr().err
    assert told == []


def test_a_missing_model_is_named(told: list[RunRecord], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "models/nothing"]) == 1
    assert "models/nothing" in capsys.readouterr().err

"""What a worker gives a model to learn from."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from friction_benchmark import worker
from friction_benchmark.datasets import Sources
from friction_benchmark.folds import HELD_OUT
from friction_benchmark.jobs import Context, PredictionJob
from friction_benchmark.tasks import task_named
from friction_benchmark_models import CYLINDER, MODELS, SIZES, write_campaign

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.recordings.recording import Recording


@pytest.mark.parametrize(
    ("task", "learns", "stated"),
    [("sensor_drift", True, True), ("sensor_drift", False, False), ("identity", True, False)],
)
def test_where_sensors_drift_a_model_that_learns_offsets_is_given_those_of_its_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, task: str, learns: bool, stated: bool
) -> None:
    sources = Sources(tmp_path / "campaigns", SIZES, CYLINDER)
    seen: list[Recording] = []
    write_campaign(sources, "campaign", 0)
    train = worker.trained

    def watched(model: Any, code: str, configuration: Any, recordings: list[Recording], fits: Path) -> worker.Trained:
        seen.extend(recordings)
        return train(model, code, configuration, recordings, fits)

    monkeypatch.setattr(worker, "trained", watched)
    job = PredictionJob(replace(MODELS[0], learns_offset=learns), task_named(task), HELD_OUT, 0, 0, {}, False, "code")
    predicted = worker.prediction(Context(sources, tmp_path, 0.5, 2, 1, "worker"), job)
    assert len(predicted.estimates) == 4 * (4 if task == "sensor_drift" else 1)
    assert len(seen) == 4
    assert all(bool(each.metadata.identified_zero) == stated for each in seen)

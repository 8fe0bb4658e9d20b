"""A store filled from files: once, whole as far as the files go, and the champion's place left as it is."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict
from typing import TYPE_CHECKING

import pytest
from mlflow import MlflowClient

from candidates import candidate_in, champion, never, other_model, record_model, versions
from cylinder_friction.tracking.registry import REGISTERED_FILE, register
from cylinder_friction.tracking.replay import replay
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import tracking_uri

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from cylinder_friction.tracking.gate import Registered


@pytest.fixture
def registered_pipeline(pipeline: Path) -> Path:
    write_registered(pipeline, lambda: register(candidate_in(pipeline), pipeline, 0.1, never))
    return pipeline


def write_registered(root: Path, decide: Callable[[], Registered]) -> None:
    (root / REGISTERED_FILE).write_text(json.dumps(asdict(decide())), encoding="utf-8")


def test_a_replay_fills_an_empty_store_and_never_twice(
    registered_pipeline: Path, empty_store: Path, tmp_path: Path
) -> None:
    root = tmp_path / "clone"
    shutil.copytree(registered_pipeline, root, ignore=shutil.ignore_patterns("mlflow.db*", "mlartifacts"))
    shutil.copy(empty_store, root / "mlflow.db")
    first = replay(root)
    assert first.logged == ("record", "search", "train", "compare")
    assert (first.present, first.problems) == ((), ())
    assert first.version == "friction-estimator version 1 (champion)"
    again = replay(root)
    assert (again.logged, again.present) == ((), ("record", "search", "train", "compare"))
    assert (
        again.summary() == "0 runs logged, 4 already there\nregistered model: friction-estimator version 1 (champion)"
    )
    assert len(versions(root)) == 1
    client = MlflowClient(tracking_uri(root))
    experiment = client.get_experiment_by_name("cylinder-friction")
    assert experiment is not None
    assert len(client.search_runs([experiment.experiment_id])) == 4 + 3, "three trials below the search"


def test_a_replay_leaves_a_newer_champion_in_its_place(registered_pipeline: Path) -> None:
    root = registered_pipeline
    saved = (root / REGISTERED_FILE).read_text(encoding="utf-8")
    shutil.copytree(root / "models/hybrid", root / "kept")
    other_model(root)
    register(candidate_in(root, {"1": 1.0, "2": 1.0}), root, 0.1, never)
    shutil.rmtree(root / "models/hybrid")
    shutil.move(root / "kept", root / "models/hybrid")
    record_model(root)
    (root / REGISTERED_FILE).write_text(saved, encoding="utf-8")
    assert replay(root).version == "friction-estimator version 1 (not champion)"
    assert champion(root) == "2"


def test_a_replay_keeps_a_refusal(pipeline: Path, empty_store: Path, tmp_path: Path) -> None:
    register(candidate_in(pipeline), pipeline, 0.1, never)
    other_model(pipeline)
    write_registered(pipeline, lambda: register(candidate_in(pipeline, {"1": 9.0, "2": 9.0}), pipeline, 0.1, never))
    root = tmp_path / "clone"
    shutil.copytree(pipeline, root, ignore=shutil.ignore_patterns("mlflow.db*", "mlartifacts"))
    shutil.copy(empty_store, root / "mlflow.db")
    assert replay(root).version == "friction-estimator version 1 (not champion)"
    assert versions(root)[0].tags["gate_decision"] == "refused"


def test_a_replay_goes_on_past_what_is_missing_and_names_it(pipeline: Path) -> None:
    (pipeline / "reports/report.html").unlink()
    (pipeline / "reports/runs/zz.json").write_text("{", encoding="utf-8")
    done = replay(pipeline)
    assert done.logged == ("record", "search", "train")
    assert done.version is None
    assert "not logged: compare.json: run 'compare': reports/report.html is not there; run `dvc pull`" in done.summary()
    assert "not logged: zz.json" in done.summary()


def test_a_replay_of_nothing_says_what_to_do(root: Path) -> None:
    with pytest.raises(TrackingError, match="holds no run; run `dvc pull` or `dvc repro` first"):
        replay(root)

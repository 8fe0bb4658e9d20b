"""The registry: a candidate once, the champion only through the gate, the same end whenever a kill comes."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

import mlflow
import pytest
from mlflow import MlflowClient

from cylinder_friction.tracking import registry as module
from cylinder_friction.tracking.content import hash_of
from cylinder_friction.tracking.errors import TrackingError
from cylinder_friction.tracking.registry import REGISTERED_FILE, Candidate, Registered, register
from cylinder_friction.tracking.replay import replay
from cylinder_friction.tracking.store import tracking_uri
from cylinder_friction.tracking.versions import origin_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mlflow.entities.model_registry import ModelVersion

NAME = "friction-estimator"


def candidate_in(root: Path, errors: dict[str, float] | None = None) -> Candidate:
    processed = [f"data/processed/{role}" for role in ("train", "validation", "test")]
    origin = origin_of(root, "data/raw/rig", processed)
    return Candidate(
        NAME,
        "models/hybrid",
        hash_of(root / "models/hybrid"),
        errors or {"1": 2.0, "2": 2.0},
        origin.data["data/processed/test"],
        origin,
        {"pressure_1_pa": [1e6, 1.1e6], "pressure_2_pa": [9e5, 9e5], "position_m": [0.12, 0.121]},
    )


def other_model(root: Path) -> None:
    """Makes the candidate's folder another model, which works as well."""
    path = root / "models/hybrid/estimator.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    content["parameters"]["target_mean_n"] += 1.0
    path.write_text(json.dumps(content), encoding="utf-8")


def never(folder: Path) -> dict[str, float]:
    raise AssertionError(f"{folder} was measured again without need")


def versions(root: Path) -> list[ModelVersion]:
    client = MlflowClient(tracking_uri(root))
    found = client.search_model_versions(f"name = '{NAME}'")
    return sorted((client.get_model_version(NAME, one.version) for one in found), key=lambda one: int(one.version))


def champion(root: Path) -> str:
    return str(MlflowClient(tracking_uri(root)).get_model_version_by_alias(NAME, "champion").version)


def test_the_first_candidate_is_promoted_and_tagged_with_the_way_back(pipeline: Path) -> None:
    candidate = candidate_in(pipeline)
    registered = register(candidate, pipeline, 0.1, never)
    assert registered.promote
    (version,) = versions(pipeline)
    assert champion(pipeline) == str(version.version)
    tags = version.tags
    assert tags["model_key"] == candidate.model_key
    assert tags["git_dirty"] == "false"
    assert len(tags["git_commit"]) == 40
    assert tags["data_raw_md5"] == candidate.origin.data["data/raw/rig"]
    assert tags["data_processed_train_md5"] == candidate.origin.data["data/processed/train"]
    assert tags["params_sha256"] == candidate.origin.params_sha256
    assert (tags["gate_decision"], tags["promoted_from"], tags["promoted_to"]) == ("promoted", "none", "version 1")
    run = MlflowClient(tracking_uri(pipeline)).get_run(version.run_id or "")
    assert run.info.run_name == "train"
    assert f"models:/{run.outputs.model_outputs[0].model_id}" == version.source


def test_the_logged_model_carries_all_it_needs_and_no_pickle(pipeline: Path) -> None:
    register(candidate_in(pipeline), pipeline, 0.1, never)
    (description,) = pipeline.glob("mlartifacts/models/*/artifacts/MLmodel")
    files = [path for path in description.parent.rglob("*") if path.is_file()]
    assert {path.name for path in files} >= {"scoring_model.py", "network.onnx", "forest.onnx", "lineage.json"}
    assert {path.suffix for path in files} <= {"", ".py", ".json", ".onnx", ".yaml", ".txt"}
    assert not [path for path in files if path.read_bytes().startswith(b"\x80")], "that is how a pickle begins"
    loaded = mlflow.pyfunc.load_model(str(description.parent))
    assert loaded.metadata.signature.inputs.required_input_names() == ["pressure_1_pa", "pressure_2_pa", "position_m"]
    assert list(loaded.predict(loaded.input_example).columns) == ["friction_n", "in_training_range"]
    assert loaded.metadata.signature.outputs.input_names() == ["friction_n", "in_training_range"]


def test_the_same_model_is_registered_once_and_decided_once(pipeline: Path) -> None:
    first = register(candidate_in(pipeline), pipeline, 0.1, never)
    assert register(candidate_in(pipeline), pipeline, 0.1, never) == first
    assert len(versions(pipeline)) == 1


def test_a_refused_candidate_is_a_version_that_says_why(pipeline: Path) -> None:
    register(candidate_in(pipeline), pipeline, 0.1, never)
    other_model(pipeline)
    refused = register(candidate_in(pipeline, {"1": 1.0, "2": 2.5}), pipeline, 0.1, never)
    assert not refused.promote
    first, second = versions(pipeline)
    assert champion(pipeline) == str(first.version)
    assert second.tags["gate_decision"] == "refused"
    assert "worse in test 2: 2.500 % against 2.000 %" in second.tags["gate_reason"]
    assert second.description == second.tags["gate_reason"]
    assert "promoted_to" not in second.tags


def test_a_better_one_takes_the_place_and_says_from_whom(pipeline: Path) -> None:
    old = candidate_in(pipeline)
    register(old, pipeline, 0.1, never)
    other_model(pipeline)
    better = register(candidate_in(pipeline, {"1": 1.0, "2": 1.0}), pipeline, 0.1, never)
    assert better.incumbent is not None
    assert better.incumbent.model_key == old.model_key
    _, second = versions(pipeline)
    assert champion(pipeline) == str(second.version)
    assert (second.tags["promoted_from"], second.tags["promoted_to"]) == ("version 1", "version 2")


def test_an_incumbent_measured_on_other_recordings_is_measured_again(pipeline: Path) -> None:
    register(candidate_in(pipeline), pipeline, 0.1, never)
    other_model(pipeline)
    seen: list[str] = []

    def measured(folder: Path) -> dict[str, float]:
        seen.append(hash_of(folder))
        return {"1": 0.5, "2": 0.5}

    candidate = replace(candidate_in(pipeline, {"1": 1.0, "2": 1.0}), test_data_md5="other")
    refused = register(candidate, pipeline, 0.1, measured)
    assert not refused.promote, "on the present recordings the incumbent is the better one"
    assert seen == [versions(pipeline)[0].tags["model_key"]], "the incumbent's own files were measured"


@pytest.mark.parametrize(
    "at",
    [
        "save_model_folder",
        "_write_decision",
        "_promote",
        "_version_of",
        "create_model_version",
        "finalize_logged_model",
    ],
)
def test_a_kill_at_any_moment_changes_nothing_in_the_end(
    pipeline: Path, at: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    place = module if hasattr(module, at) else MlflowClient
    with monkeypatch.context() as patch:
        patch.setattr(place, at, killed)
        with pytest.raises(KeyboardInterrupt):
            register(candidate_in(pipeline), pipeline, 0.1, never)
    registered = register(candidate_in(pipeline), pipeline, 0.1, never)
    assert registered.reason.startswith("promoted: there is no incumbent")
    (version,) = versions(pipeline)
    assert champion(pipeline) == str(version.version)
    client = MlflowClient(tracking_uri(pipeline))
    experiment = client.get_experiment_by_name("cylinder-friction")
    assert experiment is not None
    assert len(client.search_logged_models([experiment.experiment_id])) == 1
    assert len(client.search_runs([experiment.experiment_id], "attributes.run_name = 'train'")) == 1


def test_a_model_that_is_not_the_measured_one_is_refused(pipeline: Path) -> None:
    candidate = candidate_in(pipeline)
    other_model(pipeline)
    with pytest.raises(TrackingError, match=r"models/hybrid: its content hash is .*… was measured; run `dvc checkout`"):
        register(candidate, pipeline, 0.1, never)


@pytest.fixture
def registered_pipeline(pipeline: Path) -> Path:
    write_registered(pipeline, lambda: register(candidate_in(pipeline), pipeline, 0.1, never))
    return pipeline


def write_registered(root: Path, decide: Callable[[], Registered]) -> None:
    (root / REGISTERED_FILE).write_text(json.dumps(decide().to_dict()), encoding="utf-8")


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

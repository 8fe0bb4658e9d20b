"""The registry: a candidate once, the champion only through the gate, the same end whenever a kill comes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from mlflow import MlflowClient

from candidates import candidate_in, champion, never, other_model, versions
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking import model_version, registry
from cylinder_friction.tracking.registry import register
from cylinder_friction.tracking.store import tracking_uri

if TYPE_CHECKING:
    from pathlib import Path


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
    assert "worse in condition 2: 2.500 % against 2.000 %" in second.tags["gate_reason"]
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

    place = next(one for one in (registry, model_version, MlflowClient) if hasattr(one, at))
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

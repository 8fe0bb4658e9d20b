"""A pipeline's run: what it was configured as and how good its model is, in one row of MLflow's table."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mlflow import MlflowClient

from candidates import runs_in
from cylinder_friction.run_record import Dataset, RunRecord
from cylinder_friction.tracking.log_run import log_run
from cylinder_friction.tracking.registry import track
from cylinder_friction.tracking.store import EXPERIMENT, open_store, tracking_uri

BRANCHED = ("record", "split", "train", "lugre", "compare")
PIPELINE = {"recipe": "default", "seed": "1", "changes": "none"}


def ran(root: Path, *stages: str, version: float = 1.0, log: bool = True, **changes: str) -> None:
    """Let stages run one after the other, as DVC does: the file of a record, then its run."""
    for stage in stages:
        record = RunRecord(
            stage,
            {"seed": 1},
            {"truth_error_percent/mean": version} if stage == "compare" else {"sessions/train": 8.0},
            note=f"{stage} found {version}.",
            datasets={"test": Dataset("data/processed/test", "a" * 32, {}, 192_000)} if stage == "compare" else {},
            tags={"version": str(version)},
            pipeline={**PIPELINE, **changes} if stage in ("compare", "register") else {},
        )
        path = root / f"reports/runs/{stage}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(record.to_dict()), encoding="utf-8")
        if log:
            log_run(record, root)


def pipelines(root: Path) -> dict[str, list[str]]:
    """Return the stages whose runs lie below each pipeline's run, by its name."""
    runs = runs_in(root)
    found = {run.info.run_id: run.info.run_name for run in runs if run.data.tags["stage"] == "pipeline"}
    below = [(found.get(run.data.tags.get("mlflow.parentRunId", ""), ""), run.info.run_name) for run in runs]
    return {name: sorted(stage for parent, stage in below if parent == name) for name in sorted(found.values())}


def test_it_states_recipe_seed_changes_data_and_held_out_errors(root: Path) -> None:
    ran(root, *BRANCHED, **{"train.lag_s": "0.05"})
    (run,) = (each for each in runs_in(root) if each.data.tags["stage"] == "pipeline")
    assert run.info.status == "FINISHED"
    assert run.data.params == {
        "recipe": "default",
        "seed": "1",
        "changes": "none",
        "train.lag_s": "0.05",
        "sessions.train": "8",
        "rows.test": "192000",
    }
    assert run.data.metrics == {"truth_error_percent/mean": 1.0}, "what the table sorts by"
    assert run.info.run_name == "default"
    assert pipelines(root) == {"default": sorted(BRANCHED)}


def test_a_changed_stage_makes_another_run_and_what_is_restored_or_runs_again_alike_none(root: Path) -> None:
    ran(root, *BRANCHED)
    ran(root, "train", "compare", version=2.0, changes="train.seed=2")
    assert pipelines(root) == {"default": ["compare", "train"], "default, train.seed=2": sorted(BRANCHED)}
    (run,) = (each for each in runs_in(root) if each.info.run_name == "default, train.seed=2")
    assert run.data.tags["mlflow.note.content"] == "train found 2.0.\n\ncompare found 2.0."
    ran(root, "train", "compare", log=False)  # DVC restores them
    assert track(root).logged == []
    ran(root, *BRANCHED)  # and `dvc repro --force` runs them
    assert pipelines(root) == {"default": sorted(BRANCHED), "default, train.seed=2": ["compare", "train"]}
    assert len(runs_in(root)) == 2 + len(BRANCHED) + 2


def test_a_run_that_could_not_be_logged_at_once_comes_to_its_pipeline(root: Path) -> None:
    ran(root, "record", "split", "train", log=False)  # the server did not respond
    ran(root, "lugre", "compare")
    assert pipelines(root) == {"default": ["compare", "lugre"]}
    assert track(root).logged == ["record", "split", "train"]
    assert pipelines(root) == {"default": sorted(BRANCHED)}


def test_another_tolerance_of_the_gate_is_another_run(root: Path) -> None:
    ran(root, *BRANCHED, "register")
    ran(root, "register", version=2.0, changes="register.tolerance_percent=0.2")
    found = pipelines(root)
    assert found == {
        "default": ["register"],
        "default, register.tolerance_percent=0.2": sorted([*BRANCHED, "register"]),
    }
    track(root)
    assert pipelines(root) == found


def test_a_deleted_run_is_logged_again_be_it_a_stages_or_a_pipelines(root: Path) -> None:
    ran(root, *BRANCHED)
    for run in runs_in(root):
        if run.data.tags["stage"] in ("pipeline", "train"):
            MlflowClient(tracking_uri(root)).delete_run(run.info.run_id)
    assert track(root).logged == ["train"]
    assert pipelines(root) == {"default": sorted(BRANCHED)}


def test_looking_brings_back_no_deleted_experiment(root: Path) -> None:
    ran(root, *BRANCHED)
    client = MlflowClient(tracking_uri(root))
    experiment = client.get_experiment_by_name(EXPERIMENT)
    assert experiment is not None
    client.delete_experiment(experiment.experiment_id)
    with open_store(root, create=False):
        pass
    found = client.get_experiment_by_name(EXPERIMENT)
    assert found is not None
    assert found.lifecycle_stage == "deleted"


@pytest.mark.parametrize("stage", ["latency", "label"])
def test_what_ends_no_pipeline_has_no_pipelines_run(root: Path, stage: str) -> None:
    run = MlflowClient(tracking_uri(root)).get_run(log_run(RunRecord(stage), root))
    assert "mlflow.parentRunId" not in run.data.tags
    assert len(runs_in(root)) == 1

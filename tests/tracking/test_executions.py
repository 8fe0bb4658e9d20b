"""One MLflow run per execution of the pipeline: it follows from the records, so that nothing is logged twice."""

from __future__ import annotations

import json
from pathlib import Path

import mlflow.data
import pytest
import yaml
from mlflow import MlflowClient

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.run_record import STAGES, RunRecord, comes_after
from cylinder_friction.stages._stage import datasets
from cylinder_friction.tracking.executions import dataset_input, digest_of
from cylinder_friction.tracking.log_run import log_run
from cylinder_friction.tracking.measurement import measured
from cylinder_friction.tracking.replay import replay
from cylinder_friction.tracking.store import EXPERIMENT, tracking_uri

BRANCHED = ("record", "search", "train", "lugre", "compare")


def ran(root: Path, *stages: str, version: float = 1.0, log: bool = True) -> None:
    """Let stages run one after the other, as DVC does: the file of a record, then its run."""
    for stage in stages:
        with measured() as measurement:
            record = RunRecord(stage, {"seed": 1}, {f"{stage}_version": version}, note=f"{stage} found {version}.")
        path = root / f"reports/runs/{stage}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(record.to_dict()), encoding="utf-8")
        measurement.keep(record, root)
        if log:
            log_run(record, root)


def executions(root: Path) -> dict[str, list[str]]:
    """Return the stages whose runs lie below each execution, by its name, in the order of time."""
    client = MlflowClient(tracking_uri(root))
    experiment = client.get_experiment_by_name(EXPERIMENT)
    assert experiment is not None
    runs = client.search_runs([experiment.experiment_id], order_by=["attributes.start_time ASC"])
    found = {run.info.run_id: (run.info.run_name, []) for run in runs if run.data.tags["stage"] == "pipeline"}
    for run in runs:
        if run.info.run_id not in found:
            found[run.data.tags["mlflow.parentRunId"]][1].append(run.info.run_name)
    return {name: sorted(stages, key=STAGES.index) for name, stages in found.values()}


def execution(root: Path, name: str) -> tuple[dict[str, str], dict[str, float]]:
    client = MlflowClient(tracking_uri(root))
    experiment = client.get_experiment_by_name(EXPERIMENT)
    assert experiment is not None
    (run,) = client.search_runs([experiment.experiment_id], f"attributes.run_name = '{name}'")
    assert run.info.status == "FINISHED"
    return run.data.tags, run.data.metrics


def test_a_changed_stage_begins_an_execution_of_what_ran_again(root: Path) -> None:
    ran(root, *BRANCHED)
    runs = {run.info.run_name: run.info for run in MlflowClient(tracking_uri(root)).search_runs(["1"])}
    assert runs["pipeline 1"].start_time == runs["record"].start_time
    assert runs["pipeline 1"].end_time == runs["compare"].end_time
    ran(root, "train", "compare", version=2.0)
    assert executions(root) == {"pipeline 1": list(BRANCHED), "pipeline 2": ["train", "compare"]}
    tags, metrics = execution(root, "pipeline 2")
    assert tags["stages_run"] == "train, compare"
    assert metrics == {"compare_version": 2.0}, "what the executions are compared by"
    assert "Ran: train, compare." in tags["mlflow.note.content"]
    assert "Up to date, from an earlier execution: record, search, lugre." in tags["mlflow.note.content"]
    assert "compare found 2.0." in tags["mlflow.note.content"]


def test_what_was_interrupted_is_gone_on_with(root: Path) -> None:
    ran(root, *BRANCHED)
    ran(root, "search", version=2.0)
    ran(root, "train", "compare", version=2.0)
    assert executions(root)["pipeline 2"] == ["search", "train", "compare"]
    ran(root, "search", version=3.0)
    ran(root, "search", version=4.0)
    assert executions(root)["pipeline 3"] == executions(root)["pipeline 4"] == ["search"]


def test_going_back_to_an_earlier_state_logs_nothing(root: Path) -> None:
    ran(root, *BRANCHED)
    ran(root, "train", "compare", version=2.0)
    before = executions(root)
    ran(root, "train", "compare", log=False)  # DVC restores them
    assert replay(root).logged == ()
    ran(root, *BRANCHED)  # and `dvc repro --force` runs them
    assert executions(root) == before


def test_a_run_that_could_not_be_logged_at_once_comes_to_its_own_execution(root: Path) -> None:
    ran(root, *BRANCHED)
    ran(root, "train", version=2.0, log=False)  # the server did not respond
    ran(root, "compare", version=2.0)
    assert executions(root)["pipeline 2"] == ["compare"]
    assert replay(root).logged == ("train",)
    assert executions(root) == {"pipeline 1": list(BRANCHED), "pipeline 2": ["train", "compare"]}


def test_two_machines_that_change_different_stages_have_an_execution_each(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", tracking_uri(root))
    other = tmp_path / "other"
    (other / ".dvc").mkdir(parents=True)
    ran(root, *BRANCHED)
    ran(other, *BRANCHED)
    ran(root, "lugre", version=2.0)
    ran(other, "train", version=2.0)
    ran(root, "compare", version=2.0)
    ran(other, "compare", version=3.0)
    assert executions(root) == {
        "pipeline 1": list(BRANCHED),
        "pipeline 2": ["lugre", "compare"],
        "pipeline 3": ["train", "compare"],
    }


def test_what_is_no_stage_of_the_pipeline_lies_beside_the_executions(root: Path) -> None:
    run = MlflowClient(tracking_uri(root)).get_run(log_run(RunRecord("benchmark"), root))
    assert "mlflow.parentRunId" not in run.data.tags


def test_a_folder_of_recordings_is_a_dataset_that_mlflow_resolves(
    written_pipeline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written_pipeline)
    folder = Path("data/processed/test")
    (used,) = datasets({"test": folder}).values()
    found = dataset_input("test", used)
    assert [(tag.key, tag.value) for tag in found.tags] == [("mlflow.data.context", "test")]
    assert found.dataset.digest == hash_of(folder)[:36] == digest_of(used)
    schema = json.loads(found.dataset.schema or "")["mlflow_colspec"]
    recordings = read_stored(folder)
    types = {column["name"]: column["type"] for column in schema}
    assert list(types) == list(recordings[0].table.columns)
    assert (types["friction_n"], types["usable"]) == ("double", "boolean")
    assert json.loads(found.dataset.profile or "")["num_rows"] == sum(map(len, recordings))
    assert mlflow.data.get_source(found).load() == str(folder.resolve())


def test_the_order_of_the_stages_is_that_of_dvc_yaml() -> None:
    text = (Path(__file__).parents[2] / "dvc.yaml").read_text(encoding="utf-8")
    stages = yaml.safe_load(text.replace("${ingest.source}", "data/raw/rig"))["stages"]
    del stages["code"]  # it has no run
    outs = {
        Path(next(iter(out)) if isinstance(out, dict) else out): stage
        for stage, content in stages.items()
        for out in (*content.get("outs", ()), *content.get("metrics", ()))
    }
    needs = {
        stage: {
            outs[path] for dep in content.get("deps", ()) for path in (Path(dep), *Path(dep).parents) if path in outs
        }
        for stage, content in stages.items()
    }
    for _ in STAGES:
        needs = {stage: direct.union(*(needs[each] for each in direct)) for stage, direct in needs.items()}
    assert {stage: {each for each in STAGES if comes_after(stage, each)} for stage in STAGES} == needs

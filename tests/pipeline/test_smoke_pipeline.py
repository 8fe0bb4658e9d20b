"""The whole pipeline as a user runs it: real stages, real DVC, real MLflow, on the smoke recipe."""

import json
import re
import shutil
import sys
from pathlib import Path
from urllib.request import Request, urlopen

import mlflow
import pytest
import yaml

from cylinder_friction.deployment.child_server import child_server
from cylinder_friction.execution.ports import free_port
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.run_record import STAGES
from pipeline_workspace import MAKE, PROJECT, commit, copy_of, run, run_here

MODEL = "friction-estimator-smoke"
GUIDE = PROJECT / "docs/configuration.md"
TIMED = {"reports/timings.json", "reports/report.html", *(f"reports/runs/{stage}.json" for stage in STAGES)}


def client_of(folder: Path) -> mlflow.MlflowClient:
    return mlflow.MlflowClient(f"sqlite:///{folder / 'mlflow.db'}")


def runs_of(folder: Path, name: str = "cylinder-friction-smoke") -> list[mlflow.entities.Run]:
    client = client_of(folder)
    experiment = client.get_experiment_by_name(name)
    return list(client.search_runs([experiment.experiment_id], max_results=1000))


def metrics_of(folder: Path) -> str:
    return (folder / "reports/metrics.json").read_text(encoding="utf-8")


def test_a_second_repro_looks_at_the_code_and_runs_nothing_else(finished_pipeline: Path) -> None:
    done = run(finished_pipeline, "dvc", "repro")
    assert re.findall(r"Running stage '(\w+)'", done.stdout) == ["code"]
    assert re.findall(r"Stage '(\w+)' didn't change", done.stdout) == list(STAGES)


@pytest.mark.extended
def test_the_campaign_of_the_same_seed_gives_the_same_bit_for_bit(finished_pipeline: Path, tmp_path: Path) -> None:
    stages = yaml.safe_load((finished_pipeline / "dvc.yaml").read_text(encoding="utf-8"))["stages"]
    seed = yaml.safe_load((finished_pipeline / "params.yaml").read_text(encoding="utf-8"))["record"]["seed"]
    done = run(PROJECT, *MAKE, "seeds", f"ARGS={seed} experiment=smoke --keep={tmp_path}", check=False)
    assert "of 8 claims hold" in done.stdout, done.stderr
    assert f"seed {seed}  label  1  hybrid" in done.stdout
    again = tmp_path / f"seed_{seed}"
    assert metrics_of(again) == metrics_of(finished_pipeline)
    results = {result for name in STAGES if name != "register" for result in stages[name]["outs"]}
    for result in sorted(results - TIMED):
        assert hash_of(again / result) == hash_of(finished_pipeline / result), result


def test_every_estimator_is_scored_in_every_test_against_label_and_truth(finished_pipeline: Path) -> None:
    metrics = json.loads(metrics_of(finished_pipeline))
    expected = {
        "hybrid", "paper_hybrid", "lstm", "paper_lstm", "random_forest", "ridge", "lugre", "pressure_lugre",
        "pressure_lugre_all", "force_balance_unfiltered", "force_balance_paper", "force_balance_low_pass",
    }  # fmt: skip
    assert set(metrics) == expected
    for name in expected:
        assert set(metrics[name]) == {"1", "2", "3", "4"}
        for numbers in metrics[name].values():
            assert 0.0 < numbers["label_percent"] < 200.0
            assert 0.0 < numbers["truth_percent"] < 200.0


def test_training_saw_the_recordings_of_its_roles_and_none_that_is_held_out(finished_pipeline: Path) -> None:
    seen = json.loads((finished_pipeline / "models/hybrid/training_data.json").read_text(encoding="utf-8"))
    processed = finished_pipeline / "data/processed"
    there = {role: {path.stem for path in (processed / role).glob("*.parquet")} for role in (*seen, "test")}
    assert {role: set(names) for role, names in seen.items()} == {role: there[role] for role in seen}
    assert there["test"]
    assert not there["test"] & set().union(*seen.values())


def test_nothing_that_is_stored_is_a_pickle(finished_pipeline: Path) -> None:
    suffixes = {path.suffix for path in (finished_pipeline / "models").rglob("*") if path.is_file()}
    assert suffixes <= {".json", ".onnx", ".html", ".md", ".csv", ".gitignore", ""}
    logged = {path.suffix for path in (finished_pipeline / "mlartifacts").rglob("*") if path.is_file()}
    assert not logged & {".pkl", ".pickle", ".joblib", ".pt", ".pth"}


def test_every_stage_has_its_run_and_every_trial_its_child_run(finished_pipeline: Path) -> None:
    runs = runs_of(finished_pipeline)
    named = {run.info.run_name: run for run in runs}
    assert set(STAGES) <= set(named)
    assert all(run.info.status == "FINISHED" for run in runs)
    parent = named["search"].info.run_id
    children = [run for run in runs if run.data.tags.get("mlflow.parentRunId") == parent]
    assert len(children) == 3
    (execution,) = (run.info for run in runs if run.data.tags.get("stage") == "pipeline")
    assert re.fullmatch(r"smoke \([0-9a-f]{7}\)", execution.run_name), "two executions of a recipe differ in the commit"
    for stage in STAGES:
        ran = named[stage]
        assert ran.data.tags["mlflow.parentRunId"] == execution.run_id
        assert execution.start_time <= ran.info.start_time < ran.info.end_time <= execution.end_time
        assert len([name for name in ran.data.metrics if not name.startswith("system/")]) <= 20
    assert named["train"].info.end_time <= named["compare"].info.start_time
    assert runs_of(finished_pipeline, "cylinder-friction") == [], "a recipe has an experiment of its own"


def test_the_table_of_runs_is_enough_to_decide_from(finished_pipeline: Path) -> None:
    (run,) = (each for each in runs_of(finished_pipeline) if each.data.tags.get("stage") == "pipeline")
    assert (run.data.params["recipe"], run.data.params["changes"]) == ("smoke", "none")
    assert run.data.params["train.training.epochs"] == "3", "what differs from the default recipe"
    assert "train.lag_s" not in run.data.params
    assert (run.data.params["sessions.test"], run.data.params["rows.test"]) == ("4", "12800")
    metrics = json.loads(metrics_of(finished_pipeline))["hybrid"]
    for condition, numbers in metrics.items():
        assert run.data.metrics[f"truth_error_percent/condition_{condition}"] == numbers["truth_percent"]
    assert "truth_error_percent/mean" in run.data.metrics
    version = client_of(finished_pipeline).get_model_version_by_alias(MODEL, "champion")
    assert version.run_id == run.info.run_id, "comparing versions compares these"


@pytest.mark.extended
def test_the_way_back_from_an_experiment_leads_to_ones_own_results(finished_pipeline: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_pipeline, tmp_path)
    steps = dict(re.findall(r"```bash step=(\S+)\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL))
    who = {f"GIT_{role}_{what}": "t@localhost" for role in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    run(folder, "bash", "-euc", steps["commit-results"], given=who)
    run(folder, "dvc", "exp", "run", "-S", "experiment=smoke", "-S", "compare.timing_repeats=7")
    drawn = json.loads(run(folder, "dvc", "plots", "diff", "HEAD", "--json").stdout)["data"]
    assert len(drawn) == 5
    for plots in drawn.values():
        revisions = {each["rev"] for plot in plots for each in plot["content"]["data"]["values"]}
        assert revisions == {"workspace", "HEAD"}, "overlaid"
    run(folder, "bash", "-euc", steps["way-back"])
    assert metrics_of(folder) == metrics_of(finished_pipeline)
    for result in ("models/hybrid", "reports/report.html", "data/processed/train"):
        assert hash_of(folder / result) == hash_of(finished_pipeline / result), result
    assert re.findall(r"^(\w+):", run(folder, "dvc", "status").stdout, re.MULTILINE) == ["code"]


@pytest.mark.extended
def test_track_fills_an_empty_store_from_a_pulled_clone_without_duplicates(
    finished_pipeline: Path, tmp_path: Path
) -> None:
    source = copy_of(finished_pipeline, tmp_path / "source")
    run(source, "dvc", "remote", "add", "--default", "shelf", str(tmp_path / "shelf"))
    shutil.copy(PROJECT / "benchmark/dvc.lock", source / "benchmark")  # of results that nobody has pushed
    commit(source, "finished")
    run(source, "dvc", "push")
    clone = tmp_path / "clone"
    run(tmp_path, "git", "clone", "--quiet", str(source), str(clone))
    run(clone, "dvc", "pull")
    for _ in range(2):
        run_here(clone, "cylinder-friction", "track")
        assert len(runs_of(clone)) == len(runs_of(finished_pipeline))
        versions = client_of(clone).search_model_versions(f"name='{MODEL}'")
        assert len(versions) == 1
    assert versions[0].aliases == [], "only register and a person promote"
    shown = run_here(clone, "cylinder-friction", "promote", str(versions[0].version))
    assert shown.stdout == f"{MODEL}: champion was none, is version {versions[0].version}\n"
    assert "links hold" in run_here(clone, "cylinder-friction", "lineage").stdout
    port, rows = free_port(), clone / "models/registered.json"
    command = [sys.executable, "-m", "mlflow", "models", "serve", "--model-uri", f"models:/{MODEL}@champion"]
    command += ["--env-manager", "local", "--port", str(port)]
    given = {"MLFLOW_TRACKING_URI": f"sqlite:///{clone / 'mlflow.db'}"}
    with child_server(command, f"http://127.0.0.1:{port}/ping", cwd=tmp_path, environment=given):
        example = json.loads(rows.read_text(encoding="utf-8"))["example"]
        body = json.dumps({"dataframe_split": {"columns": [*example], "data": [*zip(*example.values(), strict=True)]}})
        asked = Request(f"http://127.0.0.1:{port}/invocations", body.encode(), {"Content-Type": "application/json"})
        answer = json.load(urlopen(asked, timeout=60.0))["predictions"]
    assert len(answer) == len(example["position_m"])
    assert answer[-1]["lower_n"] < answer[-1]["friction_n"] < answer[-1]["upper_n"]


def test_a_bad_configuration_is_refused_before_any_stage_does_anything(finished_pipeline: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_pipeline, tmp_path)
    with (folder / "params.yaml").open("a", encoding="utf-8") as file:
        file.write("serach:\n  trials: 3\n")
    before = sorted((folder / "data").rglob("*"))
    done = run_here(folder, "cylinder-friction", "stage", "record", check=False)
    assert done.returncode == 1
    assert "serach: unknown key" in done.stderr
    assert sorted((folder / "data").rglob("*")) == before

"""One benchmark from configuration to page: what it leaves behind, what MLflow gets, and how it goes on."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from cylinder_friction.params.file import ParamsError
from cylinder_friction.params.section import checked
from cylinder_friction.tracking.store import open_store
from friction_benchmark import params as configuration
from friction_benchmark import run as benchmark
from friction_benchmark.cli import main
from friction_benchmark.params import BenchmarkParams, compose_benchmark
from friction_benchmark_models import MODULES, SIZES, write_campaign, write_own

if TYPE_CHECKING:
    from cylinder_friction.run_record import RunRecord
    from friction_benchmark.runner import Runner

PROJECT = Path(__file__).parents[2]
CONF = PROJECT / "benchmark/conf"
PLAN = {"seeds", "tasks", "splits", "models"}


def tiny_params(**changes: Any) -> BenchmarkParams:
    """Return the smoke recipe with another registry's models."""
    content = compose_benchmark(["experiment=smoke"], CONF).model_dump()
    content["plan"] |= {"models": ["low_pass", "hold", "constant_by_direction", "ridge"]}
    for key, value in changes.items():
        if key in PLAN:
            content["plan"][key] = value
        elif key == "effort":
            content["budget"][key] = value
        else:
            content[key] = value
    content["cylinder"] |= {"name": "made"}
    return checked(BenchmarkParams, content, "test")


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder to work in; the registry is the tests' own, and campaigns are made, not simulated."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "benchmark/conf").mkdir(parents=True)
    runner_from = benchmark.runner_from

    def with_own_registry(params: BenchmarkParams) -> Runner:
        runner = runner_from(params)
        if runner.sources.simulated:
            runner.sources = replace(runner.sources, sizes=SIZES)
            for kind, sessions in (("campaign", 3), ("unseen", 1)):
                if not runner.sources.campaign_folder(kind, 0).is_dir():
                    write_campaign(runner.sources, kind, 0, sessions=sessions)
        runner.plan = replace(runner.plan, modules=MODULES)
        return runner

    monkeypatch.setattr(benchmark, "runner_from", with_own_registry)
    return tmp_path


def evaluate(params: BenchmarkParams) -> RunRecord:
    return benchmark.evaluate(params, benchmark.runner_from(params))


def test_it_leaves_results_and_report(workplace: Path) -> None:
    record = evaluate(tiny_params())
    results = json.loads(benchmark.RESULTS_FILE.read_text())
    assert {(task["task"], task["split"]) for task in results["tasks"]} == {
        ("identity", "held_out_sessions"),
        ("pressure_free", "held_out_sessions"),
        ("identity", "unseen_rig"),
    }
    assert set(results["findings"]) == {"identity", "pressure_free"}
    assert "<html" in benchmark.REPORT_FILE.read_text()
    assert set(record.artifacts) == {"reports/benchmark.json", "reports/benchmark.html"}


def test_every_line_of_every_leaderboard_is_a_run_to_compare(workplace: Path) -> None:
    record = evaluate(tiny_params())
    results = json.loads(benchmark.RESULTS_FILE.read_text())
    lines = [(task["task"], task["split"], e["model"]) for task in results["tasks"] for e in task["entries"]]
    assert [tuple(child.params[name] for name in ("task", "split", "model")) for child in record.children] == lines
    ridge = next(child for child in record.children if child.params["model"] == "ridge")
    assert {"tuned.lags", "tuned.penalty", "effort", "trials", "seeds"} <= set(ridge.params)
    expected = {"percent", "mae_n", "lag_ms", "coverage", "coverage.condition_1", "below_baseline", "standstill.mae_n"}
    assert expected <= set(ridge.metrics)
    assert record.metrics["identity.held_out_sessions.best_percent"] == min(
        child.metrics["percent"] for child in record.children if child.name.startswith("identity held_out_sessions")
    )


@pytest.mark.slow
def test_mlflow_takes_the_runs(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    subprocess.run(["git", "init", "--quiet"], cwd=workplace, check=True)
    who = ["-c", "user.name=test", "-c", "user.email=test@localhost"]
    subprocess.run(["git", *who, "commit", "--quiet", "--allow-empty", "-m", "x"], cwd=workplace, check=True)
    benchmark.run(tiny_params(models=["low_pass", "hold"]))
    run_id = benchmark.track()
    assert benchmark.track() == run_id
    with open_store(workplace) as store:
        found = {name: store.client.search_runs([store.experiment(name)]) for name in ("", "benchmark")}
    assert found[""] == [], "the pipeline's own runs stay in sight"
    record = json.loads(benchmark.RECORD_FILE.read_text(encoding="utf-8"))
    children = [run for run in found["benchmark"] if run.data.tags.get("mlflow.parentRunId") == run_id]
    assert len(children) == len(record["children"]) == len(found["benchmark"]) - 1


def test_an_interrupted_benchmark_goes_on_where_it_was(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "findings_of", stop)
    with pytest.raises(KeyboardInterrupt):
        evaluate(tiny_params())
    assert not benchmark.RESULTS_FILE.exists()
    kept = list((workplace / benchmark.CACHE).glob("predictions/*.npz"))
    assert len(kept) == 4 + 2 + 4 + 1, "the last one is the trial that was not the best"
    monkeypatch.undo()
    monkeypatch.chdir(workplace)


def test_own_recordings_take_the_place_of_simulated_ones(workplace: Path) -> None:
    write_own(workplace / "data/processed")
    record = evaluate(tiny_params(source="data/processed", models=["low_pass", "hold"]))
    results = json.loads(benchmark.RESULTS_FILE.read_text())
    assert results["budget"]["source"] == "own recordings"
    assert results["missing"] == {"identity, unseen_rig": "there are no recordings of another rig"}
    assert set(record.datasets) == {"train", "validation", "test"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tasks": ["identify"]}, "plan.tasks.0: no task 'identify'; expected one of identity, pressure_free"),
        ({"effort": 0.0}, "budget.effort: Input should be greater than 0"),
        (
            {"splits": {"unseen_rig": ["forecast_25ms"]}},
            "splits.unseen_rig: task 'forecast_25ms' is not among tasks; add it there or leave it out",
        ),
        ({"seeds": []}, "plan.seeds: List should have at least 1 item"),
    ],
)
def test_a_wrong_configuration_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ParamsError, match=message):
        tiny_params(**changes)


def test_sessions_must_be_left_to_train_on() -> None:
    with pytest.raises(ParamsError, match=r"sessions_per_condition is 3, of which .* leave none to train on"):
        compose_benchmark(["experiment=smoke", "campaign.test_sessions=2"], CONF)


def test_the_committed_parameters_are_what_conf_composes() -> None:
    committed = yaml.safe_load((PROJECT / "benchmark/params.yaml").read_text(encoding="utf-8"))
    assert checked(BenchmarkParams, committed, "params.yaml") == compose_benchmark(conf=CONF)


@pytest.mark.parametrize("recipe", sorted(path.stem for path in (CONF / "experiment").glob("*.yaml")))
def test_every_recipe_composes(recipe: str) -> None:
    compose_benchmark([f"experiment={recipe}"], CONF)


def test_an_interrupted_command_states_what_is_kept_and_how_to_go_on(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(configuration, "load_benchmark_params", stop)
    assert main(["run"]) == 130
    assert (
        "friction-benchmark run: interrupted; finished jobs are kept in .cylinder-friction/benchmark-cache; run "
        in (capsys.readouterr().err)
    )


def test_an_error_that_is_not_the_users_is_raised(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise ValueError("of the program")

    monkeypatch.setattr(configuration, "load_benchmark_params", fail)
    with pytest.raises(ValueError, match="of the program"):
        main(["run"])


def test_the_command_line_starts_without_what_its_commands_need() -> None:
    heavy = "{'pandas', 'scipy', 'hydra', 'torch', 'mlflow', 'pydantic'}"
    code = f"import sys, friction_benchmark.cli; print(sorted({heavy} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "[]\n"


def test_the_command_states_what_is_wrong_and_where(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run"]) == 1
    assert "params.yaml: not there; run `friction-benchmark params`" in capsys.readouterr().err
    assert main(["track"]) == 1
    assert "reports/runs/benchmark.json: not there; run `make benchmark`" in capsys.readouterr().err

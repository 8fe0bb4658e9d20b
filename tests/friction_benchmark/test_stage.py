"""The benchmark stage: what it leaves behind, what it tells MLflow, and that an interrupted one goes on."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.commands.params import compose_params
from cylinder_friction.params.checking import Params, ParamsError, check_params
from cylinder_friction.recordings.files import write_json
from cylinder_friction.tracking.log_run import log_run
from cylinder_friction.tracking.store import open_store
from friction_benchmark import stage as benchmark
from friction_benchmark_models import MODULES, SIZES, write_campaign, write_own

CONF = Path(__file__).parents[2] / "conf"


def tiny_params(**changes: Any) -> Params:
    """Return the smoke recipe with another roster's models."""
    content = compose_params(CONF, ["experiment=smoke"])
    content["benchmark"] |= {"models": ["low_pass", "hold", "constant_by_direction", "ridge"], **changes}
    content["cylinder"] |= {"name": "made"}
    return check_params(content, "test")


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder to work in; the roster is the tests' own, and campaigns are made, not simulated."""
    monkeypatch.chdir(tmp_path)
    bench_from = benchmark.bench_from

    def with_own_roster(params: Params) -> Any:
        bench, folders = bench_from(params)
        if bench.sources.simulated:
            sources = replace(bench.sources, sizes=SIZES)
            write_campaign(sources, "campaign", 0)
            write_campaign(sources, "unseen", 0, sessions=1)
            bench = replace(bench, sources=sources)
        return replace(bench, modules=MODULES), folders

    monkeypatch.setattr(benchmark, "bench_from", with_own_roster)
    return tmp_path


def test_it_leaves_results_report_and_nothing_else(workplace: Path) -> None:
    record = benchmark.run(tiny_params())
    results = json.loads(benchmark.RESULTS_FILE.read_text())
    assert {(task["task"], task["split"]) for task in results["tasks"]} == {
        ("identity", "held_out_sessions"),
        ("pressure_free", "held_out_sessions"),
        ("identity", "unseen_rig"),
    }
    assert set(results["findings"]) == {"identity", "pressure_free"}
    assert "<html" in benchmark.REPORT_FILE.read_text()
    assert set(record.artifacts) == {"reports/benchmark.json", "reports/benchmark.html"}
    assert not list((workplace / ".cylinder-friction/resume").iterdir())


def test_every_line_of_every_leaderboard_is_a_run_to_compare(workplace: Path) -> None:
    record = benchmark.run(tiny_params())
    results = json.loads(benchmark.RESULTS_FILE.read_text())
    lines = [(task["task"], task["split"], e["model"]) for task in results["tasks"] for e in task["entries"]]
    assert [tuple(child.params[name] for name in ("task", "split", "model")) for child in record.children] == lines
    ridge = next(child for child in record.children if child.params["model"] == "ridge")
    assert {"tuned.lags", "tuned.penalty", "effort", "trials", "seeds"} <= set(ridge.params)
    assert {"percent", "mae_n", "lag_ms", "coverage", "coverage.condition_1", "below_floor", "standstill.mae_n"} <= set(
        ridge.metrics
    )
    assert record.metrics["identity.held_out_sessions.best_percent"] == min(
        child.metrics["percent"] for child in record.children if child.name.startswith("identity held_out_sessions")
    )


@pytest.mark.slow
def test_mlflow_takes_the_runs(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    subprocess.run(["git", "init", "--quiet"], cwd=workplace, check=True)
    who = ["-c", "user.name=test", "-c", "user.email=test@localhost"]
    subprocess.run(["git", *who, "commit", "--quiet", "--allow-empty", "-m", "x"], cwd=workplace, check=True)
    record = benchmark.run(tiny_params(models=["low_pass", "hold"]))
    write_json(benchmark.RESULTS_FILE.parent / "runs/benchmark.json", record.to_dict())
    run_id = log_run(record, workplace)
    assert log_run(record, workplace) == run_id
    with open_store(workplace) as store:
        found = {name: store.client.search_runs([store.experiment(name)]) for name in ("", "benchmark")}
    assert found[""] == [], "the pipeline's own runs stay in sight"
    children = [run for run in found["benchmark"] if run.data.tags.get("mlflow.parentRunId") == run_id]
    assert len(children) == len(record.children) == len(found["benchmark"]) - 1


def test_an_interrupted_benchmark_goes_on_where_it_was(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "findings_of", stop)
    with pytest.raises(KeyboardInterrupt):
        benchmark.run(tiny_params())
    assert not benchmark.RESULTS_FILE.exists()
    kept = list((workplace / ".cylinder-friction/resume").glob("benchmark-*/answers/*/*/*.json"))
    assert len(kept) == 4 + 2 + 4
    times = {path: path.stat().st_mtime_ns for path in kept}
    with pytest.raises(KeyboardInterrupt):
        benchmark.run(tiny_params())
    assert {path: path.stat().st_mtime_ns for path in kept} == times


def test_own_recordings_take_the_place_of_simulated_ones(workplace: Path) -> None:
    write_own(workplace / "data/processed")
    record = benchmark.run(tiny_params(source="data/processed", models=["low_pass", "hold"]))
    results = json.loads(benchmark.RESULTS_FILE.read_text())
    assert results["budget"]["source"] == "own recordings"
    assert results["missing"] == {"identity, unseen_rig": "there are no recordings of another rig"}
    assert set(record.datasets) == {"train", "validation", "test"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tasks": ["identify"]}, "benchmark.tasks.0: Input should be 'identity'"),
        ({"effort": 0.0}, "benchmark.effort: Input should be greater than 0"),
        (
            {"splits": {"unseen_rig": ["forecast_25ms"]}},
            "splits.unseen_rig: task 'forecast_25ms' is not among tasks; add it there or leave it out",
        ),
        ({"seeds": []}, "benchmark.seeds: List should have at least 1 item"),
    ],
)
def test_a_wrong_configuration_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ParamsError, match=message):
        tiny_params(**changes)


def test_sessions_must_be_left_to_teach() -> None:
    content = compose_params(CONF, ["experiment=smoke"])
    content["benchmark"]["campaign"] |= {"test_sessions": 2}
    with pytest.raises(ParamsError, match=r"sessions_per_condition is 3, of which .* leave none to teach"):
        check_params(content, "test")

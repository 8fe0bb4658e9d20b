"""The benchmark's pipeline beside the product's, as a user runs it: real DVC, real simulation, on the smoke recipe."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import pytest
import yaml

from pipeline_workspace import PROJECT, commit, new_repository, run

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [pytest.mark.slow]

MAKE = ("make", "-s", "-o", f"{sys.prefix}/.installed", f"VENV={sys.prefix}")
MODEL = "src/friction_benchmark/models/narx.py"


@pytest.fixture(scope="module")
def finished_benchmark(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the root of a repository in which the benchmark has run; the product's pipeline never has."""
    folder = new_repository(tmp_path_factory.mktemp("benchmark"))
    run(folder, "friction-benchmark", "params", "experiment=smoke", "plan.tasks=[identity]", "~plan.splits.unseen_rig")
    commit(folder, "smoke benchmark")
    printed = run(folder, *MAKE, "benchmark").stdout
    assert f"page     {folder / 'benchmark/reports/benchmark.html'}" in printed
    return folder


def test_its_results_lie_in_its_own_folder(finished_benchmark: Path) -> None:
    results = json.loads((finished_benchmark / "benchmark/reports/benchmark.json").read_text(encoding="utf-8"))
    assert [(task["task"], task["split"]) for task in results["tasks"]] == [("identity", "held_out_sessions")]
    assert not (finished_benchmark / "reports").exists()
    assert (finished_benchmark / "mlflow.db").is_file()
    assert not (finished_benchmark / "benchmark/mlflow.db").exists()
    assert run(finished_benchmark, "git", "status", "--short").stdout == "?? benchmark/dvc.lock\n"


def test_the_product_knows_nothing_of_it(finished_benchmark: Path) -> None:
    """A repository that has seen nothing but the benchmark has all of the product's stages still to run."""
    listed = run(finished_benchmark, "dvc", "stage", "list", "--all").stdout
    assert "benchmark" not in listed
    for file in ("dvc.yaml", "params.yaml"):
        assert "benchmark" not in (PROJECT / file).read_text(encoding="utf-8")
    before = run(finished_benchmark, "dvc", "status").stdout
    model = finished_benchmark / MODEL
    model.write_text(model.read_text(encoding="utf-8") + "\n# touched\n", encoding="utf-8")
    assert run(finished_benchmark, "dvc", "status").stdout == before
    again = run(finished_benchmark / "benchmark", "dvc", "repro", "--dry").stdout
    assert "friction-benchmark inputs" in again


def test_every_split_of_the_configuration_has_tasks_that_are_run() -> None:
    params = yaml.safe_load((PROJECT / "benchmark/params.yaml").read_text(encoding="utf-8"))
    assert set(params["plan"]["splits"]) == {"unseen_rig", "leave_one_load_out", "leave_one_temperature_out"}

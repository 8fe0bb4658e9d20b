"""The benchmark's pipeline beside the product's, as a user runs it: real DVC, real simulation, on the smoke recipe."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import yaml

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [pytest.mark.slow]

PROJECT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
INSTALLED = [option for mark in ("", "-dev", "-benchmark") for option in ("-o", f"{BIN.parent}/.installed{mark}")]
MAKE = ("make", "-s", f"VENV={BIN.parent}", *INSTALLED)
"""Make with the environment that the tests run in, so that nothing is installed."""
MODEL = "benchmark/src/friction_benchmark/models/narx.py"


def run(folder: Path, *command: str) -> str:
    """Run a command in a folder and return what it printed; what it wrote is shown if it fails."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("MLFLOW_", "DVC_", "MAKE"))}
    given = {**kept, "PATH": f"{BIN}:{os.environ['PATH']}", "DVC_NO_ANALYTICS": "true"}
    done = subprocess.run(command, cwd=folder, env=given, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def files_of_git(folder: Path) -> Iterator[str]:
    """Yield what git holds or would hold."""
    listed = run(folder, "git", "ls-files", "--cached", "--others", "--exclude-standard")
    yield from (name for name in listed.splitlines() if (folder / name).is_file())


@pytest.fixture(scope="module")
def finished_benchmark(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the root of a repository in which the benchmark has run; the product's pipeline never has."""
    folder = tmp_path_factory.mktemp("benchmark")
    for name in files_of_git(PROJECT):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PROJECT / name, folder / name)
    (folder / "benchmark/dvc.lock").unlink(missing_ok=True)
    run(folder, "git", "init", "--quiet")
    run(folder, "friction-benchmark", "params", "experiment=smoke", "plan.tasks=[identity]", "~plan.splits.unseen_rig")
    run(folder, "git", "add", "--all")
    who = ("-c", "user.name=test", "-c", "user.email=test@localhost")
    run(folder, "git", *who, "commit", "--quiet", "--message", "smoke benchmark")
    printed = run(folder, *MAKE, "benchmark")
    assert f"page     {folder / 'benchmark/reports/benchmark.html'}" in printed
    return folder


def test_its_results_lie_in_its_own_folder(finished_benchmark: Path) -> None:
    results = json.loads((finished_benchmark / "benchmark/reports/benchmark.json").read_text(encoding="utf-8"))
    assert [(task["task"], task["split"]) for task in results["tasks"]] == [("identity", "held_out_sessions")]
    assert not (finished_benchmark / "reports").exists()
    assert (finished_benchmark / "mlflow.db").is_file()
    assert not (finished_benchmark / "benchmark/mlflow.db").exists()
    assert run(finished_benchmark, "git", "status", "--short") == "?? benchmark/dvc.lock\n"


def test_the_product_knows_nothing_of_it(finished_benchmark: Path) -> None:
    """A repository that has seen nothing but the benchmark has all of the product's stages still to run."""
    listed = run(finished_benchmark, "dvc", "stage", "list", "--all")
    assert "benchmark" not in listed
    for file in ("dvc.yaml", "params.yaml"):
        assert "benchmark" not in (PROJECT / file).read_text(encoding="utf-8")
    before = run(finished_benchmark, "dvc", "status")
    model = finished_benchmark / MODEL
    model.write_text(model.read_text(encoding="utf-8") + "\n# touched\n", encoding="utf-8")
    assert run(finished_benchmark, "dvc", "status") == before
    again = run(finished_benchmark / "benchmark", "dvc", "repro", "--dry")
    assert "friction-benchmark inputs" in again


def test_every_split_of_the_configuration_has_tasks_that_are_run() -> None:
    params = yaml.safe_load((PROJECT / "benchmark/params.yaml").read_text(encoding="utf-8"))
    assert set(params["plan"]["splits"]) == {"unseen_rig", "leave_one_load_out", "leave_one_temperature_out"}

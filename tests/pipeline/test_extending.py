"""What a person touches by hand to extend the pipeline: done in scratch copies, and counted."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import mlflow
import pytest

from pipeline_workspace import PROJECT, copy_of, run

pytestmark = pytest.mark.extended

NEW_DIMENSION = {
    "src/cylinder_friction/tuning/space.py": (
        "    forest_depth: tuple[_Count, _Count]\n",
        "    forest_depth: tuple[_Count, _Count]\n    weight_decay: Sequence[float] = (0.0,)\n",
    ),
    "conf/search/default.yaml": ("  forest_depth: [4, 10]\n", "  forest_depth: [4, 10]\n  weight_decay: [0.0, 0.01]\n"),
}
"""Files that a search with another field of ``TrainingPlan`` needs, each with what is there and what it becomes."""
SEARCHED = """
from cylinder_friction.params.checking import load_params
from cylinder_friction.stages._training import LearningData, hybrid_from
from cylinder_friction.tuning.search import _distributions

params = load_params()
chosen = {**params.train.hybrid.model_dump(), "weight_decay": 0.01}
data = LearningData([], [], [], ("pressure_1_pa", "pressure_2_pa", "position_m"), None, None, {})
hybrid = hybrid_from(params.cylinder, "force_balance", chosen, params.search, data)
print(_distributions(params.search.space)["weight_decay"].choices, hybrid.plan.weight_decay)
"""

NEW_ESTIMATOR = {
    "my_friction.py": """
from typing import ClassVar

from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator


class MyEstimator(LowPassForceBalanceEstimator):
    kind: ClassVar[str] = "mine"
""",
    "my_friction-1.0.dist-info/entry_points.txt": "[cylinder_friction.estimators]\nmine = my_friction:MyEstimator\n",
}
"""Files of a package with an estimator: its module, and the entry point that its pyproject.toml states."""


def test_a_search_with_a_new_dimension_touches_two_files(tmp_path: Path) -> None:
    for name in ("src", "conf"):
        shutil.copytree(PROJECT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name, (old, new) in NEW_DIMENSION.items():
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert text.count(old) == 1, name
        (tmp_path / name).write_text(text.replace(old, new), encoding="utf-8")
    given = {"PYTHONPATH": str(tmp_path / "src")}
    run(tmp_path, sys.executable, "-m", "cylinder_friction.commands.cli", "params", given=given)
    assert run(tmp_path, sys.executable, "-c", SEARCHED, given=given).stdout == "(0.0, 0.01) 0.01\n"
    assert len(NEW_DIMENSION) <= 3


def test_a_new_estimator_as_champion_touches_two_files(finished_pipeline: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    for name, text in NEW_ESTIMATOR.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_text(text, encoding="utf-8")
    installed = site / "my_friction-1.0.dist-info"  # what `pip install` adds
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: my-friction\nVersion: 1.0\n", encoding="utf-8")
    folder = copy_of(finished_pipeline, tmp_path)
    given = {"PYTHONPATH": os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH", "")]))}
    command = (sys.executable, "-m", "cylinder_friction.commands.cli")
    chosen = ("experiment=smoke", "register.candidate=mine", "register.model_name=own")
    run(folder, *command, "params", *chosen, given=given)
    run(folder, *command, "check", given=given)
    run(folder, "dvc", "repro", given=given)
    client = mlflow.MlflowClient(f"sqlite:///{folder / 'mlflow.db'}")
    version = client.get_model_version_by_alias("own", "champion")
    run_of_it = client.get_run(version.run_id or "")
    assert run_of_it.data.params["register.candidate"] == "mine", "the run that has the errors of this very candidate"
    mean = float(version.tags["error_percent"].split()[0])
    assert run_of_it.data.metrics["truth_error_percent/mean"] == pytest.approx(mean, abs=0.001)
    requirements = next(folder.glob("mlartifacts/models/*/artifacts/**/mine/../../requirements.txt"))
    assert "my-friction" not in requirements.read_text(encoding="utf-8"), "somebody else may publish that name"
    assert (requirements.parent / "code/my_friction.py").is_file()
    assert "links hold" in run(folder, *command, "lineage", "models:/own@champion", given=given).stdout
    assert len(NEW_ESTIMATOR) <= 2

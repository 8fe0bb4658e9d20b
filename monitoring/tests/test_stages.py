"""The stages that simulate a fleet and monitor it, and what they refuse."""

from __future__ import annotations

import json
import shutil
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest
import yaml

from cylinder_friction_monitoring import stages
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.lives import FATES
from pipeline_workspace import run

HOUSE = Path(__file__).parents[1]
SHORT = {"seed": 0, "sessions": 1, "begins": 1, "takes": 1}


def with_params(folder: Path, **changes: Any) -> None:
    content = yaml.safe_load((HOUSE / "params.yaml").read_text(encoding="utf-8"))
    (folder / "params.yaml").write_text(yaml.safe_dump(content | {"fleet": SHORT} | changes), encoding="utf-8")


@pytest.fixture(scope="module")
def monitored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which both stages ran."""
    folder = tmp_path_factory.mktemp("fleet")
    with_params(folder)
    with chdir(folder):
        stages.fleet()
        stages.monitor()
    return folder


def test_a_cylinder_per_fate_is_simulated_and_monitored(monitored: Path) -> None:
    assert sorted(path.name for path in (monitored / "data/fleet/logs").iterdir()) == sorted(FATES)
    metrics = json.loads((monitored / "reports/metrics.json").read_text())
    assert metrics == {"cylinders": 8, "sessions": 8, "refused": 0, "answers": {"not_yet": 8}}
    assert (monitored / "reports/health/health.html").is_file()


def test_a_registered_model_is_refused(monitored: Path) -> None:
    path = monitored / "data/fleet/fleet.yaml"
    before = path.read_text()
    content = yaml.safe_load(before)
    content["defaults"]["model"] = "models:/friction-estimator@champion"
    path.write_text(yaml.safe_dump(content))
    words = r"drift has the model models:/.*, expected a folder; a registered model changes unseen by DVC"
    with chdir(monitored), pytest.raises(MonitoringError, match=words):
        stages.monitor()
    path.write_text(before)


def test_wrong_parameters_are_refused(tmp_path: Path) -> None:
    with_params(tmp_path, monitor={"file": "fleet.yaml"}, other=1)
    with chdir(tmp_path), pytest.raises(MonitoringError, match=r"monitor.logs: Field required\n  other: Extra inputs"):
        stages.load_params()


@pytest.mark.extended
def test_dvc_runs_the_stages_and_nothing_twice(tmp_path: Path) -> None:
    run(tmp_path, "git", "init", "--quiet")
    for name in ("dvc.yaml", ".dvcignore", ".gitignore"):
        shutil.copy(HOUSE / name, tmp_path)
    shutil.copytree(HOUSE / ".dvc", tmp_path / ".dvc", ignore=shutil.ignore_patterns("tmp", "cache"))
    with_params(tmp_path)
    done = run(tmp_path, "dvc", "repro").stdout
    assert [done.count(f"Running stage '{name}'") for name in ("code", "fleet", "monitor")] == [1, 1, 1]
    assert (tmp_path / "reports/health/health.html").is_file()
    again = run(tmp_path, "dvc", "repro").stdout
    assert [again.count(f"Running stage '{name}'") for name in ("code", "fleet", "monitor")] == [1, 0, 0]

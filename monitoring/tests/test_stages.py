"""The pipeline that simulates a fleet and monitors it."""

import json
import shutil
from pathlib import Path

import pytest
import yaml

from cylinder_friction_monitoring.lives import FATES
from pipeline_workspace import run

HOUSE = Path(__file__).parents[1]


@pytest.mark.extended
def test_dvc_simulates_once_and_monitors_every_time(tmp_path: Path) -> None:
    run(tmp_path, "git", "init", "--quiet")
    for name in ("dvc.yaml", ".dvcignore", ".gitignore", "params.yaml"):
        shutil.copy(HOUSE / name, tmp_path)
    shutil.copytree(HOUSE / ".dvc", tmp_path / ".dvc", ignore=shutil.ignore_patterns("tmp", "cache"))
    shutil.copytree(HOUSE / "src", tmp_path / "src")
    params = yaml.safe_load((HOUSE / "params.yaml").read_text(encoding="utf-8"))
    short = params | {"fleet": {"seed": 0, "sessions": 1, "begins": 1, "takes": 1}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(short), encoding="utf-8")
    for simulated in (1, 0):
        done = run(tmp_path, "dvc", "repro").stdout
        assert [done.count(f"Running stage '{name}'") for name in ("fleet", "monitor")] == [simulated, 1]
    assert sorted(path.name for path in (tmp_path / "data/fleet/logs").iterdir()) == sorted(FATES)
    health = json.loads((tmp_path / "reports/health/health.json").read_text(encoding="utf-8"))
    assert [(each["answer"], each["sessions"]) for each in health["cylinders"]] == [("not yet", 1)] * len(FATES)
    assert health["refused"] == []

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
    left = shutil.ignore_patterns("tmp", "cache", "data", "reports", "tests", "build")
    shutil.copytree(HOUSE, tmp_path, ignore=left, dirs_exist_ok=True)
    params = yaml.safe_load((HOUSE / "params.yaml").read_text(encoding="utf-8"))
    params["fleet"] = {"seed": 0, "sessions": 1, "begins": 1, "takes": 1}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(params), encoding="utf-8")
    for simulated in (1, 0):
        done = run(tmp_path, "dvc", "repro").stdout
        assert [done.count(f"Running stage '{name}'") for name in ("fleet", "monitor")] == [simulated, 1]
    assert sorted(path.name for path in (tmp_path / "data/fleet/logs").iterdir()) == sorted(FATES)
    health = json.loads((tmp_path / "reports/health/health.json").read_text(encoding="utf-8"))
    assert [(each["answer"], each["sessions"]) for each in health["cylinders"]] == [("not yet", 1)] * len(FATES)
    assert health["refused"] == []

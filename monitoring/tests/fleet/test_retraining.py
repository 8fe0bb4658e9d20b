"""A model's bounds over simulated lives: retraining is proposed for another seal, and for no zero that drifts."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.forest import ForestEstimator
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.columns import UNCERTAINTY_COLUMN
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction_monitoring.fleet.demonstration import CHANNELS, DIMENSIONS, write_life
from cylinder_friction_monitoring.fleet.fleet_file import load_fleet
from cylinder_friction_monitoring.fleet.nightly import FleetHealth, monitor_fleet
from cylinder_friction_monitoring.lives import LifePlan

pytestmark = pytest.mark.extended
PLAN = LifePlan(sessions=68, begins=34, takes=16, time_step_s=1e-4)
Monitored = Callable[..., tuple[FleetHealth, dict[str, Any]]]


@pytest.fixture(scope="module")
def monitored(tmp_path_factory: pytest.TempPathFactory) -> Monitored:
    """Monitors one life with a forest that was trained on its healthy sessions."""
    folder = tmp_path_factory.mktemp("lives")
    (folder / "channels.yaml").write_text(yaml.safe_dump(CHANNELS))
    write_life(folder / "healthy", 0, "healthy", PLAN)
    logs = sorted((folder / "healthy").glob("*.csv"))[: PLAN.begins : 3]
    cylinder = Cylinder(name="press", **DIMENSIONS)
    labelled = label(read_recordings(logs, folder / "channels.yaml", cylinder), cylinder)
    healthy = [each.without_columns(UNCERTAINTY_COLUMN) for each in labelled]  # for bounds that hold the label
    forest = ForestEstimator(cylinder).fit(healthy[::2])
    forest.calibrate(healthy[::2], healthy[1::2], cylinder)
    forest.save(folder / "model")

    def run(name: str, fate: str, plan: LifePlan = PLAN, **own: Any) -> tuple[FleetHealth, dict[str, Any]]:
        write_life(folder / f"{name}/logs/press", 0, fate, plan)
        for log in sorted((folder / "healthy").glob("*.csv"))[: PLAN.begins]:
            shutil.copyfile(log, folder / f"{name}/logs/press/{log.name}")
        stated = {"dimensions": DIMENSIONS, "channels": "channels.yaml", "model": "model", "baseline_sessions": 30}
        fleet = {"cylinders": {"press": {**stated, "false_alarms_per_year": 0.2, **own}}}
        (folder / "fleet.yaml").write_text(yaml.safe_dump(fleet))
        into = folder / name / "health"
        health = monitor_fleet([folder / name / "logs"], load_fleet(folder / "fleet.yaml"), into, datetime.now(UTC))
        return health, json.loads((into / "cylinders/press.json").read_text())["assessment"]["model"]

    return run


def test_another_seal_proposes_retraining_and_a_healthy_life_or_a_drifting_zero_does_not(monitored: Monitored) -> None:
    health, model = monitored("same", "healthy")
    assert (model["now_percent"], health.lines[0].look) == (None, "")
    softer = replace(PLAN, begins=0, takes=40)  # friction of a seal that is worn, a fifth lower
    services = [{"time": "2025-02-09", "words": "piston and rod seals"}]
    health, model = monitored("seal", "wear", softer, services=services)
    assert model["proposed"], model["words"]
    assert model["since"] in ("press-2025-02-09T06", "press-2025-02-10T06")
    assert health.lines[0].look.startswith("Retraining is proposed. The model's bounds state 90 % and held ")
    assert any("Retraining is proposed" in each for each in health.news)
    health, model = monitored("drift", "drift")
    assert (model["proposed"], health.lines[0].answer) == (False, "undecided")
    assert "The sensors first" in model["words"]

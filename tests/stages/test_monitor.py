"""The stages that simulate a fleet and monitor it, and what they refuse."""

from __future__ import annotations

import json
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest
import yaml

from cylinder_friction.commands.params import compose_params
from cylinder_friction.params.checking import Params, ParamsError, check_params
from cylinder_friction.rig.lives import FATES
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages import fleet, monitor
from cylinder_friction.stages.monitor import HEALTH_FOLDER
from pipeline_workspace import run

CONF = Path(__file__).parents[2] / "conf"
SHORT = ("fleet.simulated.sessions=1", "fleet.simulated.begins=1", "fleet.simulated.takes=1")


@pytest.fixture(scope="module")
def params() -> Params:
    return check_params(compose_params(CONF, ["experiment=fleet", *SHORT]), "conf")


@pytest.fixture(scope="module")
def monitored(params: Params, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunRecord, RunRecord]:
    """A folder in which both stages ran, and their records."""
    folder = tmp_path_factory.mktemp("fleet")
    with chdir(folder):
        return folder, fleet.run(params), monitor.run(params)


def test_a_cylinder_per_fate_is_simulated_and_monitored(monitored: tuple[Path, RunRecord, RunRecord]) -> None:
    folder, simulated, nightly = monitored
    assert sorted(path.name for path in (folder / "data/raw/fleet/logs").iterdir()) == sorted(FATES)
    assert simulated.metrics == {"cylinders": len(FATES), "sessions": len(FATES)}
    assert nightly.metrics["answers/not_yet"] == nightly.metrics["sessions"] == len(FATES)
    assert sorted(nightly.tables["answers"]["cylinder"]) == sorted(FATES)
    assert set(nightly.artifacts) == {f"reports/health/{name}" for name in ("health.html", "health.json", "panes")}
    assert json.loads((folder / HEALTH_FOLDER / "health.json").read_text())["refused"] == []


def test_a_second_run_gives_an_equal_record(params: Params, monitored: tuple[Path, RunRecord, RunRecord]) -> None:
    folder, _, nightly = monitored
    with chdir(folder):
        assert monitor.run(params).key() == nightly.key()


def test_a_registered_model_is_refused(params: Params, monitored: tuple[Path, RunRecord, RunRecord]) -> None:
    path = monitored[0] / "data/raw/fleet/fleet.yaml"
    before = path.read_text()
    content = yaml.safe_load(before)
    content["defaults"]["model"] = "models:/friction-estimator@champion"
    path.write_text(yaml.safe_dump(content))
    with (
        chdir(monitored[0]),
        pytest.raises(ParamsError, match=r"drift has the model models:/.*, expected a folder; a"),
    ):
        monitor.run(params)
    path.write_text(before)


@pytest.mark.parametrize(("stage", "words"), [(fleet, "names no simulated fleet"), (monitor, "names no fleet")])
def test_without_a_fleet_the_recipe_is_named(stage: Any, words: str) -> None:
    with pytest.raises(ParamsError, match=f"{words}; compose the parameters with .*experiment=fleet"):
        stage.run(check_params(compose_params(CONF), "conf"))


@pytest.mark.extended
def test_dvc_has_the_stages_in_a_made_project_only_with_the_recipe(tmp_path: Path) -> None:
    run(tmp_path, "cylinder-friction", "init", "project")
    project = tmp_path / "project"
    assert "@" not in run(project, "dvc", "stage", "list").stdout
    run(project, "cylinder-friction", "params", "experiment=fleet", *SHORT)
    done = run(project, "dvc", "repro", "monitor@fleet").stdout
    assert [done.count(f"Running stage '{name}'") for name in ("code", "fleet@simulated", "monitor@fleet")] == [1, 1, 1]
    assert (project / "reports/health/health.html").is_file()
    assert "2 already there" in run(project, "cylinder-friction", "track").stdout
    run(project, "cylinder-friction", "params")
    assert "@" not in run(project, "dvc", "stage", "list").stdout

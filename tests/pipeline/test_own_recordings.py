"""Own recordings in the pipeline, in a clone and in a project of ``init``, by their guide's commands."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from cylinder_friction.params.checking import load_params
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from pipeline_workspace import PROJECT, environment, new_repository, run, run_here

GUIDE = (PROJECT / "docs/own-recordings.md").read_text(encoding="utf-8")
BLOCKS: list[str] = re.findall(r"```bash\n(.*?)```", GUIDE, re.DOTALL)
COMMANDS = [line for block in BLOCKS for line in block.splitlines()]
SESSIONS = {
    "condition1_session01": "no-load_2026-03-14_monday",
    "condition1_session02": "no-load_2026-03-15_tuesday",
    "condition1_session03": "no-load_2026-03-18_friday",
}
"""Sessions of the simulated rig, and the folders that the guide asks for."""
RECIPES = sorted(path.stem for path in (PROJECT / "conf/experiment").glob("*.yaml"))
SMALL = (
    *("search.trials=1", "search.startup_trials=1", "search.finalists=1", "search.final_epochs=1"),
    *("search.space.layers=[1]", "search.space.nodes=[8]", "search.training.epochs=1"),
    *("search.space.forest_trees=[4,8]", "search.space.forest_depth=[4,6]", "train.training.epochs=2"),
    *("baselines.hybrid.layers=1", "baselines.hybrid.nodes=8", "baselines.hybrid.forest_trees=4"),
    *("baselines.training.epochs=1", "lugre.population=4", "lugre.generations=2", "compare.timing_repeats=5"),
)
"""Overrides that make every search short."""


def typed(beginning: str) -> str:
    """Find the guide's command that begins so."""
    (command,) = (each for each in COMMANDS if each.startswith(beginning))
    return command


def with_own_recordings(folder: Path) -> Path:
    """Follow the guide's steps 1 to 3 in a project: logs, cylinder and mapping."""
    described = (folder / "conf/cylinder/bosch_h160ca_63x28.yaml").read_text(encoding="utf-8")
    own = re.sub("(?m)^name: .*", "name: Press 63x28", described)
    (folder / "conf/cylinder/press.yaml").write_text(own, encoding="utf-8")
    plan = CampaignPlan(sessions_per_condition=3, recordings_per_session=1, duration_s=16.0)
    for recording in campaign(load_params(folder / "params.yaml").cylinder, plan):
        if recording.metadata.session not in SESSIONS:
            break
        log = folder / "data/raw/own" / SESSIONS[recording.metadata.session] / "stroke_01.csv"
        log.parent.mkdir(parents=True)
        recording.logger.to_csv(log, index=False, float_format="%.4f")
    run_here(folder, *typed("cylinder-friction ingest init").split())
    return folder


def made_by_init(folder: Path) -> Path:
    run_here(folder.parent, "cylinder-friction", "init", str(folder))
    return folder


@pytest.fixture(scope="module", params=[new_repository, made_by_init], ids=["clone", "project"])
def project(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    make: Callable[[Path], Path] = request.param
    return with_own_recordings(make(tmp_path_factory.mktemp("own") / "project"))


@pytest.mark.parametrize("recipe", [*RECIPES, "own ingest=press cylinder=press lugre.condition=no-load"])
def test_dvc_knows_what_to_run_for_every_recipe_and_for_a_fresh_mapping(project: Path, recipe: str) -> None:
    run_here(project, "cylinder-friction", "params", *f"experiment={recipe}".split())
    status = run(project, "dvc", "status").stdout
    named = re.findall(r"^(\w+):", status, re.MULTILINE)
    assert {"ingest", "label", "compare", "register"} <= {*named}


def test_a_fresh_mapping_has_the_layout_of_the_guide_and_what_dvc_needs(project: Path) -> None:
    run_here(project, *typed("cylinder-friction params").split())
    stages = (project / "dvc.yaml").read_text(encoding="utf-8")
    ingest = yaml.safe_load((project / "params.yaml").read_text(encoding="utf-8"))["ingest"]
    inserted = {key: ingest[key] for key in re.findall(r"\$\{ingest\.(\w+)\}", stages)}
    assert inserted == {"source": "data/raw/own", "truth": "data/raw/rig_truth"}
    stated = yaml.safe_load(re.findall(r"```yaml\n(source.*?)```", GUIDE, re.DOTALL)[0])
    assert {key: ingest[key] for key in stated} == stated


@pytest.mark.extended
@pytest.mark.parametrize("project", [made_by_init], ids=["project"], indirect=True)
def test_the_guide_leads_from_own_logs_to_a_served_champion_without_true_friction(project: Path) -> None:
    (held_out,) = re.findall(r"`(split\.held_out=\S+)`", GUIDE)
    assert "3 files: 3 ok" in run_here(project, *typed("cylinder-friction inspect").split()).stdout
    run_here(project, *typed("cylinder-friction params").split(), held_out, *SMALL)
    run_here(project, *typed("cylinder-friction check").split())
    run(project, *typed("dvc repro").split())
    assert [path.name for path in (project / "data/raw/rig_truth").iterdir()] == ["README.txt"]
    tested = [path.stem for path in (project / "data/processed/test").glob("*.parquet")]
    assert [name for name in tested if "monday" in name] == tested != []
    metrics = json.loads((project / "reports/metrics.json").read_text(encoding="utf-8"))
    (numbers,) = metrics["hybrid"].values()
    assert 0.0 < numbers["label_percent"] < 200.0
    assert "truth_percent" not in numbers
    table = "\n".join(line for line in GUIDE.splitlines() if line.startswith("|"))
    for path in re.findall(r"`((?:data|models|reports)/[^`]*)`", table):
        assert (project / path).exists(), path
    people, facts = ("AUTHOR", "COMMITTER"), ("NAME", "EMAIL")
    who = {f"GIT_{role}_{what}": "t@localhost" for role in people for what in facts}
    for command in COMMANDS[COMMANDS.index(typed("dvc add")) :]:
        run(project, "bash", "-euc", command, given=who)
    row = _served_row(project)
    assert row["lower_n"] < row["friction_n"] < row["upper_n"]


def _served_row(project: Path) -> dict[str, float]:
    """Serve the champion as a user does, paste the printed curl, and return the last row."""
    command = ["cylinder-friction", "serve", "--port", "0"]
    with subprocess.Popen(
        command, cwd=project, env=environment(), stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        try:
            printed = ""
            while "| tail" not in printed:
                line = process.stdout.readline()
                assert line or process.poll() is None, printed
                printed += line
            curl = ["bash", "-c", printed[printed.index("curl") :]]
            answer = subprocess.run(curl, capture_output=True, text=True, check=True, timeout=120)
        finally:
            os.killpg(process.pid, signal.SIGTERM)
    row: dict[str, float] = json.loads(answer.stdout)
    return row

"""Run every command in the README, and some that the guides begin with. A README command that nobody runs fails."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import psutil
import pytest

from pipeline_workspace import MAKE, PROJECT, copy_of, environment, run, run_here

RUN_IN_A_FINISHED_PIPELINE = {
    "make readme": "README.md now shows the recipe 'smoke', not the default",
    "cylinder-friction estimate data/raw/rig/condition1_session01_recording01.csv --channels conf/ingest/rig.yaml": (
        "friction/friction.html"
    ),
    "cylinder-friction ingest init data/raw/rig/condition1_session01_recording01.csv": 'channel: "P1 [bar]", unit: bar',
    "cylinder-friction inspect data/raw/rig/condition1_session01_recording01.csv": "1 file: 1 ok",
    'make params ARGS="experiment=smoke"': "",
    'make params ARGS="experiment=paper"': "",
    'make params ARGS="search.trials=30 train.training.epochs=40"': "",
    "make params": "",
    'make params ARGS="experiment=own"': "",
    "cylinder-friction export c models/hybrid --output press": "press/friction.h",
    "cylinder-friction export fmu models/hybrid --output press.fmu": "press.fmu",
    "dvc metrics diff": "",
    "dvc plots diff HEAD": "index.html",
    "cylinder-friction track": "0 runs logged",
    "cylinder-friction promote 1": "friction-estimator-smoke version 1 is the champion already",
    "cylinder-friction lineage": "links hold",
}
RUN_ELSEWHERE = {
    "make reproduce": "tests/pipeline/conftest.py",
    "make ui": "test_the_servers_answer",
    "make serve": "test_the_servers_answer",
    "dvc exp run -S experiment=smoke -S register.tolerance_percent=0.2": "test_an_experiment_composes",
}


def commands_of_the_readme() -> list[str]:
    blocks = re.findall(r"```bash\n(.*?)```", (PROJECT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.strip()]


def test_every_command_is_run_by_a_test() -> None:
    assert commands_of_the_readme()
    assert set(commands_of_the_readme()) <= set(RUN_IN_A_FINISHED_PIPELINE) | set(RUN_ELSEWHERE)


@pytest.mark.parametrize("command", sorted(RUN_IN_A_FINISHED_PIPELINE))
def test_it_works_in_a_finished_pipeline(finished_pipeline: Path, tmp_path: Path, command: str) -> None:
    words = shlex.split(command)
    if words[0] == "cylinder-friction":
        done = run_here(finished_pipeline, *words)
    else:
        done = run(copy_of(finished_pipeline, tmp_path), *(MAKE if words[0] == "make" else words[:1]), *words[1:])
    assert RUN_IN_A_FINISHED_PIPELINE[command] in done.stdout


@pytest.mark.extended
@pytest.mark.parametrize(("target", "sign"), [("ui", "http://"), ("serve", "curl"), ("live", "history")])
def test_the_servers_answer(finished_pipeline: Path, target: str, sign: str) -> None:
    if target == "live":  # which must not install this copy, gone soon, into the environment of the tests
        if not (Path(sys.prefix) / ".installed-live").is_file():
            pytest.skip("the live service is not installed; `make install-dev` installs it")
        os.utime(finished_pipeline / "live/pyproject.toml", (0.0, 0.0))
    process = subprocess.Popen(
        [*MAKE, target, *(["ARGS=--port 0"] if target != "ui" else [])],
        cwd=finished_pipeline,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        printed = ""
        deadline = time.monotonic() + 300.0
        while sign not in printed:
            assert time.monotonic() < deadline, printed
            line = process.stdout.readline()
            assert line or process.poll() is None, printed
            printed += line
        if target == "ui":
            commands = [" ".join(one.cmdline()) for one in psutil.Process(process.pid).children(recursive=True)]
            assert any("uvicorn" in command for command in commands)
            assert not [command for command in commands if "mlflow.server.jobs" in command]
        if target == "serve":
            while "| tail" not in printed:
                printed += process.stdout.readline()
            curl = printed[printed.index("curl") :]
            answer = subprocess.run(["bash", "-c", curl], capture_output=True, text=True, check=True, timeout=120)
            assert '"friction_n"' in answer.stdout
            assert "WARMING" not in answer.stdout
        if target == "live":
            address = printed.split("live at ")[1].split()[0]
            while not json.load(urllib.request.urlopen(f"{address}/readyz"))["sessions"]:
                assert time.monotonic() < deadline, "no session of the replay"
                time.sleep(0.1)
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(timeout=60)
        if process.stdout is not None:
            process.stdout.close()


@pytest.mark.extended
def test_an_experiment_composes(finished_pipeline: Path, tmp_path: Path) -> None:
    folder = copy_of(finished_pipeline, tmp_path)
    done = run(folder, "dvc", "exp", "run", "-S", "experiment=smoke", "-S", "register.tolerance_percent=0.2")
    assert "Running stage 'register'" in done.stdout
    assert "Running stage 'compare'" not in done.stdout
    assert "tolerance_percent: 0.2" in (folder / "params.yaml").read_text()

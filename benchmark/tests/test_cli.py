"""The command line of the benchmark."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from cylinder_friction.commands.cli import UNREAD
from friction_benchmark.cli import main

if TYPE_CHECKING:
    from pathlib import Path


def test_a_reader_that_has_ended_ends_the_command_without_a_traceback() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = (sys.executable, "-m", "friction_benchmark.cli", "--help")
    given = {**os.environ, "PYTHONUNBUFFERED": ""}
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, env=given)
    os.close(writing)
    assert (done.returncode, done.stderr) == (UNREAD, "")


@pytest.mark.parametrize("command", ["run", "inputs", "track", "summary", "params"])
def test_it_needs_a_checkout(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([command]) == 1
    assert capsys.readouterr().err == (
        f"friction-benchmark {command}: benchmark/conf: no such folder here; run this in a checkout of "
        "cylinder-friction\n"
    )

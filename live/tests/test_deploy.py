"""The unit of systemd starts with words that the command takes, and systemd finds it hardened."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import parser

ROOT = Path(__file__).parents[2]
(UNIT,) = (ROOT / "live/deploy/systemd").glob("*.service")


def test_the_unit_starts_with_words_that_its_program_takes() -> None:
    (line,) = re.findall(r"^ExecStart=/opt/cylinder-friction/bin/(.*)$", UNIT.read_text("utf-8"), re.MULTILINE)
    program, *words = shlex.split(
        line.replace(" $OPTIONS", "").replace("${MODEL}", "models/hybrid").replace("%i", "5002")
    )
    assert program == "cylinder-friction"
    assert parser("live").parse_args(words).port == 5002


def test_systemd_takes_the_unit_and_finds_it_hardened(tmp_path: Path) -> None:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("systemd-analyze is not installed")
    shutil.copytree(ROOT / "deploy/systemd", tmp_path, dirs_exist_ok=True)  # hardening that all units share
    programs = str(Path(sys.executable).parent)
    path = tmp_path / UNIT.name
    path.write_text(UNIT.read_text("utf-8").replace("/opt/cylinder-friction/bin", programs))
    verified = subprocess.run([analyze, "verify", "--man=no", str(path)], capture_output=True, text=True)
    assert (verified.returncode, verified.stderr) == (0, "")
    rated = subprocess.run([analyze, "security", "--offline=true", "--threshold=20", str(path)], capture_output=True)
    assert rated.returncode == 0, rated.stdout.decode()

"""What is installed is in the lock files; the unit of systemd starts with words that the command takes, hardened."""

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import parser

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "live/pyproject.toml").read_text("utf-8"))["project"]
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


@pytest.mark.parametrize(
    ("wanted", "locks"),
    [
        (PROJECT["dependencies"], ("requirements.lock",)),
        (PROJECT["optional-dependencies"]["opcua"], ("requirements.lock", "requirements-dev.lock")),
    ],
)
def test_make_installs_what_it_needs(wanted: list[str], locks: tuple[str, ...]) -> None:
    names = {re.split(r"[><=\[]", line)[0] for line in wanted} - {"cylinder-friction"}
    locked = "".join((ROOT / lock).read_text("utf-8") for lock in locks)
    assert names - {line.split("==")[0].replace("_", "-") for line in locked.splitlines()} == set()

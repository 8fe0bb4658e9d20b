"""What the service needs is in the lock files, which `make live` and `make test-live` install."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "live/pyproject.toml").read_text("utf-8"))["project"]


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

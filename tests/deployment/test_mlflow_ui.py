"""The MLflow UI as a process: it is ended with whoever started it, at the worst moments too."""

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from cylinder_friction.deployment.mlflow_ui import served_ui
from cylinder_friction.tracking.repository import TrackingError

pytestmark = pytest.mark.extended


def comes_true(condition: Callable[[], bool], within_s: float) -> bool:
    """Wait until a condition holds; false where it does not in time."""
    deadline = time.monotonic() + within_s
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


def runs(pattern: str, at_least: int = 1) -> bool:
    """Return whether so many processes have a command line that matches."""
    found = subprocess.run(["pgrep", "-f", "--", pattern], capture_output=True, text=True, check=False)
    return len(found.stdout.split()) >= at_least


def test_a_polite_kill_while_it_starts_leaves_no_server_behind(
    champion_root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    folder = champion_root / ".cylinder-friction"
    of_others = set(folder.glob("server-*.log"))
    code = "import pathlib; from cylinder_friction.deployment.mlflow_ui import run_ui as run; "
    code += "run(pathlib.Path())"
    served = subprocess.Popen([sys.executable, "-c", code], cwd=champion_root, stderr=subprocess.DEVNULL)
    assert comes_true(lambda: bool(set(folder.glob("server-*.log")) - of_others), 120.0), "MLflow was not started"
    (log,) = set(folder.glob("server-*.log")) - of_others
    server = f"127.0.0.1 --port {log.stem.removeprefix('server-')}"
    assert comes_true(lambda: runs(server), 120.0), "the server was not started"
    served.terminate()
    assert served.wait(60.0) != 0
    assert comes_true(lambda: not runs(server), 120.0), "the server still runs"
    log.unlink()


def test_a_port_that_is_taken_is_named(champion_root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with (
            pytest.raises(TrackingError, match=rf"port {port}: .*in use; name another one with --port"),
            served_ui(champion_root, port),
        ):
            pass

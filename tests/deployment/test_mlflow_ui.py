"""The MLflow UI as a process: it is ended with whoever started it, at the worst moments too."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from cylinder_friction.deployment.mlflow_ui import served_ui
from cylinder_friction.tracking.repository import TrackingError
from team_servers import comes_true

pytestmark = pytest.mark.extended


def runs(pattern: str) -> bool:
    """Return whether a process has a command line that matches."""
    return subprocess.run(["pgrep", "-f", "--", pattern], capture_output=True, check=False).returncode == 0


def test_a_polite_kill_while_it_starts_leaves_no_server_behind(
    champion_root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    folder = champion_root / ".cylinder-friction"
    of_others = set(folder.glob("server-*.log"))
    code = "import pathlib; from cylinder_friction.deployment.mlflow_ui import run_ui; run_ui(pathlib.Path())"
    served = subprocess.Popen([sys.executable, "-c", code], cwd=champion_root, stderr=subprocess.DEVNULL)
    assert comes_true(lambda: bool(set(folder.glob("server-*.log")) - of_others)), "MLflow was not started"
    (log,) = set(folder.glob("server-*.log")) - of_others
    server = f"127.0.0.1 --port {log.stem.removeprefix('server-')}"
    assert comes_true(lambda: runs(server)), "the server was not started"
    served.terminate()
    assert served.wait(60.0) != 0
    assert comes_true(lambda: not runs(server)), "the server still runs"
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

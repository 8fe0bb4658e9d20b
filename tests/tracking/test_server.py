"""Everything over HTTP: a tracking server of one's own in place of the repository's SQLite."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from typing import TYPE_CHECKING

import pytest

from candidates import registered_in
from cylinder_friction.deployment.serve import free_port
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.replay import replay

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.slow


@pytest.fixture
def server(pipeline: Path, tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A server that keeps runs and artifacts to itself, as one on another machine does."""
    port = free_port()
    where = tmp_path / "server"
    where.mkdir()
    (where / "mlflow.db").write_bytes(empty_store.read_bytes())
    arguments = ["--backend-store-uri", f"sqlite:///{where}/mlflow.db", "--artifacts-destination", str(where / "files")]
    command = [sys.executable, "-m", "mlflow", "server", *arguments, "--port", str(port), "--workers", "1"]
    url = f"http://127.0.0.1:{port}"
    with (where / "log").open("wb") as log:
        environment = {**os.environ, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)
        try:
            _wait(url, process)
            monkeypatch.setenv("MLFLOW_TRACKING_URI", url)
            yield url
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _wait(url: str, process: subprocess.Popen[bytes]) -> None:
    for _ in range(300):
        assert process.poll() is None, "the server ended"
        try:
            with urllib.request.urlopen(f"{url}/health", timeout=1.0):
                return
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    raise AssertionError("the server does not answer")


def test_runs_registry_and_lineage_work_over_http(server: str, pipeline: Path) -> None:
    assert replay(pipeline).logged == ("record", "search", "train", "compare")
    assert replay(pipeline).present == ("record", "search", "train", "compare")
    first = registered_in(pipeline)
    assert first.promote
    assert registered_in(pipeline) == first
    found = lineage("models:/friction-estimator@champion", pipeline)
    assert found.holds, found.text()
    assert not (pipeline / "mlartifacts").exists(), "nothing goes to the local store"
    assert os.environ["MLFLOW_TRACKING_URI"] == server, "the environment is as it was"

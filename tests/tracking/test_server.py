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

from cylinder_friction.deployment.serve import free_port
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.registry import register
from cylinder_friction.tracking.replay import replay
from cylinder_friction.tracking.versions import origin_of

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
    candidate = Candidate(
        "friction-estimator",
        "models/hybrid",
        hash_of(pipeline / "models/hybrid"),
        {"1": 2.0},
        "md5",
        origin_of(pipeline, "data/raw/rig", ["data/processed/train", "data/processed/test"]),
        {"pressure_1_pa": [1e6, 1e6], "pressure_2_pa": [9e5, 9e5], "position_m": [0.1, 0.1]},
    )
    assert replay(pipeline).logged == ("record", "search", "train", "compare")
    assert replay(pipeline).present == ("record", "search", "train", "compare")
    first = register(candidate, pipeline, 0.1, lambda folder: {})
    assert first.promote
    assert register(candidate, pipeline, 0.1, lambda folder: {}) == first
    found = lineage("models:/friction-estimator@champion", pipeline)
    assert found.holds, found.text()
    assert not (pipeline / "mlartifacts").exists(), "nothing goes to the local store"
    assert os.environ["MLFLOW_TRACKING_URI"] == server, "the environment is as it was"

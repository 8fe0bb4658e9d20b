"""The registered model behind a real ``mlflow models serve``: right answers, and a clear 4xx for everything else."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.store import tracking_uri

CHAMPION = "models:/friction-estimator@champion"


@pytest.fixture(scope="module")
def url(champion_root: Path) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        patch.setenv("MLFLOW_TRACKING_URI", tracking_uri(champion_root))
        port = free_port()
        command = ["models", "serve", "-m", CHAMPION, "--env-manager", "local", "-p", str(port)]
        with subprocess.Popen([sys.executable, "-m", "mlflow", *command], start_new_session=True) as server:
            try:
                yield ready(f"http://127.0.0.1:{port}", server)
            finally:
                os.killpg(server.pid, signal.SIGTERM)


def ready(url: str, server: subprocess.Popen[bytes]) -> str:
    deadline = time.monotonic() + 300.0
    while server.poll() is None and time.monotonic() < deadline:
        try:
            urllib.request.urlopen(f"{url}/ping", timeout=5.0).close()
        except OSError:
            time.sleep(0.2)
        else:
            return url
    raise AssertionError("the server did not start")


def ask(url: str, body: Any) -> tuple[int, Any]:
    data = json.dumps(body).encode()
    request = urllib.request.Request(f"{url}/invocations", data, {"Content-Type": "application/json"})
    try:
        with urllib.request.urlopen(request, timeout=120.0) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_a_recording_is_answered_row_by_row_and_what_is_no_request_refused(
    url: str, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    body = {"dataframe_split": {"columns": list(SAMPLE_COLUMNS), "data": recording.samples().tolist()}}
    status, answer = ask(url, body)
    assert status == 200
    rows = answer["predictions"]
    newtons, flags = small_hybrid.real_time().run(recording.samples())
    columns = [[row[name] for row in rows] for name in ("friction_n", "lower_n", "upper_n")]
    np.testing.assert_allclose(np.transpose(columns), newtons, rtol=0.0, atol=1e-3)
    np.testing.assert_array_equal([row["flags"] for row in rows], flags)
    assert all(row["in_training_range"] is True for row in rows)
    cut_off = {"columns": list(SAMPLE_COLUMNS), "data": [[1.0, 2.0]]}
    for wrong in ({"dataframe_records": []}, {"dataframe_split": cut_off}, {"inputs": {}}, {}, [], None):
        status, answer = ask(url, wrong)
        assert 400 <= status < 500, (wrong, answer)

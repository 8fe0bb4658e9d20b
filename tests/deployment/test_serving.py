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
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.store import tracking_uri

CHAMPION = "models:/friction-estimator@champion"
GOOD = {"pressure_1_pa": 1.2e6, "pressure_2_pa": 9.1e5, "position_m": 0.12}
JSON = "application/json"


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


def ask(url: str, body: Any, content_type: str = JSON) -> tuple[int, Any]:
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(f"{url}/invocations", data, {"Content-Type": content_type})
    try:
        with urllib.request.urlopen(request, timeout=120.0) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def records(*rows: dict[str, Any]) -> dict[str, Any]:
    return {"dataframe_records": list(rows)}


def test_a_recording_is_answered_row_by_row(
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


@pytest.mark.parametrize(
    "body",
    [
        records(GOOD),
        {"dataframe_split": {"columns": list(GOOD), "data": [list(GOOD.values())]}},
        {"inputs": {name: [value] for name, value in GOOD.items()}},
        {"instances": [GOOD]},
        records({**GOOD, "recording": "one"}, {**GOOD, "recording": "two"}),
        records({**GOOD, "recording": 1}, {**GOOD, "recording": 2}),
        records({"pressure_1_pa": 1200000, "pressure_2_pa": 910000, "position_m": 0.12}),
    ],
)
def test_every_form_of_a_good_request_is_answered_alike(url: str, body: dict[str, Any]) -> None:
    status, answer = ask(url, body)
    assert status == 200, answer
    (first, *_), (expected,) = answer["predictions"], ask(url, records(GOOD))[1]["predictions"]
    assert first == expected
    assert np.isfinite(first["friction_n"])


def test_csv_is_taken_too(url: str) -> None:
    text = "pressure_1_pa,pressure_2_pa,position_m\n1.2e6,9.1e5,0.12\n"
    status, answer = ask(url, text.encode(), "text/csv")
    assert status == 200, answer
    assert answer["predictions"] == ask(url, records(GOOD))[1]["predictions"]


def test_out_of_range_is_flagged(url: str) -> None:
    status, answer = ask(url, records({**GOOD, "pressure_1_pa": 3e8}))
    assert status == 200
    assert answer["predictions"][0]["in_training_range"] is False
    assert answer["predictions"][0]["flags"] == Flag.NOT_READY | Flag.INVALID_PRESSURE_1


REFUSED: list[tuple[Any, str]] = [
    (records(), "is missing"),
    (records({**GOOD, "position_m": [0.1]}), "position_m"),
    (records({**GOOD, "recording": ["a"]}), "recording"),
    ({"dataframe_split": {"columns": list(GOOD), "data": [[1.0, 2.0]]}}, ""),
    ({"dataframe_records": None}, ""),
    ({"dataframe_records": [1, 2, 3]}, "pressure_1_pa"),
    ({"inputs": {}}, ""),
    ({}, "exactly one of the input fields"),
    ([], "Received a list"),
    (b"\xff\xfe", "valid JSON"),
    (b"null", ""),
]
"""Bodies that the guide's table does not have, with what the refusal says."""


def test_everything_else_is_refused_and_never_a_server_error(url: str) -> None:
    for body, said in REFUSED:
        status, answer = ask(url, body)
        assert 400 <= status < 500, (body, answer)
        assert said in answer


@pytest.mark.parametrize(("content_type", "status"), [("text/plain", 415), ("application/json; charset=latin-1", 415)])
def test_another_content_type_is_refused(url: str, content_type: str, status: int) -> None:
    assert ask(url, records(GOOD), content_type)[0] == status


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "pressure_1_pa,pressure_2_pa,position_m\nhigh,1,2\n"])
def test_a_bad_csv_is_refused(url: str, text: str) -> None:
    assert ask(url, text.encode(), "text/csv")[0] == 400

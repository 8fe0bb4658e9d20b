"""The served model over HTTP: what every form of a request gives, limits, IDs, tokens, and what the routes show."""

import hashlib
import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.service.scoring.app import Service
from cylinder_friction.service.scoring.decoding import CSV

Serve = Callable[..., AbstractContextManager[Any]]

OUTPUTS = ["friction_n", "lower_n", "upper_n", "flags", "flag_names", "in_training_range"]
GOOD = {"dataframe_split": {"columns": list(SAMPLE_COLUMNS), "data": [[1.2e6, 9.1e5, 0.12]]}}


@pytest.fixture(scope="module")
def rows(labelled_recordings: list[Recording]) -> np.ndarray:
    return labelled_recordings[0].samples()[:700]


def split(rows: np.ndarray) -> dict[str, Any]:
    return {"dataframe_split": {"columns": list(SAMPLE_COLUMNS), "data": rows.tolist()}}


def test_rows_are_scored_as_in_every_runtime(server: Any, small_model: StepModel, rows: np.ndarray) -> None:
    reply = server.ask(split(rows))
    assert reply.status == 200, reply.body
    expected, flags = RealTimeStream(small_model).run(rows)
    predictions = reply.json()["predictions"]
    assert list(predictions[0]) == OUTPUTS
    newtons = np.array([[row[name] for name in OUTPUTS[:3]] for row in predictions])
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=1e-3)
    assert [row["flags"] for row in predictions] == flags.tolist()
    assert all(row["in_training_range"] is True for row in predictions)


def test_a_reply_that_is_not_to_be_used_as_it_is_has_a_header_that_says_why(server: Any) -> None:
    seconds = 0.005 * np.arange(1200)
    unlike = np.column_stack([np.full(1200, 2.4e6), np.full(1200, 2.4e6), 0.125 + 0.03 * np.sin(seconds)])
    reply = server.ask(split(unlike))
    assert reply.status == 200
    assert reply.headers["x-not-to-be-used"] == "100 % of the rows hold a force that this model does not know"
    assert "x-not-to-be-used" not in server.ask(GOOD).headers


def test_a_body_that_is_too_large_is_refused_before_it_is_there(serve: Serve) -> None:
    with serve(max_body_bytes=100, timeout_s=20.0) as server:
        began = time.monotonic()
        head = b"POST /invocations HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked"
        assert server.send(head + b"\r\n\r\n80\r\n" + b"1" * 128 + b"\r\n").status == 413
        assert time.monotonic() - began < 10.0


def test_a_body_that_does_not_arrive_is_not_waited_for(serve: Serve) -> None:
    with serve(timeout_s=0.2) as server:
        reply = server.send(
            b"POST /invocations HTTP/1.1\r\nHost: x\r\nContent-Type: text/csv\r\nContent-Length: 9\r\n\r\na"
        )
        assert (reply.status, reply.message) == (408, "the body did not arrive within 0.2 s")
        assert reply.headers["connection"] == "close"


def test_requests_beyond_the_limit_are_put_off_and_slow_ones_end(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    held, scored = threading.Event(), Service._work
    monkeypatch.setattr(Service, "_work", lambda *given: (held.wait(20.0), scored(*given))[1])
    text = b"pressure_1_pa,pressure_2_pa,position_m\n1.2e6,9.1e5,0.12\n"
    with serve(max_concurrent=2, timeout_s=1.0) as server, ThreadPoolExecutor(2) as pool:
        slow = [pool.submit(server.ask, text, CSV) for _ in range(2)]
        while b"active_requests 2.0" not in server.get("/metrics").body:
            time.sleep(0.01)
        reply = server.ask(GOOD)
        assert (reply.status, reply.headers["retry-after"]) == (429, "1")
        assert reply.message == "2 requests are being served; try again later"
        assert server.get("/livez").status == 200, "what asks how it is still gets a response"
        assert [each.result().status for each in slow] == [503, 503]
        held.set()
        assert server.ask(GOOD).status == 200


def test_bodies_that_arrive_slowly_take_no_place_of_those_that_are_scored(serve: Serve) -> None:
    begun = b"POST /invocations HTTP/1.1\r\nHost: x\r\nContent-Type: text/csv\r\nContent-Length: 900\r\n\r\np"
    with serve(max_concurrent=1, timeout_s=120.0) as server, ExitStack() as slow:
        for _ in range(20):
            slow.enter_context(socket.create_connection(("127.0.0.1", server.port))).sendall(begun)
        assert server.ask(GOOD).status == 200


@pytest.mark.parametrize(
    ("given", "kept"),
    [("order-17.b_2", True), ("x" * 64, True), ("x" * 65, False), ("a b", False), ("<script>", False), ("", False)],
)
def test_a_request_has_an_id_in_the_header_and_in_errors(server: Any, given: str, kept: bool) -> None:
    for body, status in ((GOOD, 200), ({}, 400)):
        reply = server.ask(body, headers={"X-Request-ID": given})
        assert reply.status == status
        found = reply.headers["x-request-id"]
        assert (found == given) == kept
        assert 1 <= len(found) <= 64
        if status == 400:
            assert reply.json()["request_id"] == found
    assert server.ask(GOOD).headers["x-request-id"] != server.ask(GOOD).headers["x-request-id"]


def test_a_failure_of_the_server_shows_nothing_of_it(
    server: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("secret of /srv/models")

    def grow(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr("cylinder_friction.service.scoring.app.score_columns", fail)
    reply = server.ask(GOOD, headers={"X-Request-ID": "broken-1"})
    assert (reply.status, reply.message) == (500, "the server failed; its log has why")
    assert "secret" not in reply.body.decode()
    assert "request broken-1 failed" in caplog.text
    assert "secret of /srv/models" in caplog.text
    monkeypatch.setattr("cylinder_friction.service.scoring.app.score_columns", grow)
    reply = server.ask(GOOD)
    assert (reply.status, reply.message) == (503, "the request needs more memory than there is; send fewer rows")


def test_tokens_are_needed_where_there_are_some(serve: Serve, tmp_path: Path) -> None:
    tokens = tmp_path / "tokens"
    tokens.write_text(f"# who may\n{hashlib.sha256(b'abc').hexdigest()}  line 3\n")
    with serve(tokens=tokens) as server:
        for authorization in ("", "Bearer", "Bearer abd", "Basic abc", "abc", "Bearer abc abc"):
            reply = server.ask(GOOD, headers={"Authorization": authorization})
            assert (reply.status, reply.headers["www-authenticate"]) == (401, "Bearer")
            assert server.get("/metrics", {"Authorization": authorization}).status == 401
        assert server.ask(GOOD, headers={"Authorization": "Bearer abc"}).status == 200
        assert server.get("/livez").status == server.get("/readyz").status == 200
        tokens.write_text(hashlib.sha256(b"other").hexdigest())
        deadline = time.monotonic() + 60.0
        while server.ask(GOOD, headers={"Authorization": "Bearer other"}).status != 200:
            assert time.monotonic() < deadline, "the tokens were not read again"
            time.sleep(0.05)
        assert server.ask(GOOD, headers={"Authorization": "Bearer abc"}).status == 401


def test_routes_show_how_the_server_is(server: Any) -> None:
    for path in ("/livez", "/ping", "/health"):
        assert (server.get(path).status, server.get(path).body) == (200, b"\n")
    assert server.get("/invocations").status == 405
    assert server.get("/version").body.startswith(b"3.")
    ready = server.get("/readyz").json()
    assert (ready["ready"], ready["model"], ready["version"]) == (True, "friction-estimator", "7")


def test_metrics_count_requests_rows_and_flags(serve: Serve, rows: np.ndarray) -> None:
    with serve() as server:
        server.ask(split(rows))
        server.ask({})
        server.get("/nowhere")
        text = server.get("/metrics").body.decode()
    for line in (
        'cylinder_friction_requests_total{route="/invocations",status="200"} 1.0',
        'cylinder_friction_requests_total{route="/invocations",status="400"} 1.0',
        'cylinder_friction_requests_total{route="other",status="404"} 1.0',
        "cylinder_friction_rows_total 700.0",
        "cylinder_friction_rows_outside_training_range_total 0.0",
        'cylinder_friction_rows_flagged_total{flag="WARMING"} 600.0',
        "cylinder_friction_active_requests 0.0",
        'cylinder_friction_model{name="friction-estimator",version="7"} 1.0',
    ):
        assert f"{line}\n" in text


def test_the_access_log_has_a_line_per_request(serve: Serve, tmp_path: Path, rows: np.ndarray) -> None:
    with serve(access_log=tmp_path / "access.jsonl") as server:
        server.ask(split(rows), headers={"X-Request-ID": "one"})
        server.ask(b"[", headers={"X-Request-ID": "two"})
    one, two = map(json.loads, (tmp_path / "access.jsonl").read_text().splitlines())
    assert (one["request_id"], one["status"], one["rows"], one["model_version"]) == ("one", 200, 700, "7")
    assert (two["request_id"], two["status"], two["method"], two["path"]) == ("two", 400, "POST", "/invocations")
    assert two["bytes_in"] == 1
    assert one["client"] == "127.0.0.1"
    assert 0.0 < one["seconds"] < 10.0


def test_a_worker_needs_neither_mlflow_nor_pandas() -> None:
    """They would double its memory."""
    code = "import sys; from cylinder_friction.service.scoring import tables, worker; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"mlflow", "pandas", "torch", "numba", "scipy", "onnx"} & {*done.stdout.split()}
    assert "onnxruntime" in done.stdout.split()

"""The registered model behind a real ``mlflow models serve``: right answers, and a clear 4xx for everything else."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cylinder_friction.deployment.serve import curl, free_port, run_server, served_model
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.tracking.model_folder import example_rows
from cylinder_friction.tracking.repository import TrackingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.recordings.recording import Recording

pytestmark = pytest.mark.slow

CHAMPION = "models:/friction-estimator@champion"
GOOD = {"pressure_1_pa": 1.2e6, "pressure_2_pa": 9.1e5, "position_m": 0.12}
JSON = "application/json"


@pytest.fixture(scope="module")
def url(champion_root: Path) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        with served_model(CHAMPION, champion_root) as address:
            yield address


def ask(url: str, body: Any, content_type: str = JSON) -> tuple[int, Any]:
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(f"{url}/invocations", data, {"Content-Type": content_type})
    try:
        with urllib.request.urlopen(request, timeout=30.0) as answer:
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
        records({**GOOD, "oil_temperature_c": 40.0}),
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


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (records(), "is missing"),
        ({"dataframe_split": {"columns": list(GOOD), "data": []}}, "got no row"),
        (records({"pressure_1_pa": 1e6, "pressure_2_pa": 1e6}), "position_m"),
        (records({"pressure_1_bar": 10.0, "pressure_2_pa": 1e6, "position_m": 0.1}), "pressure_1_pa"),
        (records({**GOOD, "position_m": "far"}), "position_m"),
        (records({**GOOD, "position_m": None}), "position_m is nan at row 0"),
        (records(GOOD, {**GOOD, "pressure_2_pa": "NaN"}), "pressure_2_pa is nan at row 1"),
        (records({**GOOD, "pressure_2_pa": "Infinity"}), "pressure_2_pa is inf at row 0"),
        (
            b'{"dataframe_records": [{"pressure_1_pa": NaN, "pressure_2_pa": 1e6, "position_m": 0.1}]}',
            "pressure_1_pa is",
        ),
        (
            b'{"dataframe_records": [{"pressure_1_pa": 1e999, "pressure_2_pa": 1e6, "position_m": 0.1}]}',
            "is inf at row",
        ),
        (records({**GOOD, "load_force_n": 500.0}), "this model was trained without one"),
        (records({**GOOD, "position_m": [0.1]}), "position_m"),
        (records({**GOOD, "position_m": {"m": 0.1}}), "position_m"),
        (records({**GOOD, "recording": None}), "recording"),
        (records({**GOOD, "recording": ["a"]}), "recording"),
        (records({**GOOD, "recording": 1.5}), "recording"),
        ({"dataframe_split": {"columns": ["position_m"] * 3, "data": [[1, 2, 3]]}}, ""),
        ({"dataframe_split": {"columns": list(GOOD), "data": [[1.0, 2.0]]}}, ""),
        ({"dataframe_records": None}, ""),
        ({"dataframe_records": "rows"}, ""),
        ({"dataframe_records": [1, 2, 3]}, "pressure_1_pa"),
        ({"instances": []}, ""),
        ({"instances": [[1.2e6, 9.1e5, 0.12]]}, ""),
        ({"inputs": {}}, ""),
        ({"inputs": None}, ""),
        ({"inputs": {**{name: [value] for name, value in GOOD.items()}, "position_m": [0.1, 0.2]}}, ""),
        ({}, "exactly one of the input fields"),
        ([], "Received a list"),
        (b"{broken", "valid JSON"),
        (b"\xff\xfe", "valid JSON"),
        (b"", "valid JSON"),
        (b"null", ""),
        (records({**GOOD, "pressure_1_pa": 10**400}), ""),
    ],
)
def test_everything_else_is_refused_and_never_a_server_error(url: str, body: Any, said: str) -> None:
    status, answer = ask(url, body)
    assert 400 <= status < 500, answer
    assert said in answer


@pytest.mark.parametrize(("content_type", "status"), [("text/plain", 415), ("application/json; charset=latin-1", 415)])
def test_another_content_type_is_refused(url: str, content_type: str, status: int) -> None:
    assert ask(url, records(GOOD), content_type)[0] == status


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "pressure_1_pa,pressure_2_pa,position_m\nhigh,1,2\n"])
def test_a_bad_csv_is_refused(url: str, text: str) -> None:
    assert ask(url, text.encode(), "text/csv")[0] == 400


def test_the_printed_curl_answers_in_newtons(url: str, champion_root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    command = curl(url, example_rows(CHAMPION, champion_root))
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True, timeout=60)
    outputs = ["flag_names", "flags", "friction_n", "in_training_range", "lower_n", "upper_n"]
    assert [sorted(row) for row in json.loads(done.stdout)["predictions"]] == [outputs] * 5


def test_a_model_that_is_not_there_is_said_before_anything_starts(
    champion_root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    with pytest.raises(TrackingError, match=r"other@champion: the registry at .* has no such version .*`dvc repro`"):
        example_rows("models:/other@champion", champion_root)


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
    of_others = set(folder.glob("models-*.log"))
    code = "import pathlib; from cylinder_friction.deployment.serve import run_server as run; "
    code += f"run({CHAMPION!r}, pathlib.Path())"
    served = subprocess.Popen([sys.executable, "-c", code], cwd=champion_root, stderr=subprocess.DEVNULL)
    assert comes_true(lambda: bool(set(folder.glob("models-*.log")) - of_others), 120.0), "MLflow was not started"
    (log,) = set(folder.glob("models-*.log")) - of_others
    server = f"127.0.0.1 -.*{log.stem.removeprefix('models-')}"
    assert comes_true(lambda: runs(server), 30.0), "the server was not started"
    served.terminate()
    assert served.wait(60.0) != 0
    assert comes_true(lambda: not runs(server), 10.0), "the server still runs"
    log.unlink()


class KilledTwice(subprocess.Popen[bytes]):
    """A server with a worker that ignores SIGTERM; who starts it gets SIGTERM at once, and again while ending it."""

    def __init__(self, worker: str, _: Any, **options: Any) -> None:
        super().__init__(["bash", "-c", f"(trap '' TERM; {worker}; true) & {worker}; true"], **options)
        assert comes_true(lambda: runs(f"^{worker}", 2), 30.0)
        signal.raise_signal(signal.SIGTERM)

    def wait(self, timeout: float | None = None) -> int:
        signal.raise_signal(signal.SIGTERM)
        return super().wait(timeout)


def test_two_kills_at_the_worst_moments_leave_neither_the_server_nor_its_worker(
    champion_root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    worker = f"sleep 9{free_port()}"
    parts = SimpleNamespace(Popen=partial(KilledTwice, worker), STDOUT=subprocess.STDOUT)
    monkeypatch.setattr("cylinder_friction.deployment.serve.subprocess", parts)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with pytest.raises(KeyboardInterrupt):
            run_server(CHAMPION, champion_root)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert comes_true(lambda: not runs(worker), 10.0), "the server or its worker still runs"

"""The whole service as a process of its own: killed while samples flow, and looked at in a browser."""

import json
import re
import resource
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from copy import copy
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from playwright.sync_api import Page
from websockets.frames import Frame, Opcode
from websockets.sync.client import connect

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction_live.access import Access
from cylinder_friction_live.client import Client, LiveClientError
from cylinder_friction_live.engine_building import engine_of
from cylinder_friction_live.frames import SampleBlock, pack_samples
from cylinder_friction_live.history import move_into_history
from cylinder_friction_live.journal import HISTORY_FOLDER, Journal
from cylinder_friction_live.server import AnsweringProtocol
from cylinder_friction_live.start import JOURNAL_FILE
from live_process import PATIENT, stalled_client
from live_service import running

KILLED_AFTER_S = {1: 0.0, 2: 0.9, 3: 1.4}
"""After which turns the service is killed, and how long after: before samples are kept, while they are, later."""
OPEN = {"session": "by hand", "inputs": ["pressure_1_pa", "pressure_2_pa", "position_m"], "sample_time_s": 0.005}


@pytest.fixture(scope="module")
def port() -> int:
    return free_port()


@pytest.mark.extended
def test_kills_lose_nothing(
    newtons: Array, flags: Array, samples: Array, model: Path, tmp_path: Path, port: int
) -> None:
    got: list[Array] = []
    with ExitStack() as services:
        process = services.enter_context(running(model, tmp_path, port))
        client = services.enter_context(Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005))
        for turn, begin in enumerate(range(0, len(samples), 400)):
            client.send(samples[begin : begin + 400])
            if turn in KILLED_AFTER_S:
                time.sleep(KILLED_AFTER_S[turn])
                process.kill()
                process.wait()
                process = services.enter_context(running(model, tmp_path, port))
        client.wait_until_kept()
        while len(part := client.estimates(0.2)[1]):
            got.append(part)
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=60.0)
    np.testing.assert_array_equal(np.concatenate(got), newtons)
    history = pd.concat([pd.read_parquet(path) for path in sorted((tmp_path / "history").rglob("*.parquet"))])
    assert history["index"].tolist() == list(range(len(samples)))
    np.testing.assert_array_equal(history[["friction_n", "lower_n", "upper_n"]], newtons)
    np.testing.assert_array_equal(history["flags"], flags)


def readiness(port: int) -> tuple[int, dict[str, Any]]:
    """Status and body of ``/readyz``."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz") as reply:
            return int(reply.status), json.loads(reply.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def test_a_text_that_is_not_utf8_is_answered_by_a_sentence(
    served: Callable[..., str], caplog: pytest.LogCaptureFixture
) -> None:
    with connect(f"ws://{served()}/stream") as hand:
        for parts in (b"{\xff\xfe}", [b"{\xc3", b"\x28}"]):
            hand.send(parts, text=True)
            assert "expected {" in json.loads(hand.recv(timeout=60.0))["error"]
        hand.send(json.dumps({"open": OPEN | {"session": "größer"}}))
        assert json.loads(hand.recv(timeout=60.0))["opened"]["session"] == "größer"
    assert caplog.records == []


FULL_DISK = """
import os, resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
os.execv(sys.argv[1], sys.argv[1:])
"""
"""Runs a program none of whose files may grow."""


@pytest.mark.parametrize("problem", ["a folder", "a full disk"])
def test_a_journal_that_cannot_be_written_is_named_in_a_sentence(model: Path, tmp_path: Path, problem: str) -> None:
    engine_of(model, str(model), tmp_path / "engines")  # so that only the journal is left to be written
    if problem == "a folder":
        (tmp_path / JOURNAL_FILE).mkdir()
    command = [sys.executable, "-m", "cylinder_friction.commands.cli", "live", "--model", str(model), "--port", "0"]
    limited = [sys.executable, "-c", FULL_DISK] if problem == "a full disk" else []
    done = subprocess.run([*limited, *command, "--folder", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"{tmp_path / JOURNAL_FILE}: the journal cannot be opened or written (" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="prlimit is Linux's")
def test_a_disk_that_fills_up_writes_sentences_and_no_traceback(
    samples: Array, model: Path, tmp_path: Path, port: int, capfd: pytest.CaptureFixture[str]
) -> None:
    with running(model, tmp_path, port) as process:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (1 << 16, 1 << 16))
        with Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
            client.send(samples[:400])
            while not (why := readiness(port)[1]["not_kept"]):
                time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=60.0)
    written = capfd.readouterr().err
    assert f"nothing is kept or acknowledged: {why}; tried again each second" in written
    assert "Traceback" not in written


@pytest.mark.parametrize("full", ["connections", "sessions"])
def test_a_service_that_takes_nobody_more_is_not_ready(served: Callable[..., str], full: str) -> None:
    port = int(served(limits=replace(PATIENT, **{full: 1})).split(":")[1])
    with Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005):
        status, body = readiness(port)
    assert (status, body["ready"]) == (503, False)
    assert body["full"] in ("1 clients are connected", "1 sessions are open, all that are taken")
    while readiness(port)[0] != 200:
        time.sleep(0.01)


@contextmanager
def hang_ups(handler: signal.Handlers) -> Iterator[None]:
    """Let processes that start meanwhile inherit what becomes of a hang-up."""
    before = signal.signal(signal.SIGHUP, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


def stepped(port: int) -> int:
    """How many samples a service has stepped."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as reply:
        found = re.search(r'_samples_total\{outcome="stepped"\} (\S+)', reply.read().decode())
    assert found is not None
    return int(float(found[1]))


@pytest.mark.extended
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGHUP])
def test_an_end_keeps_all_that_came_and_waits_for_no_client_that_reads_nothing(
    sign: signal.Signals, small_hybrid: HybridEstimator, samples: Array, model: Path, tmp_path: Path, port: int
) -> None:
    url = f"ws://127.0.0.1:{port}/stream"
    with (
        hang_ups(signal.SIG_DFL),  # where the tests run under nohup the service would ignore them
        running(model, tmp_path, port, {"limits": asdict(PATIENT)}) as process,
        stalled_client(url, samples),
        Client(url, "press", 0.005) as client,
    ):
        client.send(samples[:400])
        while len(client.estimates(5.0)[1]):
            pass
        count = stepped(port)
        process.send_signal(sign)
        process.wait(timeout=60.0)
    journal = Journal(tmp_path / JOURNAL_FILE)
    move_into_history(journal)
    journal.close()
    rows = 0
    for session in ("press", "stalled"):
        files = (tmp_path / HISTORY_FOLDER / session).rglob("*.parquet")
        history = pd.concat([pd.read_parquet(path) for path in files]).sort_values("index")
        newtons, _ = small_hybrid.real_time().run(np.resize(samples, (len(history), samples.shape[1])))
        assert history["index"].tolist() == list(range(len(history)))
        np.testing.assert_array_equal(history[["friction_n", "lower_n", "upper_n"]], newtons)
        rows += len(history)
    assert rows >= count > 400


def test_a_client_that_dies_with_messages_waiting_is_written_to_no_more(
    served: Callable[..., str], samples: Array, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, port = served().split(":")
    read = AnsweringProtocol.data_received

    def lose_and_read(protocol: AnsweringProtocol, data: bytes) -> None:
        protocol.transport.abort()  # as asyncio does when a client cannot be written to
        read(protocol, data)

    raw = socket.create_connection((host, int(port)))
    with connect(f"ws://{host}:{port}/stream", sock=raw, close_timeout=0.1) as client:
        inputs = ["pressure_1_pa", "pressure_2_pa", "position_m"]
        client.send(json.dumps({"open": {"session": "gone", "inputs": inputs, "sample_time_s": 0.005}}))
        handle = json.loads(client.recv())["opened"]["handle"]
        messages = [pack_samples(SampleBlock(handle, row, 0.005 * row, samples[row : row + 1])) for row in range(100)]
        client.send(messages[0])
        client.recv()
        monkeypatch.setattr(AnsweringProtocol, "data_received", lose_and_read)
        raw.sendall(b"".join(Frame(Opcode.BINARY, each).serialize(mask=True) for each in messages[1:]))
        time.sleep(0.5)
    assert [each.message for each in caplog.records if each.name == "asyncio"] == []


@pytest.mark.extended
def test_a_hang_up_that_is_ignored_as_by_nohup_ends_nothing(model: Path, tmp_path: Path, port: int) -> None:
    with hang_ups(signal.SIG_IGN), running(model, tmp_path, port) as process:
        process.send_signal(signal.SIGHUP)
        with Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
            client.send(np.zeros((10, 3)))
            client.wait_until_kept()
        assert process.poll() is None


def test_a_folder_is_that_of_one_service(model: Path, tmp_path: Path, port: int) -> None:
    with running(model, tmp_path, port):
        command = [sys.executable, "-m", "cylinder_friction.commands.cli", "live", "--model", str(model), "--port", "0"]
        done = subprocess.run([*command, "--folder", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "another live service uses this folder; give this one another --folder" in done.stderr


def test_by_hand_wrongly_and_from_elsewhere(samples: Array, model: Path, tmp_path: Path, port: int) -> None:
    """JSON gives newtons by hand; what is no message, no session's or another page's is named, and nothing ends."""
    url = f"ws://127.0.0.1:{port}/stream"
    with running(model, tmp_path, port, {"limits": asdict(PATIENT)}):
        with connect(url) as hand:
            hand.send(json.dumps({"open": OPEN}))
            handle = json.loads(hand.recv())["opened"]["handle"]
            row = samples[0].tolist()
            rows = [row, [None, *row[1:]]]
            hand.send(json.dumps({"samples": {"session": "by hand", "index": 0, "rows": rows}}))
            estimates = json.loads(hand.recv())["estimates"]
            assert len(estimates["friction_n"]) == 2
            assert "INVALID_PRESSURE_1" in estimates["flags"][1]
            for wrong, words in (
                ("{", "expected"),
                (b"garbage", "expected a header"),
                (json.dumps({"open": OPEN | {"inputs": ["position_m"]}}), "the model takes"),
                (json.dumps({"samples": {"session": "nobody", "index": 0, "rows": rows}}), "not open"),
            ):
                hand.send(wrong)
                assert words in json.loads(hand.recv())["error"]
            with connect(url) as other:
                other.send(pack_samples(SampleBlock(handle, 2, 0.0, samples[:1])))
                assert "another connection has opened it" in json.loads(other.recv())["error"]
        with connect(url, origin="http://elsewhere.example") as foreign:
            assert "only this service's own page" in json.loads(foreign.recv())["error"]
        with pytest.raises(LiveClientError, match="the model was trained at"):
            Client(url, "press", 0.01)
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as reply:
            metrics = reply.read().decode()
    assert 'cylinder_friction_live_samples_total{outcome="stepped"} 2.0' in metrics
    assert 'cylinder_friction_live_refused_total{kind="FrameError"} 1.0' in metrics


@pytest.mark.extended
@pytest.mark.parametrize("width", [1400, 400])
def test_the_page_shows_a_session(
    samples: Array, model: Path, tmp_path: Path, port: int, width: int, new_page: Callable[..., Page]
) -> None:
    curve = {"coulomb_n": 300.0, "viscous_n_s_m": 500.0}
    write_json(tmp_path / "curves.json", {"stribeck": {"new": {"curve": curve}}})
    settings, url = {"stribeck": str(tmp_path / "curves.json")}, f"ws://127.0.0.1:{port}/stream"
    with running(model, tmp_path, port, settings), Client(url, "press 7", 0.005) as client:
        client.send(samples[:400])
        page = new_page(width, 800)
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(f"http://127.0.0.1:{port}/")
        page.get_by_text("press 7").click()
        for begin in range(400, 1000, 100):
            client.send(samples[begin : begin + 100])
            page.wait_for_timeout(250)
        page.wait_for_function("data.index.length >= 300")
        shown = page.evaluate("[data.index.at(-1), data.newtons[0].at(-1)]")
        overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        by_model = page.locator("#model").inner_text()
        series = page.evaluate("plots.velocity.series.map(each => each.label)")
        page.keyboard.press("Escape")
        assert page.locator("#detail").is_hidden()
        newtons = np.concatenate([client.estimates(1.0)[1] for _ in range(7)])
    assert problems == []
    assert series[-1] == "identified, condition new [N]"
    assert by_model == f"by {model}"
    assert overflow <= 0
    assert shown == [999, newtons[999, 0]]


@pytest.mark.extended
def test_the_page_shows_readings_with_the_signs_and_offsets_of_the_mapping(
    small_hybrid: HybridEstimator, samples: Array, newtons: Array, tmp_path: Path, port: int,
    new_page: Callable[..., Page],
) -> None:  # fmt: skip
    mirrored, correction = copy(small_hybrid), ChannelCorrection(-1, 0.25)
    mirrored.corrections = {"position_m": correction}
    mirrored.save(tmp_path / "mirrored")
    readings = samples[:600].copy()
    readings[:, 2] = correction.readings(readings[:, 2])
    with (
        running(tmp_path / "mirrored", tmp_path / "live", port),
        Client(f"ws://127.0.0.1:{port}/stream", "press 7", 0.005) as client,
    ):
        client.send(readings)
        page = new_page(1400, 800)
        page.goto(f"http://127.0.0.1:{port}/")
        page.get_by_text("press 7").click()
        page.wait_for_function("data.index.length >= 600")
        shown = np.array(page.evaluate("data.samples"), float)
        speeds = page.evaluate("velocity()")
        np.testing.assert_allclose(client.estimates(60.0)[1], newtons[:600], atol=1e-6)
    np.testing.assert_allclose(shown.T, samples[:600], atol=1e-9)
    moved_m = samples[310, 2] - samples[290, 2]
    assert speeds[300] == pytest.approx(moved_m / 0.1)


@pytest.mark.extended
def test_the_page_asks_for_a_token(served: Callable[..., str], tmp_path: Path, new_page: Callable[..., Page]) -> None:
    (tmp_path / "tokens").write_text(f"{sha256('größer'.encode()).hexdigest()} read\n", encoding="ascii")
    address = served(Access(tokens=tmp_path / "tokens"))
    page = new_page()
    page.goto(f"http://{address}/")
    for token, words in (("kleiner", "expected a known token"), ("größer", "0 sessions")):
        page.get_by_label("Token").fill(token)
        page.get_by_role("button", name="Show the sessions").click()
        page.get_by_text(words).wait_for()
    page.reload()
    page.get_by_text("0 sessions").wait_for()


@pytest.mark.extended
def test_sessions_are_found_by_keys(served: Callable[..., str], samples: Array, new_page: Callable[..., Page]) -> None:
    address, shown = served(), "[...document.querySelectorAll('#sessions tbody tr:not([hidden]) td:first-child')]"
    with ExitStack() as stack:
        for name, rows in (("press 10", 300), ("press 2", 100), ("lift", 200)):
            client = stack.enter_context(Client(f"ws://{address}/stream", name, 0.005))
            client.send(samples[:rows])
        page = new_page(1400, 800)
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(f"http://{address}/")

        def has(*names: str) -> None:
            page.wait_for_function(f"{shown}.map((each) => each.textContent).join() === '{','.join(names)}'")

        has("lift", "press 2", "press 10")
        page.get_by_role("button", name="samples").click()
        has("press 10", "lift", "press 2")
        page.keyboard.press("/")
        page.keyboard.type("PRESS")
        has("press 10", "press 2")
        for key in ("ArrowDown", "ArrowDown", "Enter"):
            page.keyboard.press(key)
        assert page.locator("#detail-title").text_content() == "press 2"
        page.keyboard.press(" ")
        assert page.locator("#freeze").get_attribute("aria-pressed") == "true"
        page.keyboard.press("Escape")
        assert page.locator("#detail").is_hidden()
        page.keyboard.press("?")
        assert page.locator("#keys").is_visible()
    assert problems == []

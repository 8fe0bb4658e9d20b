"""The server's processes, for real: how each ends, what is reported, and that nothing is left behind."""

import fcntl
import http.client
import json
import os
import pty
import signal
import socket
import ssl
import subprocess
import sys
import termios
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest

from champion_repository import champion_root
from cylinder_friction.deployment.golden_trajectory import recorded
from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.scoring import ServedGraph
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.files import write_json
from cylinder_friction.service.scoring.model_source import GOLDEN_FILE, GRAPH_FILE
from cylinder_friction.tracking.store import open_store
from golden_fixtures import golden_model

__all__ = ["champion_root", "golden_model"]

pytestmark = pytest.mark.extended
ROW = {"columns": ["pressure_1_pa", "pressure_2_pa", "position_m"], "data": [[1.2e6, 9.1e5, 0.12]]}
PATIENCE_S = 300.0
JSON = {"Content-Type": "application/json"}


@dataclass
class Served:
    """A running ``cylinder-friction serve``; ``printed`` grows with what it and its workers print."""

    process: subprocess.Popen[str]
    printed: list[str] = field(default_factory=list)

    def text(self) -> str:
        return "".join(self.printed)

    @property
    def url(self) -> str:
        assert comes_true(lambda: "curl" in self.text() or self.process.poll() is not None), self.text()
        return next(word for line in self.printed for word in line.split() if word.startswith(("http:", "https:")))

    def workers(self) -> list[int]:
        return sorted(each.pid for each in psutil.Process(self.process.pid).children() if runs(each, "scoring.worker"))

    def ask(self, context: ssl.SSLContext | None = None) -> Any:
        body = json.dumps({"dataframe_split": ROW}).encode()
        request = urllib.request.Request(f"{self.url}/invocations", body, JSON)
        with urllib.request.urlopen(request, timeout=PATIENCE_S, context=context) as response:
            return json.loads(response.read())["predictions"]

    def version(self) -> str:
        with urllib.request.urlopen(f"{self.url}/readyz", timeout=PATIENCE_S) as response:
            return str(json.loads(response.read())["version"])

    def reports(self, words: str) -> bool:
        return comes_true(lambda: words in self.text())

    def folders(self) -> list[Path]:
        return list(Path(os.environ["TMPDIR"]).glob("cylinder-friction-serve-*"))


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait until a condition holds; false where it does not in time."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return condition()


def runs(process: psutil.Process, word: str) -> bool:
    """Return whether a process runs, and a word is in its command."""
    try:
        return word in " ".join(process.cmdline())
    except (psutil.NoSuchProcess, psutil.ZombieProcess):
        return False


def gone(pids: list[int]) -> bool:
    there = [psutil.Process(pid) for pid in pids if psutil.pid_exists(pid)]
    return comes_true(lambda: not any(runs(each, "") for each in there))


def is_free(port: int) -> bool:
    """Return whether a server can listen on the port, as one does that is started again."""
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError:
        return False
    return True


def port_of(served: Served) -> int:
    return int(served.url.rpartition(":")[2])


@contextmanager
def serving(*arguments: str, **options: Any) -> Iterator[Served]:
    """Start the command; whatever of it still runs in the end is killed."""
    hangs_up = "import signal; signal.signal(signal.SIGHUP, signal.SIG_DFL)"  # whatever the tests were started from
    runs_it = "import sys; from cylinder_friction.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    code = f"{hangs_up}\n{runs_it}"
    command = [sys.executable, "-c", code, "serve", *arguments]
    settings: dict[str, Any] = {"start_new_session": True, "stdin": subprocess.DEVNULL, **options}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **settings)
    served = Served(process)
    output = process.stdout
    assert output is not None
    reader = threading.Thread(target=lambda: served.printed.extend(iter(output.readline, "")), daemon=True)
    reader.start()
    try:
        yield served
    finally:
        left = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        process.kill()
        process.wait()
        for each in left:
            each.kill()
        reader.join()
        output.close()


@pytest.fixture(scope="module")
def model(golden_model: StepModel, tmp_path_factory: pytest.TempPathFactory) -> str:
    """What of a logged model's folder is needed to serve it."""
    folder = tmp_path_factory.mktemp("served") / "model"
    (folder / GRAPH_FILE).parent.mkdir(parents=True)
    (folder / GRAPH_FILE).write_bytes(sequence_graph(golden_model).SerializeToString())
    write_json(folder / GOLDEN_FILE, recorded(ServedGraph(folder / GRAPH_FILE), golden_model))
    (folder / "MLmodel").write_text("flavors: {}\n", "utf-8")
    (folder / "input_example.json").write_text(json.dumps(ROW), "utf-8")
    return str(folder)


@pytest.fixture(autouse=True)
def temporary_files_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_asked_to_end_it_leaves_nothing(model: str, number: int) -> None:
    with serving(model, "--port", "0", "--workers", "2") as served:
        assert len(served.ask()) == 1
        port, workers = port_of(served), served.workers()
        assert len(workers) == 2
        served.process.send_signal(number)
        assert served.process.wait(PATIENCE_S) == 0
        assert gone(workers)
        assert is_free(port)
        assert served.folders() == []
        assert served.reports(f"{signal.Signals(number).name}: ending after the requests that are being served")


def test_the_printed_curl_gives_friction(model: str) -> None:
    with serving(model, "--port", "0") as served:
        assert served.reports("| tail -c 300\n")
        text = served.text()
        command = text[text.index("curl") : text.index("| tail -c 300") + 13]
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
        assert f'"friction_n":{json.dumps(served.ask()[-1]["friction_n"])}' in done.stdout.replace(" ", "")


@pytest.mark.parametrize("stage", ["", "scoring.worker"], ids=["its first process", "its worker"])
def test_ended_while_it_starts_it_leaves_nothing(model: str, stage: str) -> None:
    with serving(model, "--port", "0") as served:
        server = psutil.Process(served.process.pid)
        assert comes_true(lambda: any(runs(each, stage) for each in server.children()))
        started = [each.pid for each in server.children(recursive=True)]
        served.process.terminate()
        assert served.process.wait(PATIENCE_S) == 0, served.text()
        assert gone(started)
        assert served.folders() == []


def test_a_killed_worker_is_replaced_and_reported(model: str) -> None:
    with serving(model, "--port", "0") as served:
        expected = served.ask()
        (worker,) = served.workers()
        os.kill(worker, signal.SIGKILL)
        assert served.reports(f"worker {worker} was ended by SIGKILL; another takes its place in 0 s")
        assert served.ask() == expected
        assert worker not in served.workers()


def test_a_hung_worker_is_killed_and_replaced(model: str) -> None:
    with serving(model, "--port", "0") as served:
        expected = served.ask()
        (worker,) = served.workers()
        os.kill(worker, signal.SIGSTOP)
        assert served.reports(f"worker {worker} hung and was killed")
        assert served.ask() == expected


def test_when_the_supervisor_is_killed_its_workers_end(model: str) -> None:
    with serving(model, "--port", "0", "--workers", "2") as served:
        port, workers = port_of(served), served.workers()
        served.process.kill()
        assert gone(workers)
        assert is_free(port)
        assert comes_true(lambda: served.folders() == [])


def test_sighup_exchanges_workers_without_losing_a_request(model: str) -> None:
    with serving(model, "--port", "0", "--workers", "2") as served:
        expected, before = served.ask(), served.workers()
        served.process.send_signal(signal.SIGHUP)
        asked, deadline = 0, time.monotonic() + PATIENCE_S
        while set(served.workers()) & set(before) or len(served.workers()) != 2:
            assert time.monotonic() < deadline, served.text()
            assert served.ask() == expected
            asked += 1
        assert asked > 1
        assert served.ask() == expected
        assert served.process.poll() is None


def test_a_terminal_that_closes_ends_it(model: str) -> None:
    controller, terminal = pty.openpty()

    def take_terminal() -> None:
        os.setsid()
        fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)

    options = {"preexec_fn": take_terminal, "start_new_session": False, "stdin": terminal}
    with serving(model, "--port", "0", **options) as served:
        os.close(terminal)
        port, workers = port_of(served), served.workers()
        os.close(controller)
        assert served.process.wait(PATIENCE_S) == 0
        assert gone(workers)
        assert is_free(port)


def test_a_connection_that_stalls_is_closed_and_one_that_is_used_stays(model: str) -> None:
    with serving(model, "--port", "0", "--timeout-s", "0.3") as served:
        address = ("127.0.0.1", port_of(served))
        used = http.client.HTTPConnection(*address, timeout=PATIENCE_S)
        used.connect()
        first = used.sock
        with socket.create_connection(address, PATIENCE_S) as silent, socket.create_connection(address) as slow:
            slow.sendall(b"POST /invocations HTTP/1.1\r\nHost: x\r\n")
            ends_s = time.monotonic() + 4.0
            while time.monotonic() < ends_s:
                used.request("POST", "/invocations", json.dumps({"dataframe_split": ROW}), JSON)
                with used.getresponse() as response:
                    assert response.read()
            for each in (silent, slow):
                each.settimeout(PATIENCE_S)
                assert not received(each)
        assert used.sock is first
        used.close()


def received(connection: socket.socket) -> bytes:
    """Return what came before the other side closed the connection."""
    try:
        return connection.recv(1)
    except ConnectionResetError:
        return b""


def test_tls(model: str, certificate: tuple[Path, Path]) -> None:
    public, key = certificate
    options = ("--tls-certificate", str(public), "--tls-key", str(key))
    with serving(model, "--port", "0", *options) as served:
        assert served.url.startswith("https://")
        trusted = ssl.create_default_context(cafile=str(public))
        assert len(served.ask(trusted)) == 1
        key.write_text("no key", "utf-8")
        served.process.send_signal(signal.SIGHUP)
        assert served.reports(f"before it was ready; worker {served.workers()[0]} stays")
        assert len(served.ask(trusted)) == 1
    with serving(model, "--port", "0", *options) as served:
        assert served.process.wait(PATIENCE_S) == 1
        assert served.reports("cylinder-friction serve: ")
        assert "Traceback" not in served.text()


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        (["{folder}/none"], "expected models:/<name>@<alias>, models:/<name>/<version>, or a folder with an MLmodel"),
        (["{model}", "--tls-key", "key.pem"], "TLS needs both a certificate and its key; got one of them"),
        (["{model}", "--host", "0.0.0.0"], "whoever reaches it could use the model"),
        (["{model}", "--port", "{taken}"], "cannot be listened on (Address already in use)"),
        (["{broken}"], "its graph cannot be opened and run"),
        (["models:/friction-estimator@champion"], "there is no such store"),
    ],
)
def test_what_cannot_be_served_is_refused_in_a_sentence(
    model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], reported: str
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    broken = tmp_path / "broken"
    subprocess.run(["cp", "-r", model, broken], check=True)
    (broken / GRAPH_FILE).write_bytes(b"no graph")
    with socket.create_server(("127.0.0.1", 0)) as listening:
        names = {"folder": tmp_path, "model": model, "broken": broken, "taken": listening.getsockname()[1]}
        given = [each.format(**names) for each in arguments]
        with serving("--port", "0", *given, cwd=tmp_path) as served:
            assert served.process.wait(PATIENCE_S) == 1
            assert served.reports(reported), served.text()
            assert "Traceback" not in served.text()
            assert served.folders() == []


def test_it_follows_the_champion_and_keeps_it_where_the_next_cannot_be_served(
    champion_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    repository, name = tmp_path / "repository", "friction-estimator"
    subprocess.run(["cp", "-r", champion_root, repository], check=True)
    with serving(f"models:/{name}@champion", "--port", "0", cwd=repository) as served:
        assert served.version() == "1"
        expected = served.ask()
        with open_store(repository) as store:
            source = store.client.get_model_version(name, "1").source
            store.client.create_model_version(name, source)
            store.client.set_registered_model_alias(name, "champion", "2")
        assert comes_true(lambda: served.version() == "2"), served.text()
        assert served.ask() == expected
        with open_store(repository) as store:
            folder = next((repository / "mlartifacts/models").glob("*/artifacts"))
            (folder / GRAPH_FILE).write_bytes(b"no graph")
            store.client.create_model_version(name, source)
            store.client.set_registered_model_alias(name, "champion", "3")
        assert served.reports("friction-estimator version 3: its graph cannot be opened and run")
        assert served.reports("the one in service stays")
        assert served.version() == "2"
        assert served.ask() == expected

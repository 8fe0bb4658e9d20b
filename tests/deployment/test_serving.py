"""``cylinder-friction serve``, for real: right answers to many at once, and nothing left behind however it ends."""

import base64
import json
import os
import re
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from http.client import HTTPConnection, HTTPSConnection
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from candidates import other_model, registered_in
from cylinder_friction.commands.cli import main
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.lineage import lineage
from team_servers import PATIENCE_S, comes_true, server_on

CHAMPION = "models:/friction-estimator@champion"
CURL = "| tail -n 1\n"
NEWTONS = ("friction_n", "lower_n", "upper_n")
TOLERANCE_N = 1e-9
JSON = "application/json"


@dataclass
class Served:
    """A running command; ``printed`` grows with what it and its children print."""

    process: subprocess.Popen[str]
    printed: list[str] = field(default_factory=list)

    def text(self) -> str:
        return "".join(self.printed)

    def url(self) -> str:
        assert comes_true(lambda: CURL in self.text() or self.process.poll() is not None)
        found = re.search(r"serving .* at (\S+) \(stop", self.text())
        assert found is not None, self.text()
        return found[1]

    def ask(self, body: Any) -> tuple[int, Any]:
        return ask(self.url(), body)

    def children(self) -> list[psutil.Process]:
        return psutil.Process(self.process.pid).children(recursive=True)


def ask(url: str, body: Any) -> tuple[int, Any]:
    status, answer = send(url, json.dumps(body).encode())
    return status, json.loads(answer) if status == 200 else answer


def send(
    url: str, body: bytes, media: str | None = JSON, context: ssl.SSLContext | None = None, **headers: str
) -> tuple[int, str]:
    """Post a body; urllib would name a content type if there were none."""
    host, port = url.rpartition("/")[2].split(":")
    connect = partial(HTTPSConnection, context=context) if context else HTTPConnection
    with closing(connect(host, int(port), timeout=PATIENCE_S)) as connection:
        connection.request("POST", "/invocations", body, headers | ({"Content-Type": media} if media else {}))
        answer = connection.getresponse()
        return answer.status, answer.read().decode()


def runs(process: psutil.Process) -> bool:
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def gone(processes: list[psutil.Process]) -> bool:
    return comes_true(lambda: not any(runs(each) for each in processes))


def split(samples: np.ndarray) -> dict[str, Any]:
    return {"dataframe_split": {"columns": list(SAMPLE_COLUMNS), "data": samples.tolist()}}


@contextmanager
def serving(cwd: Path, *arguments: str, **variables: str) -> Iterator[Served]:
    """Start the command at a free port; what of it still runs in the end is killed."""
    given = {name: value for name, value in os.environ.items() if not name.startswith("MLFLOW_")}
    command = [sys.executable, "-m", "cylinder_friction.commands.cli", "serve", *arguments, "--port", "0"]
    process = subprocess.Popen(
        command, cwd=cwd, env={**given, **variables}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        stdin=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    served, output = Served(process), process.stdout
    assert output is not None
    reader = threading.Thread(target=lambda: served.printed.extend(iter(output.readline, "")), daemon=True)
    reader.start()
    try:
        yield served
    finally:
        left = served.children() if process.poll() is None else []
        for each in left:
            each.kill()
        process.kill()
        process.wait()
        reader.join()
        output.close()


@pytest.fixture(scope="module")
def server(champion_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """The champion of a local store, behind two workers; asked to end, it must leave nothing."""
    scratch = tmp_path_factory.mktemp("scratch")
    with serving(champion_root, "--workers", "2", CHAMPION, TMPDIR=str(scratch)) as served:
        port, tree = int(served.url().rpartition(":")[2]), served.children()
        yield served
        served.process.send_signal(signal.SIGTERM)
        assert served.process.wait(PATIENCE_S) == 0, served.text()
        assert len(tree) >= 4, "MLflow's command, uvicorn and two workers"
        assert gone(tree)
        assert list(scratch.iterdir()) == []
        socket.create_server(("127.0.0.1", port)).close()


def test_a_recording_is_answered_row_by_row_and_what_is_no_request_refused(
    server: Served, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    samples = labelled_recordings[0].samples()
    status, answer = server.ask(split(samples))
    assert status == 200
    rows = answer["predictions"]
    newtons, flags = small_hybrid.real_time().run(samples)
    np.testing.assert_allclose([[row[name] for name in NEWTONS] for row in rows], newtons, rtol=0.0, atol=TOLERANCE_N)
    np.testing.assert_array_equal([row["flags"] for row in rows], flags)
    assert all(row["in_training_range"] is True for row in rows)
    cut_off = {"columns": list(SAMPLE_COLUMNS), "data": [[1.0, 2.0]]}
    for wrong in ({"dataframe_records": []}, {"dataframe_split": cut_off}, {"inputs": {}}, {}, [], None):
        status, answer = server.ask(wrong)
        assert 400 <= status < 500, (wrong, answer)


def test_the_printed_curl_gives_friction_that_has_settled(server: Served) -> None:
    text = server.url() and server.text()
    command = text[text.index("curl") : text.index(CURL) + len(CURL)]
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    row = json.loads(done.stdout)
    assert set(NEWTONS) < set(row)
    assert "WARMING" not in row["flag_names"]
    assert "serving friction-estimator version 1 at" in text
    assert comes_true(lambda: "A new champion is served after a restart" in server.text()), server.text()
    assert "Bounds: " in server.text()
    assert "not stated" not in server.text()


def test_six_hundred_requests_at_once_are_not_mixed_up(
    server: Served, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    generator, stream = np.random.default_rng(1), small_hybrid.real_time()
    sent = []
    for number in range(600):
        samples = labelled_recordings[number % len(labelled_recordings)].samples()
        begin, rows = (
            generator.integers(0, 2000),
            generator.choice([1, 7, 40, 200, 1500], p=[0.3, 0.3, 0.2, 0.19, 0.01]),
        )
        sent.append(samples[begin : begin + rows])
    url = server.url()
    with ThreadPoolExecutor(60) as threads:
        answers = list(threads.map(lambda samples: ask(url, split(samples)), sent))
    for samples, (status, answer) in zip(sent, answers, strict=True):
        assert status == 200, answer
        stream.reset()
        newtons, flags = stream.run(samples)
        rows_back = answer["predictions"]
        assert [row["flags"] for row in rows_back] == flags.tolist()
        found = [[row[name] for name in NEWTONS] for row in rows_back]
        np.testing.assert_allclose(found, newtons, rtol=0.0, atol=TOLERANCE_N)


ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=8,
)


@st.composite
def with_another_value(draw: st.DrawFn, whole: Any) -> Any:
    """Return a value in which one part, at some depth, is any other JSON."""
    if not isinstance(whole, dict | list) or not whole or draw(st.integers(0, 3)) == 0:
        return draw(ANY_JSON)
    copy = dict(whole) if isinstance(whole, dict) else list(whole)
    at = draw(st.sampled_from([*whole] if isinstance(whole, dict) else range(len(whole))))
    copy[at] = draw(with_another_value(whole[at]))
    return copy


MALFORMED = (b"", b"[" * 100_000, b"1" * 5_000, b'{"a": "\xe9"}', b'{"inputs": {}, "instances": []}', b"a;b\n1;2\n")


@pytest.mark.extended
def test_no_malformed_or_random_request_makes_the_model_fail_or_harms_another(server: Served) -> None:
    good = split(np.array([[1.2e6, 9.1e5, 0.12]]))
    before = server.ask(good)
    assert all(send(server.url(), body, media)[0] >= 400 for body in MALFORMED for media in (None, "text/csv", JSON))
    rows, url, found = [[1.2e6, 9.1e5, 0.12], [1.3e6, 9.0e5, 0.121]], server.url(), Counter[int]()
    records = [dict(zip(SAMPLE_COLUMNS, row, strict=True)) for row in rows]
    forms = [split(np.array(rows)), {"dataframe_records": records}, {"instances": records}]
    forms.append({"inputs": {name: [row[at] for row in rows] for at, name in enumerate(SAMPLE_COLUMNS)}})

    @seed(1)
    @settings(
        max_examples=250, deadline=None, database=None, phases=[Phase.generate], suppress_health_check=[*HealthCheck]
    )
    @given(st.sampled_from(forms).flatmap(with_another_value))
    def try_it(body: Any) -> None:
        status, answer = ask(url, body)
        found[status] += 1
        if status == 200:
            for row in answer["predictions"]:
                ready = not row["flags"] & Flag.NOT_READY
                assert (row["friction_n"] is not None) == ready
                assert not ready or np.isfinite(row["friction_n"])
        if status == 500:
            assert any(isinstance(name, list | dict) for name in body["dataframe_split"]["columns"]), body

    try_it()
    assert {*found} == {200, 400, 500}
    assert min(found.values()) > 5
    assert server.ask(good) == before


NGINX = shutil.which("nginx", path=f"{os.environ['PATH']}:/usr/sbin")
PROXY = Path(__file__).parents[2] / "deploy/nginx.conf"


@pytest.fixture
def proxy(server: Served, tmp_path: Path) -> Iterator[tuple[str, ssl.SSLContext]]:
    """The shipped proxy before the server, with a login, at a free port; a body has a second to arrive."""
    if NGINX is None:
        pytest.skip("nginx is not installed")
    port, public, key = free_port(), tmp_path / "friction.pem", tmp_path / "friction.key"
    made = ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-subj", "/CN=x"]
    made += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(public)]
    subprocess.run(["openssl", *made], check=True, capture_output=True)
    login = subprocess.run(["openssl", "passwd", "-6", "secret"], capture_output=True, text=True, check=True).stdout
    (tmp_path / "friction-logins").write_text(f"press:{login}")
    text = PROXY.read_text("utf-8").replace("8443", str(port)).replace("http://127.0.0.1:5001", server.url())
    text = text.replace("client_body_timeout 30s", "client_body_timeout 1s")
    folders = "".join(
        f"{name}_temp_path {tmp_path}/{name};\n" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    user = "user root;" if os.geteuid() == 0 else ""
    (tmp_path / "nginx.conf").write_text(
        f"daemon off; {user} pid {tmp_path}/pid; events {{}}\n"
        f"http {{ access_log off; {folders} {text.replace('/etc/nginx', str(tmp_path))} }}"
    )
    with subprocess.Popen([NGINX, "-p", tmp_path, "-e", tmp_path / "log", "-c", tmp_path / "nginx.conf"]) as process:
        url, trusted = f"https://127.0.0.1:{port}", ssl.create_default_context(cafile=str(public))
        try:
            assert comes_true((tmp_path / "pid").exists), (tmp_path / "log").read_text()
            yield url, trusted
        finally:
            process.terminate()


def test_the_proxy_asks_for_logins_and_limits_bytes(server: Served, proxy: tuple[str, ssl.SSLContext]) -> None:
    (url, trusted), body = proxy, json.dumps(split(np.array([[1.2e6, 9.1e5, 0.12]]))).encode()
    login = {"Authorization": f"Basic {base64.b64encode(b'press:secret').decode()}"}
    status, answer = send(url, body, context=trusted, **login)
    assert (status, json.loads(answer)) == server.ask(json.loads(body))
    assert send(url, body, context=trusted)[0] == 401
    assert send(url, b" " * (32 << 20) + body, context=trusted, **login)[0] == 413
    assert send(url, body, None, context=trusted, **login)[0] == 415
    with urllib.request.urlopen(f"{url}/ping", timeout=PATIENCE_S, context=trusted) as answer:
        assert answer.status == 200
    for path, expected in (("/docs", 404), ("/invocations", 403)):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(f"{url}{path}", headers=login), context=trusted)
        assert refused.value.code == expected
        refused.value.close()
    head = "POST /invocations HTTP/1.1\r\nHost: x\r\nContent-Type: text/csv\r\nContent-Length: 9\r\n"
    with ExitStack() as slow:
        for _ in range(16):
            plain = slow.enter_context(socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2]))))
            last = slow.enter_context(trusted.wrap_socket(plain, server_hostname="127.0.0.1"))
            last.sendall(f"{head}Authorization: {login['Authorization']}\r\n\r\np".encode())
        assert send(url, body, context=trusted, **login)[0] == 429
        assert last.recv(1 << 12) == b"", "a body that does not arrive"
    assert comes_true(lambda: send(url, body, context=trusted, **login)[0] == 200)


@pytest.fixture(scope="module")
def folder(champion_root: Path) -> Path:
    """The champion's MLflow folder."""
    (description,) = champion_root.glob("mlartifacts/models/*/artifacts/MLmodel")
    return description.parent


@pytest.mark.extended
@pytest.mark.parametrize("stage", ["mlflow", "uvicorn"])
def test_ended_while_it_starts_it_leaves_nothing(folder: Path, stage: str, tmp_path: Path) -> None:
    with serving(tmp_path, str(folder), TMPDIR=str(tmp_path)) as served:
        assert comes_true(lambda: any(stage in " ".join(each.cmdline()) for each in served.children()))
        started = served.children()
        served.process.send_signal(signal.SIGINT)
        assert served.process.wait(PATIENCE_S) == 130, served.text()
        assert gone(started)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.extended
@pytest.mark.parametrize("victim", ["the command", "MLflow's command", "uvicorn"])
def test_when_one_of_its_processes_is_killed_all_end(folder: Path, victim: str, tmp_path: Path) -> None:
    (cwd := tmp_path / "cwd").mkdir()
    with serving(cwd, str(folder), "--workers", "2", TMPDIR=str(tmp_path)) as served:
        assert served.url()
        tree = served.children()
        mlflow, uvicorn = tree[0], next(each for each in tree if "uvicorn" in " ".join(each.cmdline()[:2]))
        killed = {"the command": served.process, "MLflow's command": mlflow, "uvicorn": uvicorn}[victim]
        killed.kill()
        status = served.process.wait(PATIENCE_S)
        assert gone(tree)
        if victim != "the command":
            assert status == 1
            assert comes_true(lambda: "the server ended by itself, with exit status" in served.text()), served.text()
    assert list(cwd.iterdir()) == [], "a folder without a store gets none"


@pytest.mark.extended
def test_a_new_champion_of_a_server_is_served_after_a_restart_and_its_lineage_holds(
    written_pipeline: Path, tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, where = Path(shutil.copytree(written_pipeline, tmp_path / "repository")), tmp_path / "server"
    where.mkdir()
    shutil.copy(empty_store, where / "mlflow.db")
    with server_on("sqlite", where) as uri:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
        for version in ("1", "2"):
            error = 2.0 / int(version)
            assert registered_in(root, {"1": error, "2": error}).promote
            with serving(tmp_path, CHAMPION, MLFLOW_TRACKING_URI=uri) as served:
                assert served.ask(split(np.array([[1.2e6, 9.1e5, 0.12]])))[0] == 200
                assert f"serving friction-estimator version {version} at" in served.text()
            found = lineage(CHAMPION, root)
            assert found.holds, found.text()
            other_model(root)
    assert {path.name for path in tmp_path.iterdir()} == {"repository", "server"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["{folder}/none", "--port", "0"],
            "expected models:/NAME@ALIAS, models:/NAME/VERSION, or a folder with an MLmodel in it",
        ),
        (["{folder}", "--port", "{taken}"], "Address already in use; name another one with --port"),
        ([CHAMPION, "--port", "0"], "there is no such store, or an empty file; run `dvc repro`"),
    ],
)
def test_what_cannot_be_served_is_refused_in_a_sentence(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        names = {"folder": tmp_path, "taken": listening.getsockname()[1]}
        assert main(["serve", *(each.format(**names) for each in arguments)]) == 1
    assert message in capsys.readouterr().err

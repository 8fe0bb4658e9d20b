"""``cylinder-friction serve``, for real: right answers to many at once, and nothing left behind however it ends."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from candidates import other_model, registered_in
from cylinder_friction.commands.cli import main
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.lineage import lineage
from team_servers import server_on

CHAMPION = "models:/friction-estimator@champion"
CURL = "| tail -c 300\n"
NEWTONS = ("friction_n", "lower_n", "upper_n")
PATIENCE_S = 300.0
TOLERANCE_N = 1e-9


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
    data = json.dumps(body).encode()
    request = urllib.request.Request(f"{url}/invocations", data, {"Content-Type": "application/json"})
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait until a condition holds; false if it does not in time."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


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
    assert '"friction_n"' in done.stdout
    assert "WARMING" not in done.stdout
    assert "serving friction-estimator version 1 at" in text


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
    assert {path.name for path in tmp_path.iterdir()} == {"repository", "server", ".cylinder-friction"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{folder}/none"], "expected models:/NAME@ALIAS, models:/NAME/VERSION, or a folder with an MLmodel in it"),
        (["{folder}", "--port", "{taken}"], "Address already in use; name another one with --port"),
        ([CHAMPION], "there is no such store; run `dvc repro`"),
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

"""The MLflow UI: MLflow's own server, on a free port, on this repository."""

import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from cylinder_friction.execution.ports import free_port
from cylinder_friction.tracking.repository import TrackingError

_HOST = "127.0.0.1"
_START_TIMEOUT_S, _POLL_S = 120.0, 0.2
_WITHOUT_JOBS = {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
"""Spares the UI half a dozen processes that wait for evaluation jobs of language models."""


def run_ui(root: Path, port: int | None = None) -> int:
    """Open the MLflow UI on the repository's runs until Ctrl-C or SIGTERM, on this port or a free one.

    Raises:
        KeyboardInterrupt: It was ended while the server was starting.
    """
    received: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):  # noted alone, so that no moment is a bad one
        signal.signal(number, lambda number, _: received.append(number))
    with served_ui(root, port, received) as url:
        sys.stdout.write(
            f"MLflow UI (stop with Ctrl-C)\n  runs of the pipeline   {runs_page(url, root)}\n"
            f"  registered models      {url}/#/models?workflowType=machine_learning\n"
        )
        sys.stdout.flush()
        while not received:
            time.sleep(_POLL_S)
    sys.stdout.write("\n")
    return 0


@contextmanager
def served_ui(root: Path, port: int | None = None, received: Sequence[int] = ()) -> Iterator[str]:
    """Yield the URL of the MLflow UI, once it is ready; ``port`` None takes a free one.

    Raises:
        TrackingError: Something else listens there, or the server does not start.
        KeyboardInterrupt: A signal was ``received`` before it was ready.
    """
    from cylinder_friction.tracking.store import LOCAL_FOLDER, artifact_folder, open_store, tracking_uri

    with open_store(root, create=False) as store:  # the UI would make an empty one
        log_folder = store.root / LOCAL_FOLDER
    uri = tracking_uri(root)
    if uri.startswith(("http://", "https://")):  # a tracking server brings its own
        yield uri
        return
    try:
        port = free_port(port or 0)
    except (OSError, OverflowError) as error:
        raise TrackingError(f"port {port}: {error}; name another one, or leave --port out") from error
    command = [sys.executable, "-m", "mlflow", "server", "--backend-store-uri", uri, "--host", _HOST]
    command += ["--default-artifact-root", artifact_folder(root).as_uri(), "--port", str(port), "--workers", "1"]
    environment = {**_WITHOUT_JOBS, **os.environ, "MLFLOW_TRACKING_URI": uri, "MLFLOW_REGISTRY_URI": uri}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment.get('PATH', '')}"
    url, log_path = f"http://{_HOST}:{port}", log_folder / f"server-{port}.log"
    with log_path.open("w+b") as log:
        process = subprocess.Popen(  # noqa: S603
            command, stdout=log, stderr=subprocess.STDOUT, env=environment, start_new_session=True
        )
        try:
            _wait_until_ready(process, f"{url}/health", log_path, received)
            yield url
        finally:
            _stop(process)
    log_path.unlink(missing_ok=True)  # kept only where something went wrong


def runs_page(url: str, root: Path) -> str:
    """Return the address of the pipeline's runs within the UI at ``url``."""
    from cylinder_friction.tracking.store import open_store

    with open_store(root, create=False) as store:
        return f"{url}/#/experiments/{store.experiment_id}/runs?workflowType=machine_learning&compareRunsMode=CHART"


def _wait_until_ready(process: subprocess.Popen[bytes], url: str, log_path: Path, received: Sequence[int]) -> None:
    deadline = time.monotonic() + _START_TIMEOUT_S
    while time.monotonic() < deadline and process.poll() is None:
        if received:
            raise KeyboardInterrupt
        try:
            with urllib.request.urlopen(url, timeout=2.0):  # noqa: S310
                return
        except (urllib.error.URLError, OSError):
            time.sleep(_POLL_S)
    ended = process.poll()
    what = f"ended with exit status {ended}" if ended is not None else f"was not ready in {_START_TIMEOUT_S:.0f} s"
    log = log_path.read_text(encoding="utf-8", errors="replace").strip()[-2000:]
    raise TrackingError(f"the MLflow server for {url} {what}; its log:\n{log}")


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End the server and its workers, which are one process group of their own; on Windows they are its children."""
    if sys.platform == "win32":
        with suppress(psutil.Error):
            for child in psutil.Process(process.pid).children(recursive=True):
                child.kill()
        process.kill()
        process.wait()
        return
    for sign in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, sign)
        except ProcessLookupError:
            break
        try:
            process.wait(timeout=3.0)
        except subprocess.TimeoutExpired:
            continue
    process.wait()

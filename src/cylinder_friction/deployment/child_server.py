"""An MLflow server as a child process: it is started, waited for, and ended with all its own processes."""

import ctypes
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import psutil

from cylinder_friction.execution.ports import free_port
from cylinder_friction.tracking.repository import TrackingError

_START_TIMEOUT_S, _POLL_S = 300.0, 0.1
_GRACE_S = 10.0
"""Time that running requests have to finish before their server is killed [s]."""
_SET_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)


def noted_signals() -> list[int]:
    """From now on append SIGINT and SIGTERM to the returned list, so that neither interrupts a clean-up."""
    received: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: received.append(number))
    return received


def listenable(port: int) -> int:
    """Check that a port of this machine is free; 0 finds a free one.

    Raises:
        TrackingError: Another program listens there, or there is no such port.
    """
    try:
        return free_port(port)
    except (OSError, OverflowError) as error:
        raise TrackingError(f"port {port}: {error}; name another one with --port") from error


@contextmanager
def child_server(
    command: Sequence[str],
    url: str,
    received: Sequence[int] = (),
    *,
    log: Path | None = None,
    cwd: Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a server until the block ends; yield its process once it is ready.

    The server and its processes are one process group, which ends with the block: running requests get ten seconds to
    finish. On Linux the group also ends if this process is killed.

    Args:
        command: Command of the server; its first word is a Python with the server's programs beside it.
        url: Address that responds once the server is ready.
        received: The list of ``noted_signals``.
        log: File for the server's output; None: this process's output.
        cwd: Working directory of the server; None: that of this process.
        environment: Variables of the server besides those of this process.

    Raises:
        TrackingError: The server ended while it started, or was not ready within five minutes.
        KeyboardInterrupt: A signal was received before the server was ready.
    """
    programs = f"{Path(command[0]).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    with nullcontext() if log is None else log.open("wb") as output:
        process = subprocess.Popen(  # noqa: S603
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, cwd=cwd,
            env={**os.environ, **(environment or {}), "PATH": programs}, start_new_session=True,
            preexec_fn=_end_with_the_parent if sys.platform == "linux" else None,
        )  # fmt: skip

        try:
            _wait_until_ready(process, url, received, log)
            yield process
        finally:
            _end(process)


def wait_for_signal(received: Sequence[int], server: subprocess.Popen[bytes] | None = None) -> None:
    """Wait until a signal is received.

    Raises:
        TrackingError: The server ended by itself before.
    """
    while not received:
        if server is not None and server.poll() is not None:
            raise TrackingError(f"the server ended by itself, with exit status {server.returncode}; start it again")
        time.sleep(_POLL_S)


def _wait_until_ready(process: subprocess.Popen[bytes], url: str, received: Sequence[int], log: Path | None) -> None:
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
    raise TrackingError(f"the server for {url} {what}{_last_lines(log)}")


def _last_lines(log: Path | None) -> str:
    if log is None:
        return "; the messages above state why"
    return f"; its log:\n{log.read_text(encoding='utf-8', errors='replace').strip()[-2000:]}"


def _end_with_the_parent() -> None:
    """Let the kernel send this process SIGTERM when its parent dies in any way."""
    ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the server's process group, even after the server itself died; on Windows its process tree."""
    if sys.platform == "win32":
        with suppress(psutil.Error):
            for child in psutil.Process(process.pid).children(recursive=True):
                child.kill()
        process.kill()
    else:
        for number in (signal.SIGTERM, signal.SIGKILL):
            with suppress(ProcessLookupError):
                os.killpg(process.pid, number)
            deadline = time.monotonic() + _GRACE_S
            while _runs(process) and time.monotonic() < deadline:
                time.sleep(_POLL_S)
    process.wait()


def _runs(process: subprocess.Popen[bytes]) -> bool:
    """Check whether any process of the server's group runs."""
    process.poll()
    for each in psutil.process_iter():
        with suppress(psutil.Error, ProcessLookupError):
            if _group_of(each.pid) == process.pid and each.status() != psutil.STATUS_ZOMBIE:
                return True
    return False


def _group_of(pid: int) -> int:
    if sys.platform == "win32":
        return pid
    return os.getpgid(pid)

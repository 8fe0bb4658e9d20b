"""A service as a process of its own, for measurements and tests."""

import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

START_S = 300.0
CLI = (sys.executable, "-m", "cylinder_friction.commands.cli")


@contextmanager
def ready(
    command: Sequence[str], port: int, path: str, cores: Sequence[int] = (), poll_s: float = 0.05, **settings: Any
) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a service whose address answers; it and its workers are killed at the end.

    Args:
        command: That starts it.
        port: Of this machine.
        path: Answers once it is ready.
        cores: Which it may use; empty: all.
        poll_s: How often it is looked whether it is ready [s].
        settings: Of ``subprocess.Popen``.

    Raises:
        RuntimeError: It ended while it started, or is not ready after five minutes.
    """
    bound = (lambda: os.sched_setaffinity(0, cores)) if cores else None
    process = subprocess.Popen(command, preexec_fn=bound, stdout=subprocess.DEVNULL, start_new_session=True, **settings)
    try:
        deadline = time.monotonic() + START_S
        while not _answers(port, path):
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"the service on port {port} ended while it started, or took more than {START_S} s")
            time.sleep(poll_s)
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # its workers too
        process.wait()


def _answers(port: int, path: str) -> bool:
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=1.0).close()
    except OSError:
        return False
    return True

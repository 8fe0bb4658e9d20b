"""A service as a process of its own, for measurements and tests."""

import argparse
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

START_S = 300.0
CLI = (sys.executable, "-m", "cylinder_friction.commands.cli")


def arguments(description: str | None, sessions: int) -> argparse.ArgumentParser:
    """Return a parser for what every measurement of the live service asks for."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"))
    parser.add_argument("--recordings", type=Path, default=Path("data/processed/test"))
    parser.add_argument("--sessions", type=int, default=sessions)
    return parser


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


def running(
    model: Path,
    folder: Path,
    port: int,
    settings: dict[str, Any] | None = None,
    cores: Sequence[int] = (),
    poll_s: float = 0.05,
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """Return a live service that is ready, with its journal, its history and ``settings`` as a file in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "live.yaml"
    config.write_text(yaml.safe_dump(settings or {}), encoding="utf-8")
    command = [*CLI, "live", "--model", str(model), "--config", str(config), "--port", str(port)]
    return ready([*command, "--folder", str(folder)], port, "/readyz", cores, poll_s)


def _answers(port: int, path: str) -> bool:
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=1.0).close()
    except OSError:
        return False
    return True

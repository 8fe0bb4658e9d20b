"""A live service as a process of its own, for measurements and tests."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

START_S = 300.0


@contextmanager
def running(
    model: Path,
    folder: Path,
    port: int,
    settings: dict[str, Any] | None = None,
    cores: Sequence[int] = (),
    poll_s: float = 0.05,
) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a live service that is ready; it is killed at the end if it still runs.

    Args:
        model: Folder of its estimator.
        folder: Of its journal and history, and of ``settings`` as a file.
        port: Of this machine.
        settings: As ``conf/live`` has them.
        cores: Which it may use; empty: all.
        poll_s: How often it is looked whether it is ready [s].

    Raises:
        RuntimeError: It ended while it started, or is not ready after five minutes.
    """
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "live.yaml"
    config.write_text(yaml.safe_dump(settings or {}), encoding="utf-8")
    command = [sys.executable, "-m", "cylinder_friction.commands.cli", "live", "--model", str(model)]
    process = subprocess.Popen(
        [*command, "--config", str(config), "--port", str(port), "--folder", str(folder)],
        preexec_fn=(lambda: os.sched_setaffinity(0, cores)) if cores else None,
        stdout=subprocess.DEVNULL,
    )
    try:
        deadline = time.monotonic() + START_S
        while not _is_ready(port):
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"the service on port {port} ended while it started, or took more than {START_S} s")
            time.sleep(poll_s)
        yield process
    finally:
        process.kill()
        process.wait()


def _is_ready(port: int) -> bool:
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=1.0).close()
    except OSError:
        return False
    return True

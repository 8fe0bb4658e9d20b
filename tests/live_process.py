"""A live service as a process of its own, for tests of what is outside it."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running(
    model: Path, folder: Path, port: int, settings: dict[str, Any] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a live service that is ready; it is killed at the end if it still runs."""
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "live.yaml"
    config.write_text(yaml.safe_dump(settings or {}), encoding="utf-8")
    command = [sys.executable, "-m", "cylinder_friction.commands.cli", "live", "--model", str(model)]
    process = subprocess.Popen([*command, "--config", str(config), "--port", str(port), "--folder", str(folder)])
    try:
        for _ in range(600):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=1.0).close()
                break
            except OSError:
                assert process.poll() is None, "the service ended while starting"
                time.sleep(0.05)
        yield process
    finally:
        process.kill()
        process.wait()

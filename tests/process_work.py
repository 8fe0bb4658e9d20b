"""Work for processes, in a module that they can import and that imports next to nothing."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

from cylinder_friction.execution.workers import ONE_THREAD


def twice(number: int) -> int:
    return 2 * number


def die(_: int) -> int:
    os._exit(3)


def threads(_: int) -> list[str | None]:
    return [os.environ.get(name) for name in ONE_THREAD]


def minutes_if_first(number: int) -> int:
    time.sleep(300.0 if number == 0 else 0.0)
    return number


def slow_if_first(number: int) -> int:
    time.sleep(0.3 if number == 0 else 0.0)
    return number


def place(_: int) -> tuple[str, list[str | None]]:
    return str(Path.cwd()), threads(0)


def die_once(marker: str, number: int) -> int:
    """Kill this process if nobody has done so before; otherwise the work of ``twice``, slowly."""
    time.sleep(0.05)
    try:
        os.close(os.open(marker, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return twice(number)
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def cost(params: dict[str, float]) -> int:
    return int(params["layers"] * params["nodes"])


def bowl(marker: str, params: dict[str, float], report: Callable[[float], None]) -> float:
    """Best at one layer of 64 nodes; the first who is asked is killed, if a marker's path is given."""
    if marker:
        die_once(marker, 0)
    error = 10.0 + 5.0 * (params["layers"] - 1) + abs(params["nodes"] - 64) / 8 + params["dropout"]
    for epoch in range(3):
        report(error * (2.0 - 0.3 * epoch))
    return float(error)

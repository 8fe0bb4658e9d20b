"""Work for processes, in a module that they can import and that imports next to nothing."""

from __future__ import annotations

import os
import time

from friction_benchmark.processes import ONE_THREAD


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

"""What is measured: something that takes raw samples one at a time and says how long each took."""

from __future__ import annotations

from time import perf_counter_ns
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Times = NDArray[np.int64]


class Contender(Protocol):
    """One running estimate that times its own steps."""

    name: str
    title: str
    family: str
    """Contenders of one family estimate the same: ``step`` all that came before, ``window`` the last 40 samples."""
    timer_ns: float
    """Between two readings of its clock with nothing between them."""

    def run(self, samples: Array) -> tuple[Array, Times]:
        """Take the next samples, shape ``(n, 3)``; returns friction [N] and the time of each step [ns]."""


class PythonContender:
    """A function of one sample, called and timed in Python.

    Args:
        name, title, family: See ``Contender``.
        step: Takes both pressures [Pa] and the position [m], returns friction [N].
    """

    def __init__(self, name: str, title: str, family: str, step: Callable[[float, float, float], float]) -> None:
        self.name, self.title, self.family = name, title, family
        self._step = step
        self.timer_ns = _timer_ns()

    def run(self, samples: Array) -> tuple[Array, Times]:
        friction, times = np.empty(len(samples)), np.empty(len(samples), dtype=np.int64)
        step = self._step
        for row, (pressure_1_pa, pressure_2_pa, position_m) in enumerate(samples.tolist()):
            before = perf_counter_ns()
            value = step(pressure_1_pa, pressure_2_pa, position_m)
            times[row] = perf_counter_ns() - before
            friction[row] = value
        return friction, times


def _timer_ns(repeats: int = 2000) -> float:
    times = np.empty(repeats)
    for row in range(repeats):
        before = perf_counter_ns()
        times[row] = perf_counter_ns() - before
    return float(np.median(times))

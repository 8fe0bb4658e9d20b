"""The machine's own tail: a chain of multiplications as long as a step, which nothing but interrupts can lengthen."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.latency.native import CLOCK, compile_shared

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.deployment.latency.contender import Contender

    Array = NDArray[np.float64]
    Times = NDArray[np.int64]

TRIAL_STEPS = 2000
SOURCE = (
    CLOCK
    + """\
void spin_run(int64_t rows, int64_t links, double *sink, int64_t *times_ns);

void spin_run(int64_t rows, int64_t links, double *sink, int64_t *times_ns)
{
    int64_t row, link;
    for (row = 0; row < rows; ++row) {
        const int64_t before = now_ns();
        double value = *sink;
        for (link = 0; link < links; ++link) {
            value = value * 0.999 + 0.001;
        }
        *sink = value;
        times_ns[row] = now_ns() - before;
    }
}
"""
)


class Spin:
    """No memory, no branch that depends on anything, as long as another contender's median step.

    Args:
        like: Whose median step it lasts as long as.
        samples: What that one is tried on, shape ``(n, 3)``.
        folder: For what is compiled.

    Raises:
        NoCompilerError: There is no compiler.
    """

    name, title, family = "spin", "nothing but arithmetic, as long as the C: the machine's own tail", "machine"

    def __init__(self, like: Contender, samples: Array, folder: Path) -> None:
        source = folder / "spin.c"
        source.write_text(SOURCE, encoding="utf-8")
        compile_shared((source,), source.with_suffix(".so"), ("-std=c99", "-O2"))
        self._run = ctypes.CDLL(str(source.with_suffix(".so"))).spin_run
        self._run.argtypes = [ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
        self._run.restype = None
        self._sink, self._links = np.full(1, 0.5), 0
        self.timer_ns = self._median_ns(0)
        wanted_ns = float(np.median(like.run(samples[:TRIAL_STEPS])[1])) - like.timer_ns
        a_link_ns = (self._median_ns(1000) - self.timer_ns) / 1000.0
        self._links = max(1, round(wanted_ns / a_link_ns))

    def run(self, samples: Array) -> tuple[Array, Times]:
        return np.zeros(len(samples)), self._times(len(samples))

    def _times(self, rows: int) -> Times:
        times = np.zeros(rows, dtype=np.int64)
        self._run(rows, self._links, self._sink.ctypes.data, times.ctypes.data)
        return times

    def _median_ns(self, links: int) -> float:
        self._links = links
        return float(np.median(self._times(TRIAL_STEPS)))

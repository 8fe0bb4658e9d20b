"""The exported C, compiled, stepped and timed in C: Python has no part in what is measured."""

from __future__ import annotations

import ctypes
import subprocess
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.compiled import WARNINGS, NoCompilerError, find_compiler

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.deployment.c_export.export import ExportedC

    Array = NDArray[np.float64]
    Times = NDArray[np.int64]

CLOCK = """\
#define _POSIX_C_SOURCE 199309L
#include <stdint.h>
#include <time.h>

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + (int64_t)now.tv_nsec;
}

"""

TIMED = (
    CLOCK
    + """\
#include "@name@.h"

void timed_start(@name@_state *state);
void timed_run(@name@_state *state, const double *samples, int64_t rows, double *friction_n, int64_t *times_ns);
void timed_nothing(int64_t rows, int64_t *times_ns);

void timed_start(@name@_state *state)
{
    @name@_init(state);
}

void timed_run(@name@_state *state, const double *samples, int64_t rows, double *friction_n, int64_t *times_ns)
{
    int64_t row;
    for (row = 0; row < rows; ++row, samples += 3) {
        @name@_output output;
        const int64_t before = now_ns();
        @name@_step(state, (@name@_real)samples[0], (@name@_real)samples[1], (@name@_real)samples[2], &output);
        times_ns[row] = now_ns() - before;
        friction_n[row] = (double)output.friction_n;
    }
}

void timed_nothing(int64_t rows, int64_t *times_ns)
{
    int64_t row;
    for (row = 0; row < rows; ++row) {
        const int64_t before = now_ns();
        times_ns[row] = now_ns() - before;
    }
}
"""
)


class NativeContender:
    """An exported estimator with the loop and the clock around its step in C too.

    Args:
        name, title: See ``Contender``.
        exported: What ``export_c`` wrote.
        options: Of the compiler.

    Raises:
        NoCompilerError: There is no compiler, or it refused the source.
    """

    family = "step"

    def __init__(self, name: str, title: str, exported: ExportedC, options: Sequence[str]) -> None:
        self.name, self.title = name, title
        driver = exported.source.with_name(f"{exported.name}_timed.c")
        driver.write_text(TIMED.replace("@name@", exported.name), encoding="utf-8")
        library = exported.source.with_name(f"{name}.so")
        compile_shared((exported.source, driver), library, ("-std=c99", *WARNINGS, *options))
        loaded = ctypes.CDLL(str(library))
        self._run = loaded.timed_run
        self._run.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
        self._run.restype = None
        self._state = np.zeros(-(-exported.state_bytes // 8), dtype=np.float64)  # doubles: C wants their alignment
        self._start = loaded.timed_start
        self._start.argtypes, self._start.restype = [ctypes.c_void_p], None
        self.restart()
        self.timer_ns = _timer_ns(loaded)

    def restart(self) -> None:
        """Forget every sample."""
        self._start(self._state.ctypes.data)

    def run(self, samples: Array) -> tuple[Array, Times]:
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        friction, times = np.zeros(len(samples)), np.zeros(len(samples), dtype=np.int64)
        places = (samples.ctypes.data, len(samples), friction.ctypes.data, times.ctypes.data)
        self._run(self._state.ctypes.data, *places)
        return friction, times


def compile_shared(sources: Sequence[Path], library: Path, options: Sequence[str]) -> None:
    """Compile sources into a shared library.

    Raises:
        NoCompilerError: There is no compiler, or it refused a source; its words are in the message.
    """
    command = [find_compiler(), *options, "-shared", "-fPIC", *map(str, sources), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - the user's compiler
    if done.returncode != 0:
        raise NoCompilerError(f"{command[0]} refused {sources[0].name}:\n{done.stderr}")


def _timer_ns(loaded: ctypes.CDLL, rows: int = 10_000) -> float:
    times = np.zeros(rows, dtype=np.int64)
    loaded.timed_nothing(ctypes.c_int64(rows), ctypes.c_void_p(times.ctypes.data))
    return float(np.median(times))

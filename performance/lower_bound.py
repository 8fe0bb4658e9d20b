"""The lower bound of a step on this core: bytes over cache bandwidth, multiply-adds over their peak; and instructions.

Instructions of the exported C are counted by Valgrind: the same on a quiet machine and on a busy one.
"""

from __future__ import annotations

import ctypes
import platform
import re
import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.compiled import compile_shared, find_compiler
from cylinder_friction.deployment.rendering import number

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.deployment.c_export.export import ExportedC
    from cylinder_friction.realtime.model import StepModel

OPTIONS = ("-std=gnu99", "-O3", "-march=native", "-ffp-contract=fast")
NODE_BYTES = 8
"""Of a tree's node: a threshold or value, where its children are, and which input it compares."""
BUFFERS, TRIES = 5, 60
TRY_BYTES = 50_000_000
TRY_MULTIPLY_ADDS = 1_000_000

KERNELS = """\
#define _POSIX_C_SOURCE 199309L
#include <stdint.h>
#include <time.h>

#if defined(__AVX512F__)
#define WIDTH 64
#elif defined(__AVX__)
#define WIDTH 32
#else
#define WIDTH 16
#endif

typedef float vector __attribute__((vector_size(WIDTH)));

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Bytes a second, read over and over from one buffer of a multiple of 8 vectors. */
double read_rate(const float *buffer, int64_t bytes, int64_t repeats, float *sink)
{
    const vector *from = (const vector *)buffer;
    const int64_t count = bytes / WIDTH;
    vector a = {0}, b = {0}, c = {0}, d = {0}, e = {0}, f = {0}, g = {0}, h = {0};
    const double begin = now_s();
    int64_t repeat, place;
    for (repeat = 0; repeat < repeats; ++repeat) {
        for (place = 0; place < count; place += 8) {
            a += from[place]; b += from[place + 1]; c += from[place + 2]; d += from[place + 3];
            e += from[place + 4]; f += from[place + 5]; g += from[place + 6]; h += from[place + 7];
        }
        __asm__ volatile("" ::: "memory");
    }
    {
        const double seconds = now_s() - begin;
        *(vector *)sink = a + b + c + d + e + f + g + h;
        return (double)(repeats * count * WIDTH) / seconds;
    }
}

/* Single-precision multiply-adds a second, all in registers. */
double multiply_add_rate(int64_t repeats, float *sink)
{
    const vector m = *(vector *)sink, s = m; /* no two sums alike, or they would be one */
    vector a = m + 1.0f, b = m + 2.0f, c = m + 3.0f, d = m + 4.0f, e = m + 5.0f, f = m + 6.0f;
    vector g = m + 7.0f, h = m + 8.0f, i = m + 9.0f, j = m + 10.0f, k = m + 11.0f, l = m + 12.0f;
    const double begin = now_s();
    int64_t repeat;
    for (repeat = 0; repeat < repeats; ++repeat) {
        a = a * m + s; b = b * m + s; c = c * m + s; d = d * m + s; e = e * m + s; f = f * m + s;
        g = g * m + s; h = h * m + s; i = i * m + s; j = j * m + s; k = k * m + s; l = l * m + s;
    }
    {
        const double seconds = now_s() - begin;
        *(vector *)sink = a + b + c + d + e + f + g + h + i + j + k + l;
        return (double)repeats * 12.0 * (WIDTH / 4) / seconds;
    }
}
"""


@dataclass(frozen=True)
class Work:
    """The least work of one step.

    Attributes:
        network_bytes, filter_bytes: Of all their weights.
        forest_bytes: Of the nodes that one row passes.
        multiply_adds: Of filters and network.
    """

    network_bytes: int
    filter_bytes: int
    forest_bytes: int
    multiply_adds: int

    @property
    def bytes(self) -> int:
        return self.network_bytes + self.filter_bytes + self.forest_bytes


@dataclass(frozen=True)
class LowerBound:
    """The least time of a step on this core.

    Attributes:
        work: Counted from the model.
        bytes_per_s: Best reading rate from a buffer of as many bytes.
        multiply_adds_per_s: Best rate in registers.
    """

    work: Work
    bytes_per_s: float
    multiply_adds_per_s: float

    @property
    def bandwidth_us(self) -> float:
        return 1e6 * self.work.bytes / self.bytes_per_s

    @property
    def arithmetic_us(self) -> float:
        return 1e6 * self.work.multiply_adds / self.multiply_adds_per_s


class LowerBoundKernels:
    """The two measuring loops, compiled.

    Raises:
        NoCompilerError: There is no compiler, or it refused them.
    """

    def __init__(self, folder: Path) -> None:
        source = folder / "lower_bound.c"
        source.write_text(KERNELS, encoding="utf-8")
        compile_shared((source,), source.with_suffix(".so"), OPTIONS)
        loaded = ctypes.CDLL(str(source.with_suffix(".so")))
        self._read, self._multiply = loaded.read_rate, loaded.multiply_add_rate
        self._read.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p]
        self._multiply.argtypes = [ctypes.c_int64, ctypes.c_void_p]
        self._read.restype = self._multiply.restype = ctypes.c_double

    def measure(self, work: Work) -> LowerBound:
        """Measure both rates for this work: the best of many tries, so that what disturbs them does not count."""
        sink, size = _aligned(64), 512 * -(-work.bytes // 512)
        repeats = max(1, TRY_BYTES // size)
        buffers = [_aligned(size) for _ in range(BUFFERS)]  # where one lies decides how well the cache holds it
        reading = [
            self._read(buffer.ctypes.data, size, repeats, sink.ctypes.data) for buffer in buffers for _ in range(TRIES)
        ]
        sink[:] = 0.5
        adding = [self._multiply(TRY_MULTIPLY_ADDS, sink.ctypes.data) for _ in range(TRIES)]
        return LowerBound(work, max(reading), max(adding))


def work_of(model: StepModel) -> Work:
    """Return the least work of one step of a model."""
    taps = sum(int(np.count_nonzero(bank)) for bank in (model.feature_taps, model.base_taps, model.velocity_taps))
    network = multiply_adds = 0
    if model.network is not None:
        weights = model.network
        columns = weights.inputs + (2 * weights.layers - 1) * weights.nodes
        network = 4 * (4 * weights.nodes * (columns + weights.layers) + weights.nodes + 1)
        multiply_adds = weights.multiply_adds()
    forest = 0 if model.forest is None else NODE_BYTES * len(model.forest.roots) * (model.forest.depth + 1)
    return Work(network, 8 * taps, forest, taps + multiply_adds)


def _aligned(size: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    raw = np.ones(size // 4 + 16, dtype=np.float32)
    skip = -raw.ctypes.data % 64 // 4
    return raw[skip : skip + size // 4]


FEW, MORE = 100, 300
X86_OPTIONS = ("-march=x86-64-v3",)
"""The widest instructions that Valgrind knows."""

MAIN = """\
#include "@name@.h"

#include <stdlib.h>

static const double SAMPLES[][3] = {
@samples@
};

int main(int count, char **words)
{
    static @name@_state state;
    @name@_output output = {0};
    const int steps = count > 1 ? atoi(words[1]) : 0;
    int row;
    @name@_init(&state);
    for (row = 0; row < steps; ++row) {
        const double *sample = SAMPLES[row];
        @name@_step(&state, (@name@_real)sample[0], (@name@_real)sample[1], (@name@_real)sample[2], &output);
    }
    return output.flags > 255u;
}
"""


def instructions_per_step(exported: ExportedC, samples: NDArray[np.float64]) -> float | None:
    """Return the mean number of instructions of a step under ``-O3``; None where Valgrind is not there.

    Args:
        exported: Return value of ``export_c``.
        samples: Raw, shape ``(n, 3)``, at least ``MORE`` rows; fewer give None.

    Raises:
        NoCompilerError: There is no compiler.
    """
    valgrind = shutil.which("valgrind")
    if valgrind is None or len(samples) < MORE:
        return None
    rows = ",\n".join("    {" + ", ".join(number(value, "double") for value in row) + "}" for row in samples[:MORE])
    main = exported.source.with_name("counted.c")
    main.write_text(MAIN.replace("@samples@", rows).replace("@name@", exported.name), encoding="utf-8")
    program = main.with_suffix("")
    wide = X86_OPTIONS if platform.machine() in ("x86_64", "AMD64") else ()
    sources = (str(exported.source), str(main))
    command = [find_compiler(), "-std=c99", "-O3", *wide, "-ffp-contract=off", *sources, "-o", str(program), "-lm"]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        return None
    counts = []
    for steps in (FEW, MORE):
        counting = [valgrind, "--tool=callgrind", f"--callgrind-out-file={main.with_suffix('.out')}"]
        done = subprocess.run([*counting, str(program), str(steps)], capture_output=True, text=True, check=False)
        found = re.search(r"Collected : (\d+)", done.stderr)
        if found is None:
            return None
        counts.append(int(found[1]))
    return (counts[1] - counts[0]) / (MORE - FEW)

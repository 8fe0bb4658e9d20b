"""The runtimes that are compared: each takes raw samples one at a time and times every step."""

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.compiled import OPTIMISED, WARNINGS, compile_shared
from cylinder_friction.deployment.c_export.export import ExportedC, export_c
from cylinder_friction.deployment.onnx_graphs.step import step_graph
from cylinder_friction.deployment.onnx_graphs.stream import open_step
from cylinder_friction.deployment.rendering import render
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.realtime.stream import RealTimeStream

Times = NDArray[np.int64]

COMPILER_OPTIONS = {"c": OPTIMISED, "c_o2": ("-O2", "-ffp-contract=off"), "c_float": OPTIMISED}
"""Compiler options of the runtimes that are C; ratios are to ``c``."""


class PythonRuntime:
    """A function of one sample, called and timed in Python.

    ``step`` takes one number per input, by default P1 [Pa], P2 [Pa] and position [m], and returns friction [N].
    """

    def __init__(self, name: str, title: str, step: Callable[..., float], group: str = "estimator") -> None:
        self.name, self.title, self.group = name, title, group
        self._step = step
        self.timer_ns = float(np.median([-(perf_counter_ns() - perf_counter_ns()) for _ in range(2000)]))

    def run(self, samples: Array) -> tuple[Array, Times]:
        friction, times = np.empty(len(samples)), np.empty(len(samples), dtype=np.int64)
        step = self._step
        for row, sample in enumerate(samples.tolist()):
            before = perf_counter_ns()
            value = step(*sample)
            times[row] = perf_counter_ns() - before
            friction[row] = value
        return friction, times


class CompiledRuntime:
    """An exported estimator with the loop and the clock around its step in C too: Python is not part of the time.

    Raises:
        NoCompilerError: There is no compiler, or it refused the source.
    """

    group = "estimator"

    def __init__(self, name: str, title: str, exported: ExportedC, options: Sequence[str]) -> None:
        self.name, self.title, self.exported = name, title, exported
        driver = exported.source.with_name(f"{exported.name}_timed.c")
        driver.write_text(render("timed.c.j2", name=exported.name, inputs=len(exported.inputs)), encoding="utf-8")
        library = exported.source.with_name(f"{name}.so")
        compile_shared((exported.source, driver), library, ("-std=c99", *WARNINGS, *options))
        self._c = ctypes.CDLL(str(library))
        self._state = np.zeros(-(-exported.state_bytes // 8), dtype=np.float64)  # doubles: C wants their alignment
        self.restart()
        times = np.zeros(10_000, dtype=np.int64)
        self._c.timed_nothing(ctypes.c_int64(len(times)), _address(times))
        self.timer_ns = float(np.median(times))

    def restart(self) -> None:
        """Forget every sample."""
        self._c.timed_start(_address(self._state))

    def run(self, samples: Array) -> tuple[Array, Times]:
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        friction, times = np.zeros(len(samples)), np.zeros(len(samples), dtype=np.int64)
        rows = ctypes.c_int64(len(samples))
        self._c.timed_run(_address(self._state), _address(samples), rows, _address(friction), _address(times))
        return friction, times


Runtime = PythonRuntime | CompiledRuntime
"""One running estimate that times its own steps: ``run`` takes the next samples, shape ``(n, inputs)``, and returns
friction [N] and the time of each step [ns].

``name`` and ``title`` are for the table. Runtimes of one ``group`` must give the same friction, those of ``estimator``
that of the estimator itself. ``timer_ns`` is the time between two readings of its clock with nothing between them.
"""


def _address(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def runtimes_of(estimator: FrictionEstimator, folder: Path) -> tuple[Runtime, ...]:
    """Return every runtime of an estimator, each in a fresh state; the C in double precision is ``c``.

    Raises:
        NoCompilerError: There is no C compiler.
        ValueError: The estimator cannot be exported.
    """
    single = export_c(estimator, folder / "float", precision="float")
    double = export_c(estimator, folder / "double")
    compiled = (
        CompiledRuntime("c", "C, double filters, -O3 -march=native", double, COMPILER_OPTIONS["c"]),
        CompiledRuntime("c_o2", "C, double filters, -O2", double, COMPILER_OPTIONS["c_o2"]),
        CompiledRuntime("c_float", "C, all single precision, -O3 -march=native", single, COMPILER_OPTIONS["c_float"]),
    )
    if isinstance(estimator, LugreEstimator):
        return (PythonRuntime("python", "Python, estimator.stream()", estimator.stream().step), *compiled)
    model = estimator.step_model()
    onnx, python = open_step(step_graph(model)), RealTimeStream(model)
    return (
        PythonRuntime("onnx_step", "ONNX Runtime, step graph", lambda *sample: onnx.step(*sample)[0]),
        PythonRuntime("python", "Python, estimator.real_time()", lambda *sample: python.step(*sample)[0]),
        *compiled,
    )


def size_of(estimator: FrictionEstimator) -> str:
    """Return the size of network and forest in words, or an estimator's kind, and whether it learns an offset."""
    if isinstance(estimator, LugreEstimator):
        return "LuGre, pressure-scaled" if estimator.pressure_scaled else "LuGre"
    model = estimator.step_model()
    parts = []
    if model.network is not None:
        parts.append(f"{model.network.layers}x{model.network.nodes} LSTM")
    if model.forest is not None:
        parts.append(f"{len(model.forest.roots)} trees of depth {model.forest.depth}")
    size = ", ".join(parts) or estimator.kind.replace("_", " ")
    return size if model.offset is None else f"{size}, learning the sensors' offset"

"""The cost of one step on one core: in Python, in C, and beside code that a user would write from a paper.

Usage: python performance/latency.py [model folder ...]

The runtimes of a model take turns on one core, so that disturbances affect all of them. The peer filters in NumPy, runs
the network over the last 40 samples, then the forest. It has no guard, bounds or flags: but for network and forest it
does less work than a step of the others.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestRegressor
from threadpoolctl import threadpool_limits

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.compiled import OPTIMISED, compile_shared, compiler_version
from cylinder_friction.deployment.c_export.export import ExportedC, export_c
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.estimators.training import network_from
from cylinder_friction.estimators.training_plan import Architecture
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.storage import read_stored

Times = NDArray[np.int64]
FOLDERS = ("models/hybrid", "models/paper_hybrid", "models/lugre/lugre")
STEPS, ROUNDS = 100_000, 20
"""Timed steps of each runtime, and the turns into which they are divided."""
LIMIT_S = 10.0
"""Time that one runtime may take; a slow one takes fewer steps."""
WINDOW = 40
"""Samples of the published estimator's window."""
COMPARED_STEPS = 200
"""First steps, in which each runtime is compared with the estimator; they also compile and warm up what runs."""
LEAD_IN_STEPS = 20
"""Steps at the beginning of each turn that are not timed, except the first: they fill the caches again."""
DRIVER = """
#define _POSIX_C_SOURCE 199309L
#include <stdint.h>
#include <time.h>
#include "friction.h"

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + (int64_t)now.tv_nsec;
}

void timed(friction_state *state, const double *samples, int64_t rows, double *friction_n, int64_t *times_ns)
{
    for (int64_t row = 0; row < rows; ++row, samples += INPUTS) {
        friction_output output = {0};
        const int64_t before = now_ns();
        if (state) friction_step(state, ARGUMENTS, &output);
        times_ns[row] = now_ns() - before;
        friction_n[row] = (double)output.friction_n;
    }
}
"""
"""The loop and the clock around an exported step, so that Python is not part of its time; no state: the clock alone."""


@dataclass
class Runtime:
    """A running estimate that times its own steps, and the times so far."""

    title: str
    run: Callable[[Array], tuple[Array, Times]]  # Samples, ``(n, inputs)``, to friction [N] and each step's time [ns]
    timer_ns: float  # Time between two readings of its clock with nothing between them [ns]
    largest_difference_n: float = float("nan")  # From the estimator, in the first steps [N]
    timed: list[Times] = field(default_factory=list)
    first: list[int] = field(default_factory=list)  # First steps after another runtime's turn [ns]

    def take_turn(self, samples: Array, steps: int) -> None:
        """Time this many steps, after those that lead in; the samples are repeated if they are fewer."""
        self.first.append(int(self.run(samples[:LEAD_IN_STEPS])[1][0]))
        while steps > 0:
            self.timed.append(self.run(samples[LEAD_IN_STEPS : LEAD_IN_STEPS + steps])[1])
            steps -= len(self.timed[-1])

    def figures_us(self) -> list[float]:
        """Return median, 99 %, 99.9 % and maximum of the steps and the median of the first steps [µs].

        Each is one of the measured times, less the time of reading the clock.
        """
        quantiles = np.quantile(np.concatenate(self.timed), (0.5, 0.99, 0.999, 1.0), method="inverted_cdf")
        return [1e-3 * max(float(each) - self.timer_ns, 0.0) for each in (*quantiles, np.median(self.first))]


def in_python(title: str, step: Callable[..., float]) -> Runtime:
    """Make a runtime of a function that takes one number per input, by default P1 [Pa], P2 [Pa] and position [m]."""

    def run(samples: Array) -> tuple[Array, Times]:
        friction, times = np.empty(len(samples)), np.empty(len(samples), dtype=np.int64)
        for row, sample in enumerate(samples.tolist()):
            before = time.perf_counter_ns()
            value = step(*sample)
            times[row] = time.perf_counter_ns() - before
            friction[row] = value
        return friction, times

    clock = [-(time.perf_counter_ns() - time.perf_counter_ns()) for _ in range(2000)]
    return Runtime(title, run, float(np.median(clock)))


def in_c(title: str, exported: ExportedC, options: Sequence[str]) -> Runtime:
    """Compile an exported estimator; raises ``NoCompilerError`` if there is no C compiler."""
    inputs = len(exported.inputs)
    arguments = ", ".join(f"(friction_real)samples[{place}]" for place in range(inputs))
    driver, library = exported.source.with_name("timed.c"), exported.source.with_name(f"friction{options[0]}.so")
    driver.write_text(DRIVER.replace("ARGUMENTS", arguments).replace("INPUTS", str(inputs)), encoding="utf-8")
    compile_shared((exported.source, driver), library, ("-std=c99", *options))
    compiled = ctypes.CDLL(str(library))
    state = np.zeros(-(-exported.state_bytes // 8))  # doubles: C wants their alignment
    compiled.friction_init(state.ctypes)

    def timed(state: Any, samples: Array) -> tuple[Array, Times]:
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        friction, times = np.zeros(len(samples)), np.zeros(len(samples), dtype=np.int64)
        compiled.timed(state, samples.ctypes, ctypes.c_int64(len(samples)), friction.ctypes, times.ctypes)
        return friction, times

    nothing = timed(None, np.zeros((10_000, inputs)))[1]
    return Runtime(title, lambda samples: timed(state.ctypes, samples), float(np.median(nothing)))


def runtimes_of(estimator: FrictionEstimator, folder: Path) -> list[Runtime]:
    """Return every runtime of an estimator in a fresh state, the C in double precision and optimised first."""
    double, single = export_c(estimator, folder / "double"), export_c(estimator, folder / "float", precision="float")
    compiled = [
        in_c("C, double filters, -O3 -march=native", double, OPTIMISED),
        in_c("C, double filters, -O2", double, ("-O2", "-ffp-contract=off")),
        in_c("C, all single precision, -O3 -march=native", single, OPTIMISED),
    ]
    if isinstance(estimator, LugreEstimator):
        return [*compiled, in_python("Python, estimator.stream()", estimator.stream().step)]
    stream = RealTimeStream(estimator.step_model())
    return [*compiled, in_python("Python, estimator.real_time()", lambda *sample: stream.step(*sample).friction_n)]


def peers_of(estimator: FrictionEstimator) -> list[Runtime]:
    """Return what an estimator with a network is measured beside; LuGre has no peers."""
    if isinstance(estimator, LugreEstimator) or estimator.step_model().network is None:
        return []
    return [in_python("PyTorch + scikit-learn, window of 40", TorchWindow(estimator.step_model()).step)]


class WindowFeatures:
    """The last raw samples, and the last 40 rows of features made of them; the first sample fills both."""

    def __init__(self, model: StepModel) -> None:
        self._model = model
        features, channels, lags = model.feature_taps.shape
        base_lags = model.base_taps.shape[1]
        taps = np.zeros((features + 1, max(lags, base_lags), channels))
        taps[:features, :lags] = model.feature_taps.transpose(0, 2, 1)
        taps[features, :base_lags] = model.base_taps.T
        self._taps = taps.reshape(features + 1, -1)
        self._history = np.zeros(taps.shape[1:])
        self._started = False
        self.rows = np.zeros((1, WINDOW, features), dtype=np.float32)

    def push(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Take a sample; returns the force that network and forest correct [N]."""
        model, first = self._model, not self._started
        if first:
            self._history[:] = pressure_1_pa, pressure_2_pa, position_m
            self._started = True
        self._history[1:] = self._history[:-1]
        self._history[0] = pressure_1_pa, pressure_2_pa, position_m
        filtered = self._taps @ self._history.ravel()
        value, limit = filtered[:-1], model.feature_limits
        value = np.where(limit > 0.0, value / (np.abs(value) + np.where(limit > 0.0, limit, 1.0)), value)
        self.rows[0, :-1] = self.rows[0, 1:]
        self.rows[0, -1] = (value - model.feature_mean) / model.feature_scale
        if first:
            self.rows[0, :-1] = self.rows[0, -1]
        return float(filtered[-1]) + model.target_mean_n


class TorchWindow:
    """PyTorch and scikit-learn."""

    def __init__(self, model: StepModel) -> None:
        assert model.network is not None
        self._model, self._features = model, WindowFeatures(model)
        architecture = Architecture(model.network.layers, model.network.nodes, 0.0, 1e-3)
        self._network = network_from(architecture, model.network, range(model.network.inputs)).eval()
        self._forest = None if model.forest is None else scikit_learn_forest(model.forest)

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        model = self._model
        friction_n = self._features.push(pressure_1_pa, pressure_2_pa, position_m)
        with torch.no_grad():
            hidden = self._network.lstm(torch.from_numpy(self._features.rows[0]))[0][-1:]
            head = self._network.head(hidden)
        if model.head_counts:
            friction_n += model.target_scale_n * head.item()
        if self._forest is not None:
            seen = hidden.numpy()
            if model.forest_sees == "hidden_head_features":
                seen = np.concatenate([seen, head.numpy(), self._features.rows[:, -1]], axis=1)
            friction_n += model.target_scale_n * float(self._forest.predict(seen)[0])
        return friction_n


def scikit_learn_forest(forest: Forest) -> RandomForestRegressor:
    """Return a forest of the same trees, every node at the same place, for one job."""
    inputs, trees = np.zeros((2, forest.inputs), dtype=np.float32), len(forest.roots)
    result = RandomForestRegressor(n_estimators=trees, n_jobs=1).fit(inputs, np.zeros(2))
    ends = [*forest.roots[1:].tolist(), len(forest.feature)]
    for tree, begin, end in zip(result.estimators_, forest.roots.tolist(), ends, strict=True):
        make, arguments, empty = tree.tree_.__reduce__()
        tree.tree_ = make(*arguments)  # a fresh one: only that takes room for its nodes
        tree.tree_.__setstate__(_tree_state(forest, begin, end, empty, trees))
    return result


def _tree_state(forest: Forest, begin: int, end: int, empty: dict[str, Any], trees: int) -> dict[str, Any]:
    """Return the state of one tree; scikit-learn marks with -1 for no child and -2 for no feature."""
    part = slice(begin, end)
    leaf = forest.feature[part] < 0
    nodes = np.zeros(end - begin, dtype=empty["nodes"].dtype)
    nodes["left_child"] = np.where(leaf, -1, forest.left[part] - begin)
    nodes["right_child"] = np.where(leaf, -1, forest.right[part] - begin)
    nodes["feature"] = np.where(leaf, -2, forest.feature[part])
    nodes["threshold"] = np.where(leaf, -2.0, forest.threshold[part])
    nodes["n_node_samples"] = nodes["weighted_n_node_samples"] = 1
    values = forest.value[part].astype(np.float64).reshape(-1, 1, 1) * trees
    return {**empty, "max_depth": forest.depth, "node_count": end - begin, "nodes": nodes, "values": values}


def measure(estimator: FrictionEstimator, samples: Array, folder: Path, steps: int = STEPS) -> list[Runtime]:
    """Let an estimator's runtimes and its peers take turns, the C compiled in ``folder``."""
    if len(samples) < COMPARED_STEPS:
        raise ValueError(f"expected at least {COMPARED_STEPS} samples, but got {len(samples)}")
    begun, stream, own = samples[:COMPARED_STEPS], estimator.stream(), runtimes_of(estimator, folder)
    expected = np.array([stream.step(*sample) for sample in begun])
    for runtime in own:
        runtime.largest_difference_n = float(np.abs(runtime.run(begun)[0] - expected).max())
    runtimes = [*own, *peers_of(estimator)]
    affordable = [1e9 * LIMIT_S / float(np.median(runtime.run(begun)[1])) for runtime in runtimes]
    for turn in range(ROUNDS):  # another runtime begins each round, elsewhere in the samples
        turned = np.roll(samples, -(turn * len(samples) // ROUNDS), axis=0)
        for place in range(turn, turn + len(runtimes)):
            index = place % len(runtimes)
            runtimes[index].take_turn(turned, max(1, round(min(steps, affordable[index]) / ROUNDS)))
    return runtimes


def table(runtimes: Sequence[Runtime]) -> str:
    """Return one line per runtime; ratios are those of the medians to the first."""
    lines = ["    ratio        p50        p99      p99.9        max      first  differs [N]  runtime (times in µs)"]
    reference_us = runtimes[0].figures_us()[0]
    for runtime in runtimes:
        times = "".join(f"{each:11.3f}" for each in runtime.figures_us())
        ratio = runtime.figures_us()[0] / reference_us if reference_us > 0.0 else float("nan")
        lines.append(f"{ratio:9.2f}{times}  {runtime.largest_difference_n:11.2g}  {runtime.title}")
    return "\n".join(lines)


def main() -> None:
    """Print one table per model, then the machine and how busy it was."""
    threadpool_limits(1)
    gc.disable()
    core = max(os.sched_getaffinity(0))  # the one least troubled by interrupts
    os.sched_setaffinity(0, {core})
    recordings = read_stored(Path("data/processed/test"))[:4]
    for name in sys.argv[1:] or FOLDERS:
        estimator = load_estimator(Path(name))
        samples = np.concatenate([recording.samples(estimator.inputs) for recording in recordings])
        with TemporaryDirectory() as folder:
            print(f"{name}\n{table(measure(estimator, samples, Path(folder)))}\n", flush=True)
    cpu = next(line for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines() if line.startswith("model name"))
    print(f"{cpu.partition(': ')[2]}; {compiler_version()}; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()

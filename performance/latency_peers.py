"""What the exported estimators are measured against: code that a user would write from a paper, and bare arithmetic.

The windows filter in numpy, run the network over the last 40 samples, then the forest. No guard, no bounds, no flags:
less work than a step of the others, network and forest excepted.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np
import onnxruntime
import torch
from onnx import TensorProto
from training_framework import TorchNetwork, scikit_learn_forest

from cylinder_friction.deployment.c_export.compiled import compile_shared
from cylinder_friction.deployment.latency.runtimes import PythonRuntime
from cylinder_friction.deployment.onnx_graphs.estimated import tree_attributes
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.rendering import render
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from pathlib import Path

    import onnx
    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.deployment.latency.runtimes import CompiledRuntime, Runtime
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import StepModel

    Times = NDArray[np.int64]


def peers_of(
    estimator: FrictionEstimator, compiled: CompiledRuntime, samples: Array, folder: Path
) -> tuple[Runtime, ...]:
    """Return what an estimator is measured against, and the machine's own tail at the length of a step of its C."""
    tail = MachineTail(compiled, samples, folder)
    compiled.restart()
    if isinstance(estimator, LugreEstimator):
        numpy = LugreInNumpy(estimator)
        return (PythonRuntime("numpy", "LuGre in numpy, as written from its equations", numpy.step), tail)
    model = estimator.step_model()
    if model.network is None:
        return (tail,)
    return (
        PythonRuntime("torch_window", "PyTorch + scikit-learn, window of 40", TorchWindow(model).step, "window"),
        PythonRuntime("onnx_window", "ONNX Runtime, the same converted", OnnxWindow(model).step, "window"),
        tail,
    )


WINDOW = 40
"""Samples of the published estimator's window."""


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
        self._network = TorchNetwork(model.network)
        self._forest = None if model.forest is None else scikit_learn_forest(model.forest)

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        model = self._model
        friction_n = self._features.push(pressure_1_pa, pressure_2_pa, position_m)
        with torch.no_grad():
            hidden, head = self._network(torch.from_numpy(self._features.rows))
        if model.head_counts:
            friction_n += model.target_scale_n * head.item()
        if self._forest is not None:
            seen = hidden.numpy()
            if model.forest_sees == "hidden_head_features":
                seen = np.concatenate([seen, head.numpy(), self._features.rows[:, -1]], axis=1)
            friction_n += model.target_scale_n * float(self._forest.predict(seen)[0])
        return friction_n


class OnnxWindow:
    """The same network and forest in one ONNX graph, on one thread of ONNX Runtime."""

    def __init__(self, model: StepModel) -> None:
        self._model, self._features = model, WindowFeatures(model)
        self._session = _session(window_graph(model))

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        friction_n = self._features.push(pressure_1_pa, pressure_2_pa, position_m)
        (correction,) = self._session.run(None, {"window": self._features.rows})
        return friction_n + self._model.target_scale_n * float(correction[0, 0])


def window_graph(model: StepModel) -> onnx.ModelProto:
    """Return ``window``, shape ``(1, time, features)``, to ``correction``, ``(1, 1)``, as converters write it."""
    assert model.network is not None
    weights, graph = model.network, Graph()
    source = graph.add("Transpose", "window", to="sequence", perm=[1, 0, 2])
    for layer in range(weights.layers):
        inputs, bias = weights.inputs if layer == 0 else weights.nodes, weights.bias[layer]
        matrices = (weights.input[layer, :inputs].T[None], weights.recurrent[layer].T[None])
        constants = [graph.constant(each, np.float32) for each in (*matrices, np.append(bias, 0.0 * bias)[None])]
        every = graph.add("LSTM", source, *constants, to=f"all_{layer}", hidden_size=weights.nodes)
        source = graph.add("Squeeze", every, graph.indices(1), to=f"sequence_{layer}")
    last = graph.constant(-1, np.int64)
    graph.add("Gather", source, last, to="hidden", axis=0)
    head = graph.constant(weights.head[:, None], np.float32), graph.constant([weights.head_bias], np.float32)
    graph.add("Gemm", "hidden", *head, to="head")
    parts = ["head"] if model.head_counts else []
    if model.forest is not None:
        seen = "hidden"
        if model.forest_sees == "hidden_head_features":
            graph.add("Gather", "window", last, to="features", axis=1)
            seen = graph.add("Concat", "hidden", "head", "features", to="seen", axis=1)
        parts.append(graph.add("TreeEnsembleRegressor", seen, to="forest", **tree_attributes(model.forest)))
    graph.add("Sum", *parts, to="correction")
    graph.takes("window", TensorProto.FLOAT, [1, "time", weights.inputs], "the last rows of features")
    graph.gives("correction", TensorProto.FLOAT, [1, 1], "in target scales")
    return graph.model("window", "network and forest over a window, without state", {})


def _session(model: onnx.ModelProto) -> Any:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])


class LugreInNumpy:
    """LuGre sample by sample, as one would write it from the equations.

    Args:
        estimator: A fitted LuGre, with or without pressure scaling.
    """

    def __init__(self, estimator: LugreEstimator) -> None:
        assert estimator.parameters is not None
        assert estimator.causal_velocity is not None
        assert estimator.sample_time_s is not None
        self._law, self._motion, self._time_s = estimator.parameters, estimator.causal_velocity, estimator.sample_time_s
        self._scaled = estimator.pressure_scaled
        window, order = self._motion.window, self._motion.order
        rows = [one_sided_savitzky_golay_taps(window, order, derivative, self._time_s) for derivative in (0, 1)]
        self._taps = np.stack(rows)
        self._history: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None = None
        self._centre_m, self._push, self._pushed = 0.0, 0.0, 0
        self._bristle_m = 0.0

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        law = self._law
        velocity = self._velocity(position_m)
        if velocity == 0.0:
            return law.bristle_stiffness_n_m * self._bristle_m
        speed = np.abs(velocity)
        falling = np.exp(-((speed / law.stribeck_velocity_m_s) ** law.stribeck_exponent))
        dry = law.coulomb_n + (law.static_n - law.coulomb_n) * falling
        if self._scaled:
            dry *= 1.0 + law.pressure_slope_n_pa * np.maximum(pressure_1_pa + pressure_2_pa, 0.0) / law.coulomb_n
        if velocity < 0.0:
            dry *= law.retract_ratio
        decay = law.bristle_stiffness_n_m * speed * self._time_s / dry
        steady_m = np.sign(velocity) * dry / law.bristle_stiffness_n_m
        after = self._bristle_m * np.exp(-decay) - np.expm1(-decay) * steady_m
        rate = (after - self._bristle_m) / self._time_s
        damping = law.bristle_damping_n_s_m * np.exp(-((velocity / law.damping_velocity_m_s) ** 2))
        self._bristle_m = after
        return float(law.bristle_stiffness_n_m * after + damping * rate + law.viscous_n_s_m * velocity)

    def _velocity(self, position_m: float) -> float:
        motion = self._motion
        first = self._history is None
        if self._history is None:
            self._history = np.full(motion.window, position_m)
        self._history[1:] = self._history[:-1]
        self._history[0] = position_m
        smooth, rate = self._taps @ self._history
        if first:
            self._centre_m = smooth
        if smooth > self._centre_m + motion.backlash_m:
            self._centre_m, self._push, self._pushed = smooth - motion.backlash_m, 1.0, motion.window
        elif smooth < self._centre_m - motion.backlash_m:
            self._centre_m, self._push, self._pushed = smooth + motion.backlash_m, -1.0, motion.window
        elif self._pushed > 0:
            self._pushed -= 1
        lets_through = motion.backlash_m == 0.0 or (self._pushed > 0 and rate * self._push > 0.0)
        return float(rate) if np.abs(rate) >= motion.dead_band_m_s and lets_through else 0.0


TRIAL_STEPS = 2000
SOURCE = (
    render("clock.h.j2")
    + """
void tail_run(int64_t rows, int64_t links, double *sink, int64_t *times_ns);

void tail_run(int64_t rows, int64_t links, double *sink, int64_t *times_ns)
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


class MachineTail:
    """The machine's own tail: a chain of multiplications as long as a step, which only interrupts can lengthen.

    Args:
        like: The runtime whose median step sets the length.
        samples: For a trial of that runtime, shape ``(n, 3)``.
        folder: For the compiled library.

    Raises:
        NoCompilerError: There is no compiler.
    """

    name, title, group = "tail", "bare arithmetic, as long as the C: the machine's own tail", "machine"

    def __init__(self, like: Runtime, samples: Array, folder: Path) -> None:
        source = folder / "tail.c"
        source.write_text(SOURCE, encoding="utf-8")
        compile_shared((source,), source.with_suffix(".so"), ("-std=c99", "-O2"))
        self._run = ctypes.CDLL(str(source.with_suffix(".so"))).tail_run
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

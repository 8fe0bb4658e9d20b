"""The cost of one step on one core, in every runtime and beside code that a user would write from a paper.

Usage: python performance/latency.py [model folder ...]

The peers filter in numpy, run the network over the last 40 samples, then the forest. No guard, no bounds, no flags:
less work than a step of the others, network and forest excepted. It only prints; `cylinder-friction latency` measures
the runtimes alone and keeps the figures.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from sklearn.ensemble import RandomForestRegressor
from threadpoolctl import threadpool_limits

from cylinder_friction.deployment.latency.measuring import Effort, measure
from cylinder_friction.deployment.latency.report import circumstances, model_table
from cylinder_friction.deployment.latency.runtimes import PythonRuntime, Runtime
from cylinder_friction.deployment.onnx_graphs.estimated import tree_attributes
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.estimators.training import network_from
from cylinder_friction.estimators.training_plan import Architecture
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.storage import read_stored

FOLDERS = ("models/hybrid", "models/paper_hybrid", "models/lugre/lugre")
WINDOW = 40
"""Samples of the published estimator's window."""


def peers_of(estimator: FrictionEstimator) -> tuple[Runtime, ...]:
    """Return what an estimator with a network is measured against; LuGre has no peers."""
    if isinstance(estimator, LugreEstimator) or estimator.step_model().network is None:
        return ()
    model = estimator.step_model()
    return (
        PythonRuntime("torch_window", "PyTorch + scikit-learn, window of 40", TorchWindow(model).step, "window"),
        PythonRuntime("onnx_window", "ONNX Runtime, the same converted", OnnxWindow(model).step, "window"),
    )


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
    graph.takes("window", onnx.TensorProto.FLOAT, [1, "time", weights.inputs], "the last rows of features")
    graph.gives("correction", onnx.TensorProto.FLOAT, [1, 1], "in target scales")
    return graph.model("window", "network and forest over a window, without state", {})


def _session(model: onnx.ModelProto) -> Any:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])


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


def main() -> None:
    """Print one table per model, then the circumstances of the run."""
    threadpool_limits(1)
    estimators = {folder: load_estimator(Path(folder)) for folder in sys.argv[1:] or FOLDERS}
    recordings = read_stored(Path("data/processed/test"))[:4]
    samples = {
        folder: np.concatenate([recording.samples(estimator.inputs) for recording in recordings])
        for folder, estimator in estimators.items()
    }
    measured = measure(estimators, samples, Effort(), peers_of)
    for name, model in measured.models.items():
        print(f"{model_table(name, model)}\n")
    print(circumstances(measured))


if __name__ == "__main__":
    main()

"""The gated recurrent unit as an estimator, and its step at run time: plain arrays, state carried.

Cell (Cho, van Merriënboer, Gulcehre, Bahdanau, Bougares, Schwenk and Bengio 2014, equations 5 to 8, with the reset gate
after the recurrent product, as PyTorch and cuDNN have it), gates in ONNX order z, r, h:

    z, r = sigmoid(W x + R h + b);  g = tanh(W x + b + r (R h + c));  h = (1 - z) g + z h

A state below 1e-30 becomes 0: one that sinks among the denormal numbers would slow every later step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numba
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from cylinder_friction.estimators.onnx_files import IR_VERSION, OPSET
from cylinder_friction.estimators.training_plan import Architecture
from cylinder_friction.realtime.lstm import TINY, ZERO, add_product, head_of, sigmoid, tanh
from friction_benchmark.models.sequence_estimator import SequenceEstimator, plain

if TYPE_CHECKING:
    import torch
    from numpy.typing import NDArray

    Single = NDArray[np.float32]


@dataclass(frozen=True)
class GruWeights:
    """Weights of a stack of GRU layers of equal width, and of the linear head on its last hidden state.

    Attributes:
        input: One per layer, shape ``(inputs of the layer, 3 · nodes)``.
        recurrent: Shape ``(layers, nodes, 3 · nodes)``.
        input_bias: Shape ``(layers, 3 · nodes)``.
        recurrent_bias: Shape ``(layers, 3 · nodes)``.
        head: Shape ``(nodes,)``.
        head_bias: Added to the head's output.
    """

    input: tuple[Single, ...]
    recurrent: Single
    input_bias: Single
    recurrent_bias: Single
    head: Single
    head_bias: float

    @property
    def layers(self) -> int:
        return int(self.recurrent.shape[0])

    @property
    def nodes(self) -> int:
        return int(self.recurrent.shape[1])


class Gru:
    """Runs ``GruWeights`` over features; its state is the hidden states, shape ``(layers, nodes)``."""

    def __init__(self, weights: GruWeights) -> None:
        self.weights = weights
        widest = max(kernel.shape[0] for kernel in weights.input)
        self._input = np.stack([np.pad(kernel, ((0, widest - len(kernel)), (0, 0))) for kernel in weights.input])

    def new_state(self) -> Single:
        return np.zeros((self.weights.layers, self.weights.nodes), dtype=np.float32)

    def advance(self, state: Single, features: Single) -> Single:
        """Return the head's output, shape ``(n,)``."""
        w, inputs = self.weights, self.weights.input[0].shape[0]
        biases = (w.input_bias, w.recurrent_bias)
        return np.asarray(_run(self._input, w.recurrent, *biases, w.head, w.head_bias, inputs, features, state))

    def multiply_adds(self) -> int:
        w = self.weights
        return sum(kernel.size for kernel in w.input) + w.recurrent.size + w.layers * 3 * w.nodes + w.nodes


@numba.njit(cache=True)
def _run(
    input_weights: Single,
    recurrent: Single,
    input_bias: Single,
    recurrent_bias: Single,
    head: Single,
    head_bias: float,
    inputs: int,
    features: Single,
    hidden: Single,
) -> Single:
    layers, nodes = hidden.shape
    output = np.empty(features.shape[0], dtype=np.float32)
    given = np.empty(3 * nodes, dtype=np.float32)
    kept = np.empty(3 * nodes, dtype=np.float32)
    for row in range(features.shape[0]):
        for layer in range(layers):
            given[:] = input_bias[layer]
            kept[:] = recurrent_bias[layer]
            if layer == 0:
                add_product(given, input_weights[0], features[row], inputs)
            else:
                add_product(given, input_weights[layer], hidden[layer - 1], nodes)
            add_product(kept, recurrent[layer], hidden[layer], nodes)
            _cell_step(given, kept, hidden[layer])
        output[row] = head_of(hidden[-1], head, head_bias)
    return output


@numba.njit(cache=True)
def _cell_step(given: Single, kept: Single, hidden: Single) -> None:
    nodes = hidden.shape[0]
    for gate in range(2 * nodes):
        given[gate] = sigmoid(given[gate] + kept[gate])
    for node in range(nodes):
        new = tanh(given[2 * nodes + node] + given[nodes + node] * kept[2 * nodes + node])
        value = new + given[node] * (hidden[node] - new)
        hidden[node] = value if abs(value) >= TINY else ZERO


def gru_weights_of(network: Any) -> GruWeights:
    """Return a network's weights as plain arrays, gates reordered from PyTorch's r, z, n to ONNX's z, r, h."""
    gru, nodes, layers = network.gru, network.gru.hidden_size, network.gru.num_layers
    order = np.concatenate([np.arange(nodes) + nodes * gate for gate in (1, 0, 2)])
    parts = {name: plain(value) for name, value in gru.named_parameters()}
    kernels = [parts[f"weight_ih_l{layer}"][order].T for layer in range(layers)]
    recurrent = [np.ascontiguousarray(parts[f"weight_hh_l{layer}"][order].T) for layer in range(layers)]
    return GruWeights(
        tuple(np.ascontiguousarray(kernel) for kernel in kernels),
        np.stack(recurrent),
        np.stack([parts[f"bias_ih_l{layer}"][order] for layer in range(layers)]),
        np.stack([parts[f"bias_hh_l{layer}"][order] for layer in range(layers)]),
        plain(network.head.weight)[0].copy(),
        float(plain(network.head.bias)[0]),
    )


def gru_to_onnx(weights: GruWeights) -> onnx.ModelProto:
    """Return the checked graph: ``features`` (time, batch, k) and ``hidden_in`` (layers, batch, nodes) to ``hidden``
    (time, batch, nodes), ``head`` (time, batch, 1) and ``hidden_out``; all float32."""
    nodes: list[onnx.NodeProto] = []
    constants = [
        numpy_helper.from_array(weights.head[:, None], "head_weight"),
        numpy_helper.from_array(np.array([weights.head_bias], dtype=np.float32), "head_bias"),
        numpy_helper.from_array(np.array([1], dtype=np.int64), "direction_axis"),
    ]
    source = "features"
    for layer, kernel in enumerate(weights.input):
        own = f"layer{layer}_"
        biases = np.concatenate([weights.input_bias[layer], weights.recurrent_bias[layer]])
        constants += [
            numpy_helper.from_array(np.ascontiguousarray(kernel.T[None]), own + "W"),
            numpy_helper.from_array(np.ascontiguousarray(weights.recurrent[layer].T[None]), own + "R"),
            numpy_helper.from_array(biases[None], own + "B"),
            numpy_helper.from_array(np.array([layer], dtype=np.int64), own + "index"),
        ]
        ends = [own + "all", own + "hidden_out"]
        names = [source, own + "W", own + "R", own + "B", "", own + "hidden_in"]
        nodes += [
            helper.make_node("Gather", ["hidden_in", own + "index"], [own + "hidden_in"], axis=0),
            helper.make_node("GRU", names, ends, hidden_size=weights.nodes, linear_before_reset=1),
            helper.make_node("Squeeze", [own + "all", "direction_axis"], [own + "hidden"]),
        ]
        source = own + "hidden"
    nodes += [
        helper.make_node("Identity", [source], ["hidden"]),
        helper.make_node("MatMul", [source, "head_weight"], ["head_product"]),
        helper.make_node("Add", ["head_product", "head_bias"], ["head"]),
        helper.make_node("Concat", [f"layer{n}_hidden_out" for n in range(weights.layers)], ["hidden_out"], axis=0),
    ]
    state: list[int | str] = [weights.layers, "batch", weights.nodes]
    sequence: list[int | str] = ["time", "batch"]
    graph = helper.make_graph(
        nodes,
        "gru",
        [_value("features", [*sequence, weights.input[0].shape[0]]), _value("hidden_in", state)],
        [_value("hidden", [*sequence, weights.nodes]), _value("head", [*sequence, 1]), _value("hidden_out", state)],
        initializer=constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


def gru_from_onnx(model: onnx.ModelProto) -> GruWeights:
    """Return the weights inside a graph that ``gru_to_onnx`` made."""
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    layers = range(sum(1 for name in stored if name.endswith("_R")))
    biases = np.concatenate([stored[f"layer{layer}_B"] for layer in layers])
    half = biases.shape[1] // 2
    return GruWeights(
        tuple(np.ascontiguousarray(stored[f"layer{layer}_W"][0].T) for layer in layers),
        np.stack([np.ascontiguousarray(stored[f"layer{layer}_R"][0].T) for layer in layers]),
        np.ascontiguousarray(biases[:, :half]),
        np.ascontiguousarray(biases[:, half:]),
        np.ascontiguousarray(stored["head_weight"][:, 0]),
        float(stored["head_bias"][0]),
    )


def _value(name: str, shape: list[int | str]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)


class GruEstimator(SequenceEstimator):
    """A GRU that corrects the force balance, or gives all of friction where there are no pressures (Cho et al. 2014).

    ``architecture`` is an ``Architecture``: layers, nodes, dropout after each layer, highest learning rate.
    """

    kind: ClassVar[str] = "gru"
    architecture_type: ClassVar[type] = Architecture

    def make_network(self, inputs: int) -> torch.nn.Module:
        from friction_benchmark.models.sequence_networks import GruNetwork  # PyTorch: training alone waits for it

        return GruNetwork(self.architecture, inputs)

    def to_onnx(self, network: Any) -> onnx.ModelProto:
        return gru_to_onnx(gru_weights_of(network))

    def from_onnx(self, model: onnx.ModelProto) -> Gru:
        return Gru(gru_from_onnx(model))

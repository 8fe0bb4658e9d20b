"""The multilayer perceptron at run time: weights as plain arrays, one row after the other, stored as ONNX.

Layer by layer ``x <- f(x W + b)`` with f the hyperbolic tangent or the rectifier; the last layer is linear and has one
output. A row's output follows from that row alone, so cutting the rows into pieces changes no bit.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numba
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from cylinder_friction.realtime.activation import tanh

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    Single = NDArray[np.float32]

Activation = Literal["tanh", "relu"]
OPSET = 17
IR_VERSION = 8


@dataclass(frozen=True)
class Perceptron:
    """Weights of a perceptron.

    Attributes:
        kernels: One a layer, shape ``(nodes before, nodes)``, float32; the last has one column.
        biases: One a layer, shape ``(nodes,)``, float32.
        activation: After every layer but the last.

    Raises:
        ValueError: The layers do not fit each other, or there is not one output.
    """

    kernels: tuple[Single, ...]
    biases: tuple[Single, ...]
    activation: Activation

    def __post_init__(self) -> None:
        shapes = [kernel.shape for kernel in self.kernels]
        fit = all(before[1] == after[0] for before, after in itertools.pairwise(shapes))
        if not shapes or not fit or shapes[-1][1] != 1 or [len(bias) for bias in self.biases] != [s[1] for s in shapes]:
            raise ValueError(
                f"expected layers that fit each other and end in one output, but got kernels {shapes} and biases "
                f"{[bias.shape for bias in self.biases]}"
            )

    @property
    def inputs(self) -> int:
        return int(self.kernels[0].shape[0])

    def multiply_adds(self) -> int:
        """Return the multiply-adds of one row."""
        return sum(kernel.size for kernel in self.kernels)


class PerceptronRunner:
    """Runs a ``Perceptron`` over rows."""

    def __init__(self, weights: Perceptron) -> None:
        self.sizes = np.array([weights.inputs, *(kernel.shape[1] for kernel in weights.kernels)], dtype=np.int64)
        parts = [part.ravel() for pair in zip(weights.kernels, weights.biases, strict=True) for part in pair]
        self.flat = np.concatenate(parts).astype(np.float32)
        self.rectified = weights.activation == "relu"

    def run(self, rows: Single) -> Single:
        """Return the output, shape ``(n,)``, of rows, shape ``(n, inputs)``."""
        return _run(self.sizes, self.flat, self.rectified, np.ascontiguousarray(rows, dtype=np.float32))


@numba.njit(cache=True)
def _run(sizes: NDArray[np.int64], flat: Single, rectified: bool, rows: Single) -> Single:
    result = np.empty(rows.shape[0], dtype=np.float32)
    room = np.empty((2, sizes.max()), dtype=np.float32)
    for row in range(rows.shape[0]):
        result[row] = perceptron_step(sizes, flat, rectified, rows[row], room)
    return result


@numba.njit(cache=True)
def perceptron_step(
    sizes: NDArray[np.int64], flat: Single, rectified: bool, values: Single, room: Single
) -> np.float32:
    """Return the output of one row; ``room``, shape ``(2, widest)``, is written over."""
    place = 0
    for node in range(sizes[0]):
        room[0, node] = values[node]
    for layer in range(sizes.shape[0] - 1):
        before, nodes = sizes[layer], sizes[layer + 1]
        source, target = room[layer % 2], room[(layer + 1) % 2]
        bias = flat[place + before * nodes : place + (before + 1) * nodes]
        for node in range(nodes):
            target[node] = bias[node]
        for index in range(before):
            value, kernel = source[index], flat[place + index * nodes : place + (index + 1) * nodes]
            for node in range(nodes):
                target[node] += value * kernel[node]
        place += (before + 1) * nodes
        if layer < sizes.shape[0] - 2:
            for node in range(nodes):
                target[node] = max(target[node], np.float32(0.0)) if rectified else tanh(target[node])
    return room[(sizes.shape[0] - 1) % 2, 0]


def write_perceptron(path: Path, weights: Perceptron) -> None:
    """Write the checked graph: ``features`` (rows, inputs) to ``output`` (rows, 1), float32."""
    nodes: list[onnx.NodeProto] = []
    constants: list[onnx.TensorProto] = []
    source, last = "features", len(weights.kernels) - 1
    for layer, (kernel, bias) in enumerate(zip(weights.kernels, weights.biases, strict=True)):
        name = f"layer{layer}"
        constants += [_tensor(f"{name}_kernel", kernel), _tensor(f"{name}_bias", bias)]
        target = "output" if layer == last else f"{name}_sum"
        nodes.append(helper.make_node("Gemm", [source, f"{name}_kernel", f"{name}_bias"], [target]))
        if layer < last:
            kind = "Relu" if weights.activation == "relu" else "Tanh"
            nodes.append(helper.make_node(kind, [target], [f"{name}_output"]))
        source = f"{name}_output"
    graph = helper.make_graph(
        nodes,
        "perceptron",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["rows", weights.inputs])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, ["rows", 1])],
        initializer=constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def read_perceptron(path: Path) -> Perceptron:
    """Return the perceptron that ``write_perceptron`` wrote."""
    model = onnx.load(path)
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    layers = range(len(stored) // 2)
    rectified = any(node.op_type == "Relu" for node in model.graph.node)
    return Perceptron(
        _all(stored[f"layer{layer}_kernel"] for layer in layers),
        _all(stored[f"layer{layer}_bias"] for layer in layers),
        "relu" if rectified else "tanh",
    )


def _all(arrays: Iterable[Single]) -> tuple[Single, ...]:
    return tuple(np.ascontiguousarray(array, dtype=np.float32) for array in arrays)


def _tensor(name: str, values: Single) -> onnx.TensorProto:
    return numpy_helper.from_array(np.ascontiguousarray(values, dtype=np.float32), name)

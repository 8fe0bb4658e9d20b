"""The LSTM at run time: weights as plain arrays, one step after the other, state carried.

Cell (Hochreiter and Schmidhuber 1997, with forget gate of Gers et al. 2000), gates in ONNX order i, o, f, c:

    i, o, f = sigmoid(W x + R h + b);  g = tanh(W x + R h + b);  c = f c + i g;  h = o tanh(c)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Single = NDArray[np.float32]


@dataclass(frozen=True)
class LstmWeights:
    """Weights of a stack of LSTM layers of equal width, and of the linear head on its last hidden state.

    Attributes:
        input: Shape ``(layers, widest input, 4 · nodes)``; rows past a layer's inputs are zero and not used.
        recurrent: Shape ``(layers, nodes, 4 · nodes)``.
        bias: Shape ``(layers, 4 · nodes)``.
        head: Shape ``(nodes,)``.
        head_bias: Added to the head's output.
        inputs: Number of features that the first layer takes.
    """

    input: Single
    recurrent: Single
    bias: Single
    head: Single
    head_bias: float
    inputs: int

    @property
    def layers(self) -> int:
        return int(self.recurrent.shape[0])

    @property
    def nodes(self) -> int:
        return int(self.recurrent.shape[1])

    def multiply_adds(self) -> int:
        """Returns the multiply-adds of one step, the head included."""
        return lstm_multiply_adds(self.layers, self.nodes, self.inputs)


def lstm_multiply_adds(layers: int, nodes: int, inputs: int) -> int:
    """Returns the multiply-adds of one step of such a stack with a linear head."""
    first = 4 * nodes * (inputs + nodes)
    others = (layers - 1) * 4 * nodes * (nodes + nodes)
    return first + others + layers * 3 * nodes + nodes


@dataclass
class LstmState:
    """Hidden and cell state, each shape ``(layers, nodes)``; zero before the first sample."""

    hidden: Single
    cell: Single


class Lstm:
    """Runs ``LstmWeights`` over features; a ``CausalBlock`` with two outputs."""

    def __init__(self, weights: LstmWeights) -> None:
        self.weights = weights

    def new_state(self) -> LstmState:
        shape = (self.weights.layers, self.weights.nodes)
        return LstmState(np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32))

    def advance(self, state: LstmState, features: Single) -> tuple[Single, Single]:
        """Returns the last layer's hidden states, shape ``(n, nodes)``, and the head's output, shape ``(n,)``."""
        w = self.weights
        hidden = _run(w.input, w.recurrent, w.bias, w.inputs, features, state.hidden, state.cell)
        return hidden, _head(hidden, w.head, w.head_bias)


@numba.njit(cache=True)
def _sigmoid(x: np.float32) -> np.float32:
    return np.float32(1.0) / (np.float32(1.0) + math.exp(-x))


@numba.njit(cache=True)
def _run(
    input_weights: Single, recurrent: Single, bias: Single, inputs: int, features: Single, hidden: Single, cell: Single
) -> Single:
    layers, nodes = hidden.shape
    width = 4 * nodes
    result = np.empty((features.shape[0], nodes), dtype=np.float32)
    gates = np.empty(width, dtype=np.float32)
    for row in range(features.shape[0]):
        for layer in range(layers):
            for gate in range(width):
                gates[gate] = bias[layer, gate]
            if layer == 0:
                for source in range(inputs):
                    value = features[row, source]
                    for gate in range(width):
                        gates[gate] += input_weights[0, source, gate] * value
            else:
                for source in range(nodes):
                    value = hidden[layer - 1, source]
                    for gate in range(width):
                        gates[gate] += input_weights[layer, source, gate] * value
            for source in range(nodes):
                value = hidden[layer, source]
                for gate in range(width):
                    gates[gate] += recurrent[layer, source, gate] * value
            for node in range(nodes):
                let_in = _sigmoid(gates[node])
                let_out = _sigmoid(gates[nodes + node])
                keep = _sigmoid(gates[2 * nodes + node])
                new = math.tanh(gates[3 * nodes + node])
                cell[layer, node] = keep * cell[layer, node] + let_in * new
                hidden[layer, node] = let_out * math.tanh(cell[layer, node])
        for node in range(nodes):
            result[row, node] = hidden[layers - 1, node]
    return result


@numba.njit(cache=True)
def _head(hidden: Single, head: Single, bias: float) -> Single:
    result = np.empty(hidden.shape[0], dtype=np.float32)
    for row in range(hidden.shape[0]):
        total = np.float32(bias)
        for node in range(hidden.shape[1]):
            total += hidden[row, node] * head[node]
        result[row] = total
    return result

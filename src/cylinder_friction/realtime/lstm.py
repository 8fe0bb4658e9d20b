"""The LSTM at run time: weights as plain arrays, one step after the other, state carried.

Cell (Hochreiter and Schmidhuber 1997, with forget gate of Gers et al. 2000), gates in ONNX order i, o, f, c:

    i, o, f = sigmoid(W x + R h + b);  g = tanh(W x + R h + b);  c = f c + i g;  h = o tanh(c)

A state below 1e-30 becomes 0: a forgotten cell that sinks among the denormal numbers would slow every later step.

Hyperbolic tangent and logistic function are made from additions, multiplications and one division, which give the same
bits on every machine and which a compiler applies to eight numbers at once. The mathematics library's ``tanhf`` and
``expf`` differ between machines in the last bit, and work on one number at a time.

``tanh(x) = x P(x²) / Q(x²)`` for ``|x| <= 9``; beyond, ``tanh(9)``, which is 1 in single precision. P and Q are the
best fit of degree 4 in x² by relative error (linear programming on 4001 Chebyshev points, reweighted by Q until it
settled); the error is 3.6e-8 in exact arithmetic and below 4e-7 in single precision.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled, compiled_part

TANH_LIMIT = np.float32(9.0)
TANH_NUMERATOR = tuple(
    np.float32(c)
    for c in (
        0.9999999901734871,
        0.13377816865412961,
        0.0034915419522528243,
        2.0533321597830663e-05,
        1.3234345801820099e-08,
    )
)
TANH_DENOMINATOR = tuple(
    np.float32(c)
    for c in (1.0, 0.4671113755793197, 0.025862203539402134, 0.00032786127125529214, 7.730435216790898e-07)
)
HALF = np.float32(0.5)
_P0, _P1, _P2, _P3, _P4 = TANH_NUMERATOR
_Q0, _Q1, _Q2, _Q3, _Q4 = TANH_DENOMINATOR


@partial(compiled, inline="always")
def tanh(x: np.float32) -> np.float32:
    """Compute tanh of a finite number, float32 in and out."""
    x = min(max(x, -TANH_LIMIT), TANH_LIMIT)
    square = x * x
    numerator = (((_P4 * square + _P3) * square + _P2) * square + _P1) * square + _P0
    denominator = (((_Q4 * square + _Q3) * square + _Q2) * square + _Q1) * square + _Q0
    return x * numerator / denominator


@partial(compiled, inline="always")
def sigmoid(x: np.float32) -> np.float32:
    """Compute ``1 / (1 + exp(-x))`` of a finite number, float32 in and out, by ``(1 + tanh(x / 2)) / 2``."""
    return HALF * tanh(HALF * x) + HALF


Single = NDArray[np.float32]
Layers = Sequence[Single]

TINY = np.float32(1e-30)
ZERO = np.float32(0.0)
AT_A_TIME = 8  # Number of products that are added to a sum before it is stored


@dataclass(frozen=True)
class LstmWeights:
    """Weights of a stack of LSTM layers of equal width, and of the linear head on its last hidden state."""

    input: Single  # Shape ``(layers, widest input, 4 · nodes)``; rows past a layer's inputs are zero and not used
    recurrent: Single  # Shape ``(layers, nodes, 4 · nodes)``
    bias: Single  # Shape ``(layers, 4 · nodes)``
    head: Single  # Shape ``(nodes,)``
    head_bias: float  # Added to the head's output
    inputs: int  # Number of features that the first layer takes

    @classmethod
    def of(cls, kernels: Layers, recurrent: Layers, bias: Layers, head: Single, head_bias: float) -> Self:
        """Stack the weights of layers, given one entry per layer: input ``(inputs, 4 · nodes)``, recurrent, bias."""
        padded = np.zeros((len(kernels), max(map(len, kernels)), len(bias[0])), dtype=np.float32)
        for layer, kernel in enumerate(kernels):
            padded[layer, : len(kernel)] = kernel
        stacked = np.ascontiguousarray(np.stack(recurrent))
        return cls(padded, stacked, np.stack(bias), np.ascontiguousarray(head), head_bias, len(kernels[0]))

    @property
    def layers(self) -> int:
        return int(self.recurrent.shape[0])

    @property
    def nodes(self) -> int:
        return int(self.recurrent.shape[1])

    def multiply_adds(self) -> int:
        """Count the multiply-adds of one step, the head included."""
        return lstm_multiply_adds(self.layers, self.nodes, self.inputs)

    def run(self, features: Single) -> tuple[Single, Single]:
        """Compute the last layer's hidden states, shape ``(n, nodes)``, and the head's outputs, from a fresh state."""
        return _run(self.input, self.recurrent, self.bias, self.inputs, self.head, self.head_bias, features)


def lstm_multiply_adds(layers: int, nodes: int, inputs: int) -> int:
    """Count the multiply-adds of one step of an LSTM stack with a linear head."""
    first = 4 * nodes * (inputs + nodes)
    others = (layers - 1) * 4 * nodes * (nodes + nodes)
    return first + others + layers * 3 * nodes + nodes


_NOTHING = np.zeros((0, 0, 0), dtype=np.float32)
NO_NETWORK = LstmWeights(_NOTHING, _NOTHING, _NOTHING.reshape(0, 0), _NOTHING.ravel(), 0.0, 0)


@compiled
def _run(
    input_weights: Single,
    recurrent: Single,
    bias: Single,
    inputs: int,
    head: Single,
    head_bias: float,
    features: Single,
) -> tuple[Single, Single]:
    rows, layers, nodes = features.shape[0], recurrent.shape[0], recurrent.shape[1]
    hidden, cell = np.zeros((layers, nodes), dtype=np.float32), np.zeros((layers, nodes), dtype=np.float32)
    gates = np.empty(4 * nodes, dtype=np.float32)
    last, output = np.empty((rows, nodes), dtype=np.float32), np.empty(rows, dtype=np.float32)
    for row in range(rows):
        lstm_step(input_weights, recurrent, bias, inputs, features[row], hidden, cell, gates)
        last[row] = hidden[-1]
        output[row] = head_of(hidden[-1], head, head_bias)
    return last, output


@compiled_part
def lstm_step(
    input_weights: Single,
    recurrent: Single,
    bias: Single,
    inputs: int,
    features: Single,
    hidden: Single,
    cell: Single,
    gates: Single,
) -> None:
    """Take one step of the whole stack: update ``hidden`` and ``cell``; ``gates`` is a buffer of ``4 nodes``."""
    layers, nodes = hidden.shape
    for layer in range(layers):
        for gate in range(4 * nodes):
            gates[gate] = bias[layer, gate]
        sources, count = (features, inputs) if layer == 0 else (hidden[layer - 1], nodes)
        add_product(gates, input_weights[layer], sources, count)
        add_product(gates, recurrent[layer], hidden[layer], nodes)
        _cell_step(gates, hidden[layer], cell[layer])


@compiled_part
def add_product(sums: Single | Array, weights: Single | Array, values: Single | Array, count: int) -> None:
    """Add ``weights[source] * values[source]`` to the sums, source after source, eight at a time for speed."""
    eights = count - count % AT_A_TIME
    for source in range(0, eights, AT_A_TIME):
        one, two, three, four = values[source], values[source + 1], values[source + 2], values[source + 3]
        five, six, seven, eight = values[source + 4], values[source + 5], values[source + 6], values[source + 7]
        for place in range(sums.shape[0]):
            total = sums[place] + weights[source, place] * one
            total += weights[source + 1, place] * two
            total += weights[source + 2, place] * three
            total += weights[source + 3, place] * four
            total += weights[source + 4, place] * five
            total += weights[source + 5, place] * six
            total += weights[source + 6, place] * seven
            sums[place] = total + weights[source + 7, place] * eight
    for source in range(eights, count):
        value = values[source]
        for place in range(sums.shape[0]):
            sums[place] += weights[source, place] * value


@partial(compiled_part, error_model="numpy")  # Python's model checks before each division, one number at a time
def _cell_step(gates: Single, hidden: Single, cell: Single) -> None:
    nodes = hidden.shape[0]
    logistic, candidates = gates[: 3 * nodes], gates[3 * nodes :]
    for gate in range(logistic.shape[0]):
        logistic[gate] = sigmoid(logistic[gate])
    for node in range(candidates.shape[0]):
        candidates[node] = tanh(candidates[node])
    inputs, outputs, kept = logistic[:nodes], logistic[nodes : 2 * nodes], logistic[2 * nodes :]
    for node in range(nodes):
        new = kept[node] * cell[node] + inputs[node] * candidates[node]
        cell[node] = new if abs(new) >= TINY else ZERO
    for node in range(nodes):
        out = outputs[node] * tanh(cell[node])
        hidden[node] = out if abs(out) >= TINY else ZERO


@compiled_part
def head_of(hidden: Single, head: Single, bias: float | np.float32) -> np.float32:
    """Compute the linear head's output for one hidden state."""

    total = np.float32(bias)
    for node in range(hidden.shape[0]):
        total += hidden[node] * head[node]
    return total

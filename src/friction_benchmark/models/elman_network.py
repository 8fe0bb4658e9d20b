"""The modified Elman network: its step, and its cost and gradient over many sequences side by side.

``x_c(k) = x(k-1) + a x_c(k-1)``, ``x(k) = tanh(u(k) W_u + x_c(k) W_c + b)``, ``y(k) = x(k) w + b_o``: Elman 1990 with
the context's self-feedback a of Pham and Liu 1992. All weights lie in one vector, in the order W_u, W_c, b, w, b_o.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.realtime.activation import tanh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Single = NDArray[np.float32]

KNEE = np.float32(0.05)
"""Error, in standard deviations of the target, below which the cost turns from absolute to square."""
ZERO, ONE = np.float32(0.0), np.float32(1.0)


def weight_count(inputs: int, nodes: int) -> int:
    """Return how many weights such a network has; as many are the multiply-adds of a step, its biases left in."""
    return nodes * (inputs + nodes + 2) + 1


@dataclass(frozen=True)
class Batch:
    """Sequences side by side, all of one length, float32.

    Attributes:
        inputs: Shape ``(steps, inputs, sequences)``.
        target: Shape ``(steps, sequences)``.
        weight: Shape ``(steps, sequences)``; 0 where a step is not scored, 1 where it is.
    """

    inputs: Single
    target: Single
    weight: Single

    @property
    def rows(self) -> int:
        """Step of all sequences together, scored or not: what one evaluation of the network costs."""
        return int(self.target.size)


def cost(weights: NDArray[np.float64], nodes: int, feedback: float, batch: Batch) -> float:
    """Return the mean of ``sqrt(e² + knee²) - knee`` over the scored steps; context starts at zero."""
    return float(_cost(weights.astype(np.float32), nodes, np.float32(feedback), *_arrays(batch)))


def cost_and_gradient(
    weights: NDArray[np.float64], nodes: int, feedback: float, batch: Batch
) -> tuple[float, NDArray[np.float64]]:
    """Return the cost and its gradient by every weight, back through the whole sequence (Werbos 1990)."""
    value, gradient = _gradient(weights.astype(np.float32), nodes, np.float32(feedback), *_arrays(batch))
    return float(value), gradient.astype(np.float64)


def _arrays(batch: Batch) -> tuple[Single, Single, Single]:
    return batch.inputs, batch.target, batch.weight


@numba.njit(cache=True)
def elman_step(weights: Single, feedback: np.float32, row: Single, hidden: Single, context: Single) -> np.float32:
    """Take one step: changes ``hidden`` and ``context``, each shape ``(nodes,)``; returns the output."""
    nodes, inputs = hidden.shape[0], row.shape[0]
    recurrent = inputs * nodes
    bias = recurrent + nodes * nodes
    for node in range(nodes):
        context[node] = hidden[node] + feedback * context[node]
    output = weights[bias + 2 * nodes]
    for node in range(nodes):
        total = weights[bias + node]
        for index in range(inputs):
            total += row[index] * weights[index * nodes + node]
        for index in range(nodes):
            total += context[index] * weights[recurrent + index * nodes + node]
        hidden[node] = tanh(total)
        output += hidden[node] * weights[bias + nodes + node]
    return output


@numba.njit(cache=True)
def _hidden_step(
    weights: Single, feedback: np.float32, rows: Single, before: Single, context: Single, hidden: Single
) -> None:
    """Step all sequences: changes ``context``, writes ``hidden``, each shape ``(nodes, sequences)``."""
    nodes, count = hidden.shape
    inputs = rows.shape[0]
    recurrent = inputs * nodes
    bias = recurrent + nodes * nodes
    for node in range(nodes):
        for lane in range(count):
            context[node, lane] = before[node, lane] + feedback * context[node, lane]
    for node in range(nodes):
        line = hidden[node]
        start = weights[bias + node]
        for lane in range(count):
            line[lane] = start
        for index in range(inputs):
            factor, source = weights[index * nodes + node], rows[index]
            for lane in range(count):
                line[lane] += factor * source[lane]
        for index in range(nodes):
            factor, source = weights[recurrent + index * nodes + node], context[index]
            for lane in range(count):
                line[lane] += factor * source[lane]
        for lane in range(count):
            line[lane] = tanh(line[lane])


@numba.njit(cache=True)
def _output(weights: Single, hidden: Single, line: Single) -> None:
    nodes, count = hidden.shape
    head = weights.shape[0] - 1 - nodes
    for lane in range(count):
        line[lane] = weights[-1]
    for node in range(nodes):
        factor = weights[head + node]
        for lane in range(count):
            line[lane] += factor * hidden[node, lane]


@numba.njit(cache=True)
def _cost(weights: Single, nodes: int, feedback: np.float32, inputs: Single, target: Single, weight: Single) -> float:
    steps, count = target.shape
    hidden = np.zeros((2, nodes, count), dtype=np.float32)
    context = np.zeros((nodes, count), dtype=np.float32)
    line, sums = np.empty(count, dtype=np.float32), np.zeros(count, dtype=np.float32)
    scored = 0.0
    for step in range(steps):
        now = hidden[step % 2]
        _hidden_step(weights, feedback, inputs[step], hidden[(step + 1) % 2], context, now)
        _output(weights, now, line)
        for lane in range(count):
            error = line[lane] - target[step, lane]
            sums[lane] += weight[step, lane] * (np.sqrt(error * error + KNEE * KNEE) - KNEE)
            scored += weight[step, lane]
    return float(sums.sum()) / scored


@numba.njit(cache=True)
def _forward(weights: Single, nodes: int, feedback: np.float32, inputs: Single) -> tuple[Single, Single, Single]:
    """Return hidden nodes and context after each step and before the first, and the outputs."""
    steps, count = inputs.shape[0], inputs.shape[2]
    hidden = np.zeros((steps + 1, nodes, count), dtype=np.float32)
    contexts = np.zeros((steps + 1, nodes, count), dtype=np.float32)
    output = np.empty((steps, count), dtype=np.float32)
    for step in range(steps):
        contexts[step + 1] = contexts[step]
        _hidden_step(weights, feedback, inputs[step], hidden[step], contexts[step + 1], hidden[step + 1])
        _output(weights, hidden[step + 1], output[step])
    return hidden, contexts, output


@numba.njit(cache=True)
def _gradient(
    weights: Single, nodes: int, feedback: np.float32, inputs: Single, target: Single, weight: Single
) -> tuple[float, Single]:
    hidden, contexts, output = _forward(weights, nodes, feedback, inputs)
    steps, width, count = inputs.shape
    recurrent, bias = width * nodes, (width + nodes) * nodes
    gradient = np.zeros(weights.shape[0], dtype=np.float32)
    through = np.zeros((nodes, count), dtype=np.float32)  # cost's gradient by the context that a step leaves behind
    inner, slope = np.empty((nodes, count), dtype=np.float32), np.empty(count, dtype=np.float32)
    total = 0.0
    for step in range(steps - 1, -1, -1):
        for lane in range(count):
            error = output[step, lane] - target[step, lane]
            root = np.sqrt(error * error + KNEE * KNEE)
            total += weight[step, lane] * (root - KNEE)
            slope[lane] = weight[step, lane] * error / root
            gradient[-1] += slope[lane]
        for node in range(nodes):
            factor, value, into = weights[bias + nodes + node], hidden[step + 1, node], inner[node]
            for lane in range(count):
                into[lane] = (factor * slope[lane] + through[node, lane]) * (ONE - value[lane] * value[lane])
            gradient[bias + nodes + node] += _dot(slope, value)
            gradient[bias + node] += into.sum()
            for index in range(width):
                gradient[index * nodes + node] += _dot(inputs[step, index], into)
            for index in range(nodes):
                gradient[recurrent + index * nodes + node] += _dot(contexts[step + 1, index], into)
        for index in range(nodes):
            for lane in range(count):
                through[index, lane] *= feedback
            for node in range(nodes):
                factor = weights[recurrent + index * nodes + node]
                for lane in range(count):
                    through[index, lane] += factor * inner[node, lane]
    scored = weight.sum()
    return total / scored, gradient / scored


@numba.njit(cache=True, fastmath=True)
def _dot(one: Single, other: Single) -> np.float32:
    total = ZERO
    for lane in range(one.shape[0]):
        total += one[lane] * other[lane]
    return total

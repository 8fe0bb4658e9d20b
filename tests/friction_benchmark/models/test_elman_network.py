"""The Elman network's step, cost and gradient against each other and against the equations written out."""

from __future__ import annotations

import numpy as np
import pytest

from friction_benchmark.models.elman_network import Batch, cost, cost_and_gradient, elman_step, weight_count

INPUTS, NODES, FEEDBACK = 3, 4, 0.4


def made_batch(steps: int = 30, sequences: int = 5) -> Batch:
    generator = np.random.default_rng(0)
    weight = np.ones((steps, sequences), dtype=np.float32)
    weight[:5], weight[12, 2] = 0.0, 0.0
    return Batch(
        generator.normal(size=(steps, INPUTS, sequences)).astype(np.float32),
        generator.normal(size=(steps, sequences)).astype(np.float32),
        weight,
    )


def made_weights() -> np.ndarray:
    return 0.5 * np.random.default_rng(1).normal(size=weight_count(INPUTS, NODES))


def outputs_by_hand(weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
    edges = np.cumsum([INPUTS * NODES, NODES * NODES, NODES, NODES])
    of_input, of_context, bias, head, last = np.split(weights, edges)
    hidden, context, result = np.zeros(NODES), np.zeros(NODES), []
    for row in rows:
        context = hidden + FEEDBACK * context
        hidden = np.tanh(row @ of_input.reshape(INPUTS, NODES) + context @ of_context.reshape(NODES, NODES) + bias)
        result.append(float(hidden @ head + last[0]))
    return np.array(result)


def test_the_step_is_the_equation() -> None:
    rows = made_batch().inputs[:, :, 0]
    hidden, context = np.zeros(NODES, dtype=np.float32), np.zeros(NODES, dtype=np.float32)
    weights = made_weights()
    stepped = [
        elman_step(weights.astype(np.float32), np.float32(FEEDBACK), np.ascontiguousarray(row), hidden, context)
        for row in rows
    ]
    np.testing.assert_allclose(stepped, outputs_by_hand(weights, rows), atol=2e-5)


def test_the_cost_is_the_rounded_absolute_error_of_the_scored_steps() -> None:
    batch, weights = made_batch(), made_weights()
    outputs = np.stack([outputs_by_hand(weights, batch.inputs[:, :, lane]) for lane in range(5)], axis=1)
    error = (outputs - batch.target)[batch.weight > 0.0]
    expected = float(np.mean(np.sqrt(error**2 + 0.05**2) - 0.05))
    assert cost(weights, NODES, FEEDBACK, batch) == pytest.approx(expected, rel=1e-5)


def test_the_gradient_is_that_of_the_cost() -> None:
    batch, weights = made_batch(), made_weights()
    value, gradient = cost_and_gradient(weights, NODES, FEEDBACK, batch)
    assert value == pytest.approx(cost(weights, NODES, FEEDBACK, batch), rel=1e-5)
    small = 3e-3
    numeric = [
        (cost(weights + small * axis, NODES, FEEDBACK, batch) - cost(weights - small * axis, NODES, FEEDBACK, batch))
        / (2.0 * small)
        for axis in np.eye(len(weights))
    ]
    np.testing.assert_allclose(gradient, numeric, atol=5e-4)


def test_what_is_not_scored_does_not_count() -> None:
    batch, weights = made_batch(), made_weights()
    changed = batch.target.copy()
    changed[batch.weight == 0.0] += 100.0
    other = Batch(batch.inputs, changed, batch.weight)
    assert cost(weights, NODES, FEEDBACK, other) == cost(weights, NODES, FEEDBACK, batch)
    np.testing.assert_array_equal(
        cost_and_gradient(weights, NODES, FEEDBACK, other)[1], cost_and_gradient(weights, NODES, FEEDBACK, batch)[1]
    )

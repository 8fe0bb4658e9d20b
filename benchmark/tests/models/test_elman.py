"""The Elman network's step and cost against the equations written out, and its two ways of training."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from friction_benchmark.models.elman import (
    GRADIENT_EVALUATIONS,
    Batch,
    ElmanEstimator,
    ElmanPlan,
    elman_outputs,
    mean_cost,
    weight_count,
)

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

INPUTS, NODES, FEEDBACK = 3, 4, 0.4


def made_batch(steps: int = 30, sequences: int = 5) -> Batch:
    generator = np.random.default_rng(0)
    weight = np.ones((steps, sequences))
    weight[:5], weight[12, 2] = 0.0, 0.0
    inputs, target = generator.normal(size=(steps, sequences, INPUTS)), generator.normal(size=(steps, sequences))
    return Batch(*(torch.from_numpy(part) for part in (inputs, target, weight)))


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


def test_the_step_is_the_equation_and_its_output_is_held() -> None:
    rows, weights = made_batch().inputs[:, 0].numpy(), made_weights()
    state = (np.zeros(NODES, np.float32), np.zeros(NODES, np.float32), np.zeros(2))
    every_second = np.repeat(rows, 2, axis=0).astype(np.float32)
    outputs = elman_outputs(weights.astype(np.float32), np.float32(FEEDBACK), every_second, *state, 2)
    np.testing.assert_allclose(outputs, np.repeat(outputs_by_hand(weights, rows), 2), atol=2e-5)


def test_the_cost_is_the_smoothed_absolute_error_of_the_scored_steps() -> None:
    batch, weights = made_batch(), made_weights()
    outputs = np.stack([outputs_by_hand(weights, batch.inputs[:, lane].numpy()) for lane in range(5)], axis=1)
    error = (outputs - batch.target.numpy())[batch.weight.numpy() > 0.0]
    expected = float(np.mean(np.sqrt(error**2 + 0.05**2) - 0.05))
    assert float(mean_cost(torch.from_numpy(weights), NODES, FEEDBACK, batch)) == pytest.approx(expected, rel=1e-12)


def test_what_is_not_scored_does_not_count() -> None:
    batch, weights = made_batch(), torch.from_numpy(made_weights()).requires_grad_()
    other = replace(batch, target=torch.where(batch.weight == 0.0, batch.target + 100.0, batch.target))
    costs = [mean_cost(weights, NODES, FEEDBACK, each) for each in (batch, other)]
    assert costs[0].item() == costs[1].item()
    assert torch.equal(*(torch.autograd.grad(cost, weights)[0] for cost in costs))


def test_the_networks_differ_in_training_alone_and_spend_the_same(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    made_by = {}
    for trainer in ("swarm", "adam"):
        estimator = ElmanEstimator(cylinder, ("position_m",), ElmanPlan(trainer=trainer, evaluations=60))
        estimator.fit(labelled_recordings)
        made_by[trainer] = estimator
    swarm, adam = made_by["swarm"], made_by["adam"]
    assert swarm.found is not None
    assert adam.found is not None
    assert swarm.found.evaluations == adam.found.evaluations == 60
    assert 60 % GRADIENT_EVALUATIONS == 0
    assert swarm.multiply_adds() == adam.multiply_adds()
    assert len(swarm.found.position) == len(adam.found.position)
    assert adam.found.cost < swarm.found.cost


def test_an_impossible_plan_is_refused() -> None:
    with pytest.raises(ValueError, match="expected nodes and evaluations of at least 1 and feedback in"):
        ElmanPlan(feedback=1.0)

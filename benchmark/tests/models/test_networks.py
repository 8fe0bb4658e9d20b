"""The networks against their equations, and against what they must learn."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch
from torch import nn

from cylinder_friction.estimators.training import train_network
from cylinder_friction.estimators.training_plan import Architecture, SequenceData, TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.elman import Batch, Elman, network_outputs, weight_count
from friction_benchmark.models.gru import GruNetwork
from friction_benchmark.models.han import drawn_parameters, generic_parameters, synthetic_friction
from friction_benchmark.models.lagged import Past
from friction_benchmark.models.sequence_network import SequenceModel
from friction_benchmark.models.tcn import TcnNetwork, levels_for
from friction_benchmark.models.training import minimise, outputs, perceptron, weights_in
from friction_benchmark.models.velocity_window import EVERY, SPANS, windows
from friction_benchmark.registry import BuildConfiguration, registered_models

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

INPUTS, NODES, FEEDBACK = 3, 4, 0.4


def made_batch(steps: int = 30, sequences: int = 5) -> Batch:
    generator = np.random.default_rng(0)
    weight = np.ones((steps, sequences))
    weight[:5], weight[12, 2] = 0.0, 0.0
    inputs, target = generator.normal(size=(steps, sequences, INPUTS)), generator.normal(size=(steps, sequences))
    return Batch(*(torch.from_numpy(part) for part in (inputs, target, weight)))


def by_hand(weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
    edges = np.cumsum([INPUTS * NODES, NODES * NODES, NODES, NODES])
    of_input, of_context, bias, head, last = np.split(weights, edges)
    hidden, context, result = np.zeros(NODES), np.zeros(NODES), []
    for row in rows:
        context = hidden + FEEDBACK * context
        hidden = np.tanh(row @ of_input.reshape(INPUTS, NODES) + context @ of_context.reshape(NODES, NODES) + bias)
        result.append(float(hidden @ head + last[0]))
    return np.array(result)


def elman(cylinder: Cylinder, name: str = "elman_adam") -> Elman:
    model = registered_models()[name]
    chosen = {**model.defaults, "nodes": NODES, "feedback": FEEDBACK}
    estimator = model.build(BuildConfiguration(cylinder, ("position_m",), 0, 60 / 16_000, chosen))
    assert isinstance(estimator, Elman)
    return estimator


def test_the_elman_network_is_its_equation() -> None:
    weights = 0.5 * np.random.default_rng(1).normal(size=weight_count(INPUTS, NODES))
    batch = made_batch()
    found = network_outputs(torch.from_numpy(weights), NODES, FEEDBACK, batch.inputs).numpy()
    expected = [by_hand(weights, batch.inputs[:, lane].numpy()) for lane in range(5)]
    np.testing.assert_allclose(found, np.stack(expected, axis=1), rtol=1e-10)


def test_the_cost_is_the_smoothed_absolute_error_of_the_scored_steps_alone(cylinder: Cylinder) -> None:
    batch = made_batch()
    weights = torch.from_numpy(0.5 * np.random.default_rng(1).normal(size=weight_count(INPUTS, NODES)))
    error = (network_outputs(weights, NODES, FEEDBACK, batch.inputs) - batch.target).numpy()[batch.weight.numpy() > 0.0]
    cost = partial(elman(cylinder)._cost, weights)
    assert float(cost(batch)) == pytest.approx(float(np.mean(np.sqrt(error**2 + 0.05**2) - 0.05)), rel=1e-12)
    other = replace(batch, target=torch.where(batch.weight == 0.0, batch.target + 100.0, batch.target))
    assert float(cost(other)) == float(cost(batch))


def test_swarm_and_gradient_spend_the_same_evaluations_on_the_same_network(
    cylinder: Cylinder, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, cost_of_one in (("pan_elman", 1), ("elman_adam", 3)):
        model, calls = elman(cylinder, name), []
        cost = model._cost

        def counted(*given: Any, calls: list[int] = calls, cost: Any = cost) -> torch.Tensor:
            calls.append(1)
            return cost(*given)

        monkeypatch.setattr(model, "_cost", counted)
        model.fit(labelled_recordings[:2])
        assert cost_of_one * len(calls) == 60, name


def test_minimising_finds_the_minimum_and_refuses_a_loss_that_is_no_number() -> None:
    weights = torch.zeros(2, requires_grad=True)

    def losses(factor: float) -> Iterator[tuple[float, torch.Tensor]]:
        for step in range(200):
            yield step / 200, factor * ((weights - torch.tensor([1.0, -2.0])) ** 2).sum()

    minimise([weights], losses(1.0), 0.1)
    assert weights.tolist() == pytest.approx([1.0, -2.0], abs=0.02)
    with pytest.raises(FloatingPointError, match=r"the error is nan; lower the learning rate 0\.1"):
        minimise([weights], losses(float("nan")), 0.1)


def test_a_perceptron_is_layers_with_activations_between() -> None:
    network = perceptron(5, [7, 3], nn.Tanh)
    assert [type(layer).__name__ for layer in network] == ["Linear", "Tanh", "Linear", "Tanh", "Linear"]
    assert weights_in(network) == 5 * 7 + 7 * 3 + 3
    rows = np.random.default_rng(1).normal(size=(50, 5)).astype(np.float32)
    assert outputs(network, rows).shape == (50,)


def test_the_generic_cylinder_is_passive_and_its_draws_stay_near(cylinder: Cylinder) -> None:
    centre = generic_parameters(cylinder)
    assert centre.is_passive()
    assert centre.static_n == pytest.approx(1.2e5 * cylinder.piston_area_m2)
    draws = [drawn_parameters(centre, 0.4, np.random.default_rng(seed)) for seed in range(200)]
    ratios = np.array([draw.coulomb_n / centre.coulomb_n for draw in draws])
    assert 0.6 <= ratios.min() < 0.65
    assert 1.35 < ratios.max() <= 1.4
    assert all(draw.static_n >= draw.coulomb_n and draw.retract_ratio >= 1.0 for draw in draws)
    friction = synthetic_friction(centre, np.full(400, 0.05), 0.005)
    assert friction[-1] == pytest.approx(float(centre.curve.friction(np.array([0.05]))[0]), rel=1e-6)


def test_without_fine_tuning_no_label_is_learnt_from(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    model = registered_models()["han_zero_shot"]
    other = [r.with_columns(friction_n=7.0 - 3.0 * r.column("friction_n")) for r in labelled_recordings]
    estimates = []
    for recordings in (labelled_recordings, other):
        estimator = model.build(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 0, 0.003, model.defaults))
        estimator.fit(recordings)
        estimates.append(estimator.estimate(labelled_recordings[0]))
    np.testing.assert_array_equal(*estimates)


def test_the_window_holds_means_over_growing_spans() -> None:
    velocity = 0.05 * np.arange(1.0, EVERY * int(SPANS.sum()) + 1.0)
    window = windows(velocity)
    assert len(window) == SPANS.sum()
    seen = velocity[::EVERY][::-1]
    edges = np.concatenate([[0], np.cumsum(SPANS)])
    means = [seen[start:end].mean() / 0.05 for start, end in itertools.pairwise(edges)]
    np.testing.assert_allclose(window[-1, : len(SPANS)], means, rtol=1e-5)
    np.testing.assert_allclose(window[0, 1 : len(SPANS)], 0.0, atol=1e-12)


def test_the_past_is_earlier_rows_and_slow_averages() -> None:
    rows = np.random.default_rng(1).normal(size=(200, 2)).astype(np.float32)
    past = Past(lags=(1, 5), averages=(20.0,))
    found = past.of(rows)
    assert found.shape == (200, past.width(2)) == (200, 8)
    np.testing.assert_array_equal(found[:, :2], rows)
    np.testing.assert_array_equal(found[1:, 2:4], rows[:-1])
    np.testing.assert_array_equal(found[:5, 4:6], np.repeat(rows[:1], 5, axis=0))
    settled = past.of(np.ones((200, 1), dtype=np.float32))[:, 3]
    assert settled[19] == pytest.approx(1.0 - np.exp(-1.0), abs=0.02)
    assert settled[-1] == pytest.approx(1.0, abs=1e-3)


def gru_of(inputs: int) -> nn.Module:
    return GruNetwork(Architecture(1, 16, 0.0, 1e-2), inputs)


def tcn_of(inputs: int) -> nn.Module:
    return TcnNetwork(2, 12, 3, 0.0, inputs)


def delayed_sequences(count: int, seed: int, delay: int = 6) -> list[SequenceData]:
    """The target is the feature of some samples before: only a network with memory can learn it."""
    generator = np.random.default_rng(seed)
    result = []
    for _ in range(count):
        feature = np.repeat(generator.normal(size=120), 5).astype(np.float32)
        target = np.concatenate([np.zeros(delay, dtype=np.float32), feature[:-delay]])
        result.append(SequenceData(feature[:, None], target, np.ones(600, dtype=bool)))
    return result


@pytest.mark.parametrize("make", [gru_of, tcn_of])
def test_it_learns_what_needs_memory(make: Callable[[int], nn.Module]) -> None:
    plan = TrainingPlan(10, 10, 30, 0, 4, warm_up=0.05, weight_decay=1e-3)
    _, curve = train_network(make, 1e-2, plan, delayed_sequences(4, 0), delayed_sequences(1, 1), seed=3, stride=1)
    assert min(curve.validation_mae) < 0.5 * curve.validation_mae[0]


@pytest.mark.parametrize("make", [gru_of, tcn_of])
def test_the_state_that_training_carries_makes_pieces_equal_the_whole(make: Callable[[int], nn.Module]) -> None:
    torch.manual_seed(3)
    network = make(INPUTS).eval()
    for parameter in network.parameters():
        nn.init.normal_(parameter, std=0.4)
    features = torch.from_numpy(np.random.default_rng(0).normal(size=(300, 1, INPUTS)).astype(np.float32))
    with torch.no_grad():
        whole, _ = network(features)
        first, state = network(features[:7])
        second, _ = network(features[7:], state)
    np.testing.assert_allclose(torch.cat([first, second]), whole, atol=2e-5 * float(whole.abs().max()))


@pytest.mark.parametrize(("steps", "kernel", "levels"), [(29, 3, 3), (30, 3, 4), (128, 4, 5)])
def test_blocks_cover_the_receptive_field(steps: int, kernel: int, levels: int) -> None:
    assert levels_for(steps, kernel) == levels
    assert 1 + 2 * (kernel - 1) * (2**levels - 1) >= steps


@pytest.mark.parametrize(("inputs", "held"), [(SAMPLE_COLUMNS, 1), (("position_m",), 3)])
def test_without_raw_pressures_the_output_is_held_between_steps(
    cylinder: Cylinder, labelled_recordings: list[Recording], inputs: tuple[str, ...], held: int
) -> None:
    build = BuildConfiguration(cylinder, inputs, 0, 0.01, {"learning_rate": 1e-2})
    model = SequenceModel(build, gru_of, TrainingPlan(2, None, 40, 0, 4), stride=3).fit(labelled_recordings[:2])
    output = model.predict(np.random.default_rng(0).normal(size=(60, len(model.features.names))).astype(np.float32))
    np.testing.assert_array_equal(output, np.repeat(output[::held], held))
    assert len(np.unique(output)) == 60 // held

"""Training learns, stops early, refuses nonsense, and resumes bit for bit after a kill."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.estimators.training import FrictionNetwork, side_by_side, strided, weights_of
from cylinder_friction.estimators.training import train_network as train_any_network
from cylinder_friction.estimators.training_plan import (
    Architecture,
    Checkpoint,
    SequenceData,
    TrainingCurve,
    TrainingPlan,
)
from cylinder_friction.realtime.lstm import LstmWeights

ARCHITECTURE = Architecture(layers=2, nodes=8, dropout=0.2, learning_rate=1e-2)
PLAN = TrainingPlan(epochs=6, patience=6, sequence_length=50, burn_in=10, batch_size=2)


def train_network(architecture: Architecture, *settings: Any, **more: Any) -> tuple[LstmWeights, TrainingCurve]:
    rate = architecture.learning_rate
    network, curve = train_any_network(lambda k: FrictionNetwork(architecture, k), rate, *settings, **more)
    return weights_of(network), curve


def lagged_sequences(count: int, seed: int) -> list[SequenceData]:
    """Return sequences whose target is the feature of five samples before, which needs memory."""
    generator = np.random.default_rng(seed)
    result = []
    for _ in range(count):
        feature = np.repeat(generator.normal(size=120), 5).astype(np.float32)
        target = np.concatenate([np.zeros(5, dtype=np.float32), feature[:-5]])
        result.append(SequenceData(feature[:, None], target, np.ones(600, dtype=bool)))
    return result


class KilledError(Exception):
    """Stands for the kill signal."""


def test_it_learns_what_needs_memory() -> None:
    plan = TrainingPlan(epochs=25, patience=25, sequence_length=50, burn_in=10, batch_size=4)
    _, curve = train_network(
        Architecture(1, 16, 0.0, 1e-2), plan, lagged_sequences(8, 0), lagged_sequences(2, 1), seed=3
    )
    assert min(curve.validation_mae) < 0.4 * curve.validation_mae[0]
    assert curve.validation_mae[curve.best_epoch - 1] == min(curve.validation_mae)


@pytest.mark.parametrize("killed_after", [1, 3, 6])
def test_training_resumed_after_a_kill_ends_bit_for_bit_where_an_undisturbed_one_does(
    tmp_path: Path, killed_after: int
) -> None:
    train, validation = lagged_sequences(4, 0), lagged_sequences(2, 1)
    whole, whole_curve = train_network(ARCHITECTURE, PLAN, train, validation, seed=1)

    def kill(epoch: int, *_: float) -> None:
        if epoch == killed_after:
            raise KilledError

    checkpoint = Checkpoint(tmp_path)
    with pytest.raises(KilledError):
        train_network(ARCHITECTURE, PLAN, train, validation, 1, checkpoint=checkpoint, report=kill)
    seen: list[int] = []
    resumed, curve = train_network(
        ARCHITECTURE, PLAN, train, validation, 1, checkpoint=checkpoint, report=lambda epoch, *_: seen.append(epoch)
    )
    assert seen == list(range(killed_after + 1, 7))
    assert curve == whole_curve
    for name in ("input", "recurrent", "bias", "head"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(whole, name))


def test_early_stopping_waits_for_its_patience_and_keeps_the_best_epoch() -> None:
    generator = np.random.default_rng(0)
    drawn = [[generator.normal(size=shape).astype(np.float32) for shape in ((300, 1), 300)] for _ in range(4)]
    noise = [SequenceData(features, target, np.ones(300, dtype=bool)) for features, target in drawn]
    plan = TrainingPlan(epochs=60, patience=3, sequence_length=50, burn_in=0, batch_size=2, schedule="constant")
    _, curve = train_network(Architecture(1, 16, 0.0, 3e-2), plan, noise[:2], noise[2:], seed=0)
    assert len(curve.validation_mae) == curve.best_epoch + 3 < 60


def test_masked_rows_change_nothing() -> None:
    data = lagged_sequences(3, 0)
    hidden = [
        SequenceData(d.features, np.where(np.arange(600) < 300, d.target, 1e6).astype(np.float32), np.arange(600) < 300)
        for d in data
    ]
    plain = [SequenceData(d.features, d.target, np.arange(600) < 300) for d in data]
    one, _ = train_network(ARCHITECTURE, PLAN, plain, plain, seed=1)
    other, _ = train_network(ARCHITECTURE, PLAN, hidden, hidden, seed=1)
    np.testing.assert_array_equal(one.recurrent, other.recurrent)


def test_a_target_that_is_no_number_is_refused() -> None:
    data = [SequenceData(np.ones((60, 1), np.float32), np.full(60, np.nan, np.float32), np.ones(60, bool))]
    with pytest.raises(FloatingPointError, match=r"epoch 1: mean absolute error is nan; lower the learning rate"):
        train_network(ARCHITECTURE, PLAN, data, data, seed=0)


def test_without_validation_all_epochs_are_trained_and_the_last_is_kept() -> None:
    plan = replace(PLAN, epochs=3, patience=None)
    _, curve = train_network(ARCHITECTURE, plan, lagged_sequences(2, 0), seed=1)
    assert (len(curve.train_mae), curve.validation_mae, curve.best_epoch) == (3, [], 3)


def test_the_target_of_a_slower_step_is_the_mean_until_the_next() -> None:
    data = [SequenceData(f[:, None], f, f > 0) for f in np.array([[0, 1, 2, 3, 0, 5], [0, 9, 9, 9, 9, 9]], np.float32)]
    steps = strided(side_by_side(data), 2, 1)
    assert steps.features[:, 0, 0].tolist() == [1.0, 3.0]
    assert steps.target[:, 0].tolist() == [1.5, 3.0]
    assert steps.weight[:, 0].tolist() == [2.0, 1.0]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"epochs": 0}, "of at least 1, but got TrainingPlan"),
        ({"warm_up": -0.1}, "of at least 0, but got TrainingPlan"),
    ],
)
def test_a_plan_refuses_nonsense(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TrainingPlan(**settings)

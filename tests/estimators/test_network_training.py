"""Training learns, stops early, refuses nonsense, and resumes bit for bit after a kill."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.checkpoint import Checkpoint
from cylinder_friction.estimators.network_training import train_network
from cylinder_friction.estimators.training_plan import Architecture, SequenceData, TrainingPlan

if TYPE_CHECKING:
    from pathlib import Path

ARCHITECTURE = Architecture(layers=2, nodes=8, dropout=0.2, learning_rate=1e-2)
PLAN = TrainingPlan(epochs=6, patience=6, sequence_length=50, burn_in=10, batch_size=2)


def lagged_sequences(count: int, seed: int) -> list[SequenceData]:
    """The target is the feature of five samples before: nothing without memory can tell it."""
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


def test_another_seed_gives_another_network() -> None:
    data = lagged_sequences(2, 0)
    one, _ = train_network(ARCHITECTURE, PLAN, data, data, seed=1)
    other, _ = train_network(ARCHITECTURE, PLAN, data, data, seed=2)
    assert not np.array_equal(one.recurrent, other.recurrent)


def test_early_stopping_waits_for_its_patience_and_keeps_the_best_epoch() -> None:
    generator = np.random.default_rng(0)
    noise = [
        SequenceData(
            generator.normal(size=(300, 1)).astype(np.float32),
            generator.normal(size=300).astype(np.float32),
            np.ones(300, dtype=bool),
        )
        for _ in range(4)
    ]
    plan = TrainingPlan(epochs=60, patience=3, sequence_length=50, burn_in=0, batch_size=2, schedule="constant")
    _, curve = train_network(Architecture(1, 16, 0.0, 3e-2), plan, noise[:2], noise[2:], seed=0)
    assert len(curve.validation_mae) == curve.best_epoch + 3 < 60


def test_masked_rows_teach_nothing() -> None:
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

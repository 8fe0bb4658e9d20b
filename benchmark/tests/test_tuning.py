"""Tuning: equal trials for all, the defaults first, the same proposals again, in batches that know of those before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import OneOf, RegisteredModel, Value
from friction_benchmark.tuning import Tuned, Tuning, TuningError
from friction_benchmark_models import MODULES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

RIDGE = registered_models(MODULES)["ridge"]


def tune(
    model: RegisteredModel,
    trials: int,
    seed: int,
    error_percent: Callable[[Mapping[str, Value]], float],
    batch: int = 1,
) -> Tuned:
    tuning = Tuning(model, trials, batch, seed)
    while not tuning.finished:
        for choice in tuning.next_batch():
            try:
                result: float | str = error_percent(choice)
            except ValueError as error:
                result = f"ValueError: {error}"
            tuning.finish(choice, result)
    return tuning.best()


def tried(trials: int, seed: int, batch: int = 1) -> list[dict[str, Value]]:
    seen: list[dict[str, Value]] = []

    def error_percent(choice: Mapping[str, Value]) -> float:
        seen.append(dict(choice))
        return float(choice["penalty"])

    tune(RIDGE, trials, seed, error_percent, batch)
    return seen


def test_the_defaults_are_tried_first_and_no_model_has_more_trials() -> None:
    seen = tried(6, 0)
    assert seen[0] == dict(RIDGE.defaults)
    assert len(seen) == 6
    assert len({choice["penalty"] for choice in seen}) == 6


def test_one_seed_proposes_the_same_and_another_seed_other_choices() -> None:
    assert tried(5, 3) == tried(5, 3)
    assert tried(5, 3) != tried(5, 4)


def test_trials_of_a_batch_do_not_know_of_each_other() -> None:
    one_by_one, in_batches = tried(10, 3), tried(10, 3, batch=4)
    assert one_by_one[:5] == in_batches[:5], "the defaults, and what is drawn at random"
    assert one_by_one[5:] != in_batches[5:]
    tuning = Tuning(RIDGE, 10, 4, 3)
    sizes = []
    while not tuning.finished:
        batch = tuning.next_batch()
        sizes.append(len(batch))
        for choice in batch:
            assert choice in tuning.next_batch(), "what is finished of a batch does not change the rest of it"
            tuning.finish(choice, float(choice["penalty"]))
    assert sizes == [4, 4, 2]


def test_proposals_keep_to_the_space() -> None:
    for choice in tried(12, 1):
        assert 2 <= choice["lags"] <= 20
        assert isinstance(choice["lags"], int)
        assert 1e-2 <= choice["penalty"] <= 1e2


def test_the_best_is_kept_with_what_it_reached() -> None:
    tuned = tune(RIDGE, 8, 0, lambda choice: abs(float(choice["lags"]) - 7.0))
    assert tuned.validation_percent == min(value for value in tuned.trials if value is not None)
    assert abs(float(tuned.choice["lags"]) - 7.0) == tuned.validation_percent


def test_a_failed_trial_does_not_end_the_tuning() -> None:
    def error_percent(choice: Mapping[str, Value]) -> float:
        if choice == RIDGE.defaults:
            raise ValueError("no")
        return 3.0

    tuned = tune(RIDGE, 3, 0, error_percent)
    assert tuned.trials == (None, 3.0, 3.0)
    assert tuned.choice != RIDGE.defaults


def test_tuning_that_never_succeeds_states_why() -> None:
    def error_percent(choice: Mapping[str, Value]) -> float:
        raise ValueError("too few rows")

    with pytest.raises(TuningError, match="none of 2 trials succeeded; the first: ValueError: too few rows"):
        tune(RIDGE, 2, 0, error_percent)


def test_one_of_several_words_may_be_tuned() -> None:
    entry = RegisteredModel("a", "A", "modern", "own", RIDGE.build, {"way": OneOf(("up", "down"))}, {"way": "down"})
    assert tune(entry, 4, 0, lambda choice: 1.0 if choice["way"] == "up" else 2.0).choice == {"way": "up"}

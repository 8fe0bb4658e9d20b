"""Tuning: equal trials for all, the defaults first, the same proposals again."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from friction_benchmark.registry import OneOf, RegisteredModel, Value, registered_models
from friction_benchmark.tuning import TuningError, tune
from friction_benchmark_models import MODULES

if TYPE_CHECKING:
    from collections.abc import Mapping

RIDGE = registered_models(MODULES)["ridge"]


def tried(trials: int, seed: int) -> list[dict[str, Value]]:
    seen: list[dict[str, Value]] = []

    def percent(choice: Mapping[str, Value]) -> float:
        seen.append(dict(choice))
        return float(choice["penalty"])

    tune(RIDGE, trials, seed, percent)
    return seen


def test_the_defaults_are_tried_first_and_every_proposal_keeps_to_the_space() -> None:
    seen = tried(12, 1)
    assert seen[0] == dict(RIDGE.defaults)
    assert len({choice["penalty"] for choice in seen}) == len(seen) == 12
    for choice in seen:
        assert 2 <= choice["lags"] <= 20
        assert isinstance(choice["lags"], int)
        assert 1e-2 <= choice["penalty"] <= 1e2


def test_one_seed_proposes_the_same_and_another_seed_other_choices() -> None:
    assert tried(5, 3) == tried(5, 3)
    assert tried(5, 3) != tried(5, 4)


def test_the_best_is_kept_with_what_it_reached() -> None:
    errors = {}

    def percent(choice: Mapping[str, Value]) -> float:
        errors[choice["lags"]] = abs(float(choice["lags"]) - 7.0)
        return errors[choice["lags"]]

    tuned = tune(RIDGE, 8, 0, percent)
    assert tuned.validation_percent == min(errors.values()) == errors[tuned.choice["lags"]]


def test_a_failed_trial_does_not_end_the_tuning() -> None:
    def percent(choice: Mapping[str, Value]) -> float:
        if choice == RIDGE.defaults:
            raise ValueError("no")
        return 3.0

    tuned = tune(RIDGE, 3, 0, percent)
    assert tuned.validation_percent == 3.0
    assert tuned.choice != RIDGE.defaults


def test_tuning_that_never_succeeds_states_why() -> None:
    def percent(choice: Mapping[str, Value]) -> float:
        raise ValueError("too few rows")

    with pytest.raises(TuningError, match="none of 2 trials succeeded; the first: ValueError: too few rows"):
        tune(RIDGE, 2, 0, percent)


def test_one_of_several_words_may_be_tuned() -> None:
    entry = RegisteredModel("a", "A", "modern", "own", RIDGE.build, {"way": (OneOf(("up", "down")), "down")})
    assert tune(entry, 4, 0, lambda choice: 1.0 if choice["way"] == "up" else 2.0).choice == {"way": "up"}

"""Teaching once what is alike, and keeping answers whole."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.fitting import FIT_FILE, fitted, making_of
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.storing import Answer, Estimates, Store
from friction_benchmark.tuning import Tuned
from friction_benchmark_models import CYLINDER, MODULES, made_case

if TYPE_CHECKING:
    from pathlib import Path

MODELS = registered_models(MODULES)
RECORDINGS = [made_case(test, session).recording for test in "12" for session in (1, 2)]


def fits(store: Path) -> int:
    return len(list(store.glob(f"*/{FIT_FILE}")))


def teach(store: Path, name: str = "ridge", seed: int = 0, recordings=RECORDINGS, **choice: float):
    making = making_of(MODELS[name], CYLINDER, ("pressure_1_pa", "pressure_2_pa", "position_m"), seed, 0.5, choice)
    return fitted(MODELS[name], making, recordings, store)


def test_what_is_taught_alike_is_taught_once_and_says_the_same(tmp_path: Path) -> None:
    first, again = teach(tmp_path), teach(tmp_path)
    assert fits(tmp_path) == 1
    assert again.training_s == first.training_s
    for recording in RECORDINGS:
        np.testing.assert_array_equal(again.estimator.estimate(recording), first.estimator.estimate(recording))


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"penalty": 7.0},
        {"recordings": RECORDINGS[:3]},
        {"recordings": [r.with_columns(friction_n=r.column("friction_n") + 1.0) for r in RECORDINGS]},
        {"recordings": [r.with_columns(usable=~r.usable()) for r in RECORDINGS]},
        {"recordings": [replace(r, metadata=replace(r.metadata, session="one")) for r in RECORDINGS]},
    ],
    ids=["seed", "choice", "fewer", "label", "mask", "sessions"],
)
def test_what_differs_is_taught_anew(tmp_path: Path, other: dict[str, object]) -> None:
    teach(tmp_path)
    teach(tmp_path, **other)  # type: ignore[arg-type]
    assert fits(tmp_path) == 2


def test_a_model_of_position_does_not_mind_what_pressures_are(tmp_path: Path) -> None:
    hidden = [recording.with_columns(pressure_1_pa=np.zeros(len(recording))) for recording in RECORDINGS]
    teach(tmp_path, "constant_by_direction")
    teach(tmp_path, "constant_by_direction", recordings=hidden)
    assert fits(tmp_path) == 1


def test_a_failed_fit_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="cannot learn this"):
        teach(tmp_path, "raises")
    assert not list(tmp_path.iterdir())


def test_an_answer_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    numbers = generator.normal(0.0, 300.0, (3, 101)).astype(np.float32).astype(np.float64)
    estimates = Estimates(numbers[0], numbers[1], numbers[2], generator.random(101) < 0.3)
    store = Store(tmp_path)
    assert not store.has_answer("identity", "unseen_rig", "ridge", 4)
    store.keep_answer("identity", "unseen_rig", "ridge", 4, Answer({"a": estimates}, 60, 1.5, None))
    assert store.has_answer("identity", "unseen_rig", "ridge", 4)
    found = store.answer("identity", "unseen_rig", "ridge", 4)
    assert (found.multiply_adds, found.training_s, found.step_us) == (60, 1.5, None)
    for name in ("friction_n", "lower_n", "upper_n", "outside"):
        np.testing.assert_array_equal(getattr(found.estimates["a"], name), getattr(estimates, name))


def test_a_tuning_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    store, tuned = Store(tmp_path), Tuned({"lags": 5, "way": "up"}, 3.25, (None, 3.25))
    assert store.tuned("identity", "ridge") is None
    store.keep_tuned("identity", "ridge", tuned)
    assert store.tuned("identity", "ridge") == tuned

"""Training once what is alike, keeping results whole, and removing what is no longer used."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.cache import Cache, Estimates, Prediction
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import BuildConfiguration
from friction_benchmark.tuning import Tuned
from friction_benchmark.worker import FIT_FILE, Trained, trained
from friction_benchmark_models import CYLINDER, MODULES, made_recording

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.recordings.recording import Recording

MODELS = registered_models(MODULES)
RECORDINGS = [made_recording(condition, session).recording for condition in "12" for session in (1, 2)]


def fits(folder: Path) -> int:
    return len(list(folder.glob(f"*/{FIT_FILE}")))


def train(
    folder: Path,
    name: str = "ridge",
    seed: int = 0,
    recordings: list[Recording] = RECORDINGS,
    code: str = "this",
    **chosen: float,
) -> Trained:
    model = MODELS[name]
    configuration = BuildConfiguration(CYLINDER, SAMPLE_COLUMNS, seed, 0.5, {**model.defaults, **chosen})
    return trained(model, code, configuration, recordings, folder)


def test_equal_training_happens_once_and_gives_equal_estimates(tmp_path: Path) -> None:
    first, again = train(tmp_path), train(tmp_path)
    assert fits(tmp_path) == 1
    assert again.training_s == first.training_s
    for recording in RECORDINGS:
        np.testing.assert_array_equal(again.estimator.estimate(recording), first.estimator.estimate(recording))


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"penalty": 7.0},
        {"code": "another"},
        {"recordings": RECORDINGS[:3]},
        {"recordings": [r.with_columns(friction_n=r.column("friction_n") + 1.0) for r in RECORDINGS]},
        {"recordings": [r.with_columns(usable=~r.usable()) for r in RECORDINGS]},
        {"recordings": [replace(r, metadata=replace(r.metadata, session="one")) for r in RECORDINGS]},
    ],
    ids=["seed", "hyperparameter", "code", "fewer", "label", "mask", "sessions"],
)
def test_what_differs_is_trained_anew(tmp_path: Path, other: dict[str, object]) -> None:
    train(tmp_path)
    train(tmp_path, **other)  # type: ignore[arg-type]
    assert fits(tmp_path) == 2


def test_a_model_of_position_does_not_mind_what_pressures_are(tmp_path: Path) -> None:
    hidden = [recording.with_columns(pressure_1_pa=np.zeros(len(recording))) for recording in RECORDINGS]
    train(tmp_path, "constant_by_direction")
    train(tmp_path, "constant_by_direction", recordings=hidden)
    assert fits(tmp_path) == 1


def test_a_failed_fit_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="cannot learn this"):
        train(tmp_path, "raises")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("step_us", [None, 2.5])
def test_a_prediction_comes_back_as_it_was_kept(tmp_path: Path, step_us: float | None) -> None:
    generator = np.random.default_rng(0)
    numbers = generator.normal(0.0, 300.0, (3, 101)).astype(np.float32).astype(np.float64)
    estimates = Estimates(numbers[0], numbers[1], numbers[2], generator.random(101) < 0.3)
    cache = Cache(tmp_path)
    assert not cache.has_prediction("key")
    cache.keep_prediction("key", Prediction({"a sensors 1": estimates}, 60, 1.5, step_us))
    assert cache.has_prediction("key")
    found = cache.prediction("key")
    assert (found.multiply_adds, found.training_s, found.step_us) == (60, 1.5, step_us)
    for name in ("friction_n", "lower_n", "upper_n", "outside"):
        np.testing.assert_array_equal(getattr(found.estimates["a sensors 1"], name), getattr(estimates, name))


def test_a_tuning_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    cache, tuned = Cache(tmp_path), Tuned({"lags": 5, "way": "up"}, 3.25, (None, 3.25))
    assert cache.tuned("key") is None
    cache.keep_tuned("key", tuned)
    assert cache.tuned("key") == tuned


def test_pruning_removes_what_was_not_used_since(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    train(cache.fits)
    for key in ("old", "new"):
        cache.keep_value("scores", key, 1.0)
        cache.keep_prediction(key, Prediction({}, 1, 1.0))
    yesterday = time.time() - 86_400.0
    for path in tmp_path.glob("*/*"):
        os.utime(path, (yesterday, yesterday))
    assert cache.value("scores", "new") == 1.0
    assert cache.has_prediction("new")
    assert cache.prune(time.time() - 60.0) == 3
    assert sorted(path.name for path in tmp_path.glob("*/*")) == ["new.json", "new.npz"]

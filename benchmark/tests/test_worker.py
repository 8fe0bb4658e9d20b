"""What a worker gives a model to learn from, what it keeps, and what removes that."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pytest

from friction_benchmark.cache import Cache, Estimates, Prediction
from friction_benchmark.datasets import Sources, folds_of
from friction_benchmark.folds import HELD_OUT
from friction_benchmark.jobs import WORKER, Context, Job, code_key, tuning_job
from friction_benchmark.registry import RegisteredModel, registered_models
from friction_benchmark.tasks import task_named
from friction_benchmark.worker import do_jobs, do_tuning, prediction
from friction_benchmark_models import CYLINDER, MODULES, SIZES, Constant, write_campaign

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.recordings.recording import Recording

MODELS = registered_models(MODULES)
SEEN: list[Recording] = []


class Watched(Constant):
    """Notes what it is fitted on."""

    def fit(self, recordings: Sequence[Recording]) -> Self:
        SEEN.extend(recordings)
        return super().fit(recordings)


MODELS |= {
    f"watched {family}": RegisteredModel("watched", "Watched", family, "own", lambda build: Watched(build.inputs))
    for family in ("modern", "analytical")
}


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Sources:
    made = Sources(tmp_path_factory.mktemp("campaigns"), SIZES, CYLINDER)
    write_campaign(made, "campaign", 0)
    return made


def job(name: str, task: str = "identity", **changes: Any) -> Job:
    return replace(tuning_job(MODELS[name], task_named(task), 0, "code"), **changes)


def context(sources: Sources, folder: Path, code: str = "") -> Context:
    return Context(sources, folder, 0.5, code or code_key(WORKER))


@pytest.mark.parametrize(
    ("task", "learns", "stated"),
    [("sensor_drift", True, True), ("sensor_drift", False, False), ("identity", True, False)],
)
def test_where_sensors_drift_a_model_that_learns_offsets_is_given_those_of_its_training(
    sources: Sources, tmp_path: Path, task: str, learns: bool, stated: bool
) -> None:
    SEEN.clear()
    watched = job(
        "watched modern", task, model=replace(MODELS["watched modern"], learns_offset=learns), code=f"{task} {learns}"
    )
    predicted = prediction(context(sources, tmp_path), watched)
    assert len(predicted.estimates) == 4 * (4 if task == "sensor_drift" else 1)
    fold = folds_of(sources, task_named(task), HELD_OUT, 0)[0]
    assert {each.name for each in SEEN} == set(fold.train)
    assert not {each.name for each in SEEN} & {*fold.validation, *fold.test}
    assert all(bool(each.metadata.identified_zero) == stated for each in SEEN)


def test_jobs_that_train_the_same_train_once(sources: Sources, tmp_path: Path) -> None:
    SEEN.clear()
    tasks = ("identity", "forecast_25ms")  # an analytical model is identified on friction now in every task
    jobs = [job("watched analytical", task) for task in tasks]
    assert len({each.shared_fit() for each in jobs}) == 1
    assert do_jobs(context(sources, tmp_path), jobs) == ["", ""]
    assert len(SEEN) == 4
    assert do_jobs(context(sources, tmp_path), [replace(jobs[0], seed=0, code="another")]) == [""]
    assert len(SEEN) == 8


def test_a_trial_is_computed_once_and_is_the_prediction_of_the_choice(sources: Sources, tmp_path: Path) -> None:
    here = context(sources, tmp_path)
    tuned, computed = do_tuning(here, job("ridge"), 3)
    assert not isinstance(tuned, str)
    assert computed == 3
    assert here.cache.has_prediction(job("ridge", hyperparameters=tuned.choice).key(here))
    assert do_tuning(here, job("ridge"), 3) == (tuned, 0)
    assert do_tuning(here, job("ridge"), 4)[1] == 1


def test_failures_are_named(sources: Sources, tmp_path: Path) -> None:
    problems = do_jobs(context(sources, tmp_path), [job("raises"), job("nan"), job("hold")])
    assert problems[0] == "ValueError: cannot learn this"
    assert problems[1].startswith("ValueError: estimate is nan in row 1 of recording 'condition1_session")
    assert problems[2] == ""


def test_work_for_another_version_is_refused(sources: Sources, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="the worker has another version of friction_benchmark"):
        do_jobs(context(sources, tmp_path, "other"), [job("hold")])


@pytest.mark.parametrize(
    "change",
    [{"seed": 1}, {"hyperparameters": {"lags": 7}}, {"code": "another"}, {"fold": 1}, {"split": "unseen_rig"}],
    ids=lambda change: next(iter(change)),
)
def test_whatever_decides_a_result_is_in_its_key(sources: Sources, tmp_path: Path, change: dict[str, Any]) -> None:
    here, one = context(sources, tmp_path), job("ridge")
    assert one.key(here) == job("ridge").key(here)
    assert replace(one, **change).key(here) != one.key(here)
    assert one.key(replace(here, effort=0.25)) != one.key(here)
    shown = replace(one.task, title="other words")
    assert replace(one, task=shown).key(here) == one.key(here)


def test_a_prediction_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    numbers = generator.normal(0.0, 300.0, (3, 101)).astype(np.float32).astype(np.float64)
    estimates = Estimates(numbers[0], numbers[1], numbers[2], generator.random(101) < 0.3)
    cache = Cache(tmp_path)
    assert not cache.has_prediction("key")
    for key, name in (("key", "a sensors 1"), ("other", "b")):
        cache.keep_prediction(key, Prediction({name: estimates}, 60, 1.5, 2.5, 3.5))
    found = cache.predictions(["key", "other"])
    assert (found.multiply_adds, found.training_s, found.step_us, found.validation_percent) == (60, 3.0, 2.5, 3.5)
    assert set(found.estimates) == {"a sensors 1", "b"}
    for name in ("friction_n", "lower_n", "upper_n", "outside"):
        np.testing.assert_array_equal(getattr(found.estimates["b"], name), getattr(estimates, name))


def test_pruning_removes_what_was_not_used_since(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    for key in ("old", "new"):
        cache.keep_score(key, 1.0)
        cache.keep_prediction(key, Prediction({}, 1, 1.0, 1.0, 1.0))
    yesterday = time.time() - 86_400.0
    for path in tmp_path.glob("*/*"):
        os.utime(path, (yesterday, yesterday))
    assert cache.score("new") == 1.0
    assert cache.has_prediction("new")
    assert cache.prune(time.time() - 60.0) == 2
    assert sorted(path.name for path in tmp_path.glob("*/*")) == ["new.json", "new.npz"]

"""The work of the benchmark, cut into pieces that any worker can do in any order."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter_ns
from typing import TYPE_CHECKING

import numpy as np

from friction_benchmark.bounds import calibrated
from friction_benchmark.data import (
    cases_of,
    exams_of,
    folds_of,
    lessons_of,
    twin_lessons_of,
    unseen_kind,
)
from friction_benchmark.fitting import Fitted, fitted, making_of
from friction_benchmark.flags import outside, taught_range, with_causal_velocity
from friction_benchmark.folds import HELD_OUT, UNSEEN_RIG
from friction_benchmark.registry.listing import MODULES, registered_models
from friction_benchmark.storing import Answer, Estimates, Store
from friction_benchmark.tasks import inputs_of, task_named
from friction_benchmark.tuning import tune

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.guard import TrainingRange
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.bounds import ErrorBounds
    from friction_benchmark.data import Sources
    from friction_benchmark.folds import Fold
    from friction_benchmark.registry.model import RegisteredModel, Value
    from friction_benchmark.tasks import Exam, Task

POSITION_ALONE = ("position_m",)
TIMED_STEPS = 300
WARM_UP_STEPS = 50
LONGEST_TIMING_S = 0.5


@dataclass(frozen=True)
class Bench:
    """All that a worker is told.

    Attributes:
        cylinder: Of all recordings.
        sources: Where they lie.
        store: Where finished work is kept.
        seeds: Of campaigns and models; tuning happens on the first one.
        effort: Share of the full training, in (0, 1].
        trials: Of every model's tuning.
        modules: Of the roster.
    """

    cylinder: Cylinder
    sources: Sources
    store: Path
    seeds: tuple[int, ...]
    effort: float
    trials: int
    modules: tuple[str, ...] = MODULES

    def entry(self, model: str) -> RegisteredModel:
        return registered_models(self.modules)[model]


@dataclass(frozen=True, order=True)
class Question:
    """One model on one task, split and seed."""

    task: str
    split: str
    model: str
    seed: int


Failures = dict[Question, str]
"""Why a question has no answer."""


def tune_model(bench: Bench, model: str, tasks: Sequence[str]) -> dict[str, str]:
    """Tune a participant for tasks, on the first seed; returns why not, by task, where that failed."""
    failures: dict[str, str] = {}
    store = Store(bench.store)
    for task in tasks:
        if store.tuned(task, model) is None:
            try:
                _tune(bench, store, bench.entry(model), task)
            except Exception as error:  # reported in the model's place; the others go on
                failures[task] = _words(error)
    return failures


def answer_questions(bench: Bench, questions: Sequence[Question]) -> Failures:
    """Answers questions one after another; what was answered before is left as it is."""
    failures: Failures = {}
    store = Store(bench.store)
    for question in questions:
        if not store.has_answer(question.task, question.split, question.model, question.seed):
            try:
                found = _answer(bench, store, question)
            except Exception as error:
                failures[question] = _words(error)
                continue
            store.keep_answer(question.task, question.split, question.model, question.seed, found)
    return failures


def _tune(bench: Bench, store: Store, entry: RegisteredModel, name: str) -> None:
    task, seed = task_named(name), bench.seeds[0]
    exams = exams_of(bench.sources, task, task.campaign, seed)
    fold = folds_of(bench.sources, task, HELD_OUT, seed)[0]

    def percent_of(choice: Mapping[str, Value]) -> float:
        taught = _fit(bench, store, entry, task, fold, seed, choice)
        return _percent(taught.estimator, [exams[one] for one in fold.validation])

    store.keep_tuned(name, entry.name, tune(entry, bench.trials, seed, percent_of))


def _answer(bench: Bench, store: Store, question: Question) -> Answer:
    entry, task, seed = bench.entry(question.model), task_named(question.task), question.seed
    tuned = store.tuned(task.tuned_as or task.name, entry.name)
    choice = entry.defaults if tuned is None else tuned.choice
    own = exams_of(bench.sources, task, task.campaign, seed)
    asked = exams_of(bench.sources, task, unseen_kind(task), seed) if question.split == UNSEEN_RIG else own
    estimates: dict[str, Estimates] = {}
    training_s, step_us, multiply_adds = 0.0, None, 0
    for fold in folds_of(bench.sources, task, question.split, seed):
        taught = _fit(bench, store, entry, task, fold, seed, choice)
        estimator = taught.estimator
        names = () if entry.trained_on == "twin" else fold.train
        inputs = inputs_of(task, asked[fold.test[0]].recording)
        known = taught_range(bench.sources, task, seed, names, inputs, causal=True)
        validation = [own[name].recording for name in fold.validation]
        bounds = calibrated(validation, [estimator.estimate(recording) for recording in validation])
        for name in fold.test:
            estimates[name] = _estimates(estimator, asked[name].recording, bounds, known)
        training_s += taught.training_s
        multiply_adds = estimator.multiply_adds()
        if question.split == HELD_OUT and seed == bench.seeds[0]:
            step_us = median_step_us(estimator, asked[fold.test[0]].recording)
    return Answer(estimates, multiply_adds, training_s, step_us)


def _fit(
    bench: Bench,
    store: Store,
    entry: RegisteredModel,
    task: Task,
    fold: Fold,
    seed: int,
    choice: Mapping[str, Value],
) -> Fitted:
    recordings = _lessons(bench, entry, task, fold, seed)
    inputs = inputs_of(task, next(iter(cases_of(bench.sources, task.campaign, seed).values())).recording)
    if entry.family == "analytical" and entry.supports(POSITION_ALONE):
        inputs = POSITION_ALONE  # it looks at nothing else, and so is identified once for many tasks
    making = making_of(entry, bench.cylinder, inputs, seed, bench.effort, choice)
    return fitted(entry, making, recordings, store.fits)


def _lessons(bench: Bench, entry: RegisteredModel, task: Task, fold: Fold, seed: int) -> list[Recording]:
    """Return what a participant is taught on."""
    if entry.trained_on == "twin":
        return list(twin_lessons_of(bench.sources, task, seed))
    lessons = lessons_of(bench.sources, task, seed, of_now=_sees_no_future(entry))
    return [lessons[name].recording for name in fold.train]


def _estimates(
    estimator: FrictionEstimator, recording: Recording, bounds: ErrorBounds, known: TrainingRange
) -> Estimates:
    friction_n = estimator.estimate(recording)
    if not np.isfinite(friction_n).all():
        row = int(np.argmin(np.isfinite(friction_n)))
        raise ValueError(f"estimate is {friction_n[row]} in row {row + 1} of recording {recording.name!r}")
    lower_n, upper_n = bounds.around(recording, friction_n)
    return Estimates(friction_n, lower_n, upper_n, outside(known, with_causal_velocity(recording)))


def _percent(estimator: FrictionEstimator, exams: Sequence[Exam]) -> float:
    """Return MAE / mean |target| [%] over recordings together; against labels, as a user would have to tune."""
    error, friction = 0.0, 0.0
    for exam in exams:
        usable = exam.recording.usable()
        target_n = exam.recording.column("friction_n")[usable]
        error += float(np.abs(estimator.estimate(exam.recording)[usable] - target_n).sum())
        friction += float(np.abs(target_n).sum())
    percent = 100.0 * error / friction
    if not np.isfinite(percent):
        raise ValueError(f"error on validation sessions is {percent} %")
    return percent


def median_step_us(estimator: FrictionEstimator, recording: Recording) -> float:
    """Return the median time of one step of the Python stream [µs]: a comparison within one run, no more."""
    samples = [tuple(map(float, row)) for row in recording.samples(estimator.inputs)[: TIMED_STEPS + WARM_UP_STEPS]]
    stream = estimator.stream()
    for sample in samples[:WARM_UP_STEPS]:  # compiled and warm before time counts
        stream.step(*sample)
    durations: list[int] = []
    deadline = perf_counter_ns() + round(1e9 * LONGEST_TIMING_S)
    for sample in samples[WARM_UP_STEPS:]:
        before = perf_counter_ns()
        stream.step(*sample)
        after = perf_counter_ns()
        durations.append(after - before)
        if after > deadline:
            break
    return float(np.median(durations)) / 1e3


def _sees_no_future(entry: RegisteredModel) -> bool:
    """A model given by equations has nothing to learn from friction ahead: its estimate of now is its forecast."""
    return entry.family == "analytical"


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"

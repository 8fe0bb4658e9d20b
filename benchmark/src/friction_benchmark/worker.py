"""The work of the benchmark: tuning, training and prediction, in pieces that any worker can do in any order."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.evaluation.timing import time_steps
from cylinder_friction.recordings.files import read_json, write_json
from friction_benchmark.cache import Estimates, Prediction, mark_used
from friction_benchmark.cases import with_known_zeros
from friction_benchmark.conformal import calibrated
from friction_benchmark.datasets import (
    cases_of,
    folds_of,
    inputs_of,
    training_cases,
    twin_recordings,
    unseen_kind,
)
from friction_benchmark.extrapolation import outside, training_range, with_causal_velocity
from friction_benchmark.folds import HELD_OUT, UNSEEN_RIG
from friction_benchmark.jobs import TrialJob
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.realtime.guard import TrainingRange
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.cases import EvaluationCase
    from friction_benchmark.conformal import ErrorBounds
    from friction_benchmark.folds import Fold
    from friction_benchmark.jobs import Context, PredictionJob
    from friction_benchmark.registry.model import RegisteredModel

POSITION_ALONE = ("position_m",)
TIMED_STEPS = 300
LONGEST_TIMING_S = 0.5
FIT_FILE = "fit.json"


@dataclass(frozen=True)
class Trained:
    """A trained estimator, and the processor's time that it took [s]."""

    estimator: FrictionEstimator
    training_s: float


def do_jobs(context: Context, jobs: Sequence[TrialJob | PredictionJob]) -> list[str]:
    """Do jobs one after another and keep their results in the cache; returns why not, job by job, else nothing."""
    return [_attempt(context, job) for job in jobs]


def _attempt(context: Context, job: TrialJob | PredictionJob) -> str:
    try:
        if isinstance(job, TrialJob):
            context.cache.keep_value("trials", job.key(context), trial_percent(context, job))
        else:
            context.cache.keep_prediction(job.key(context), prediction(context, job))
    except Exception as error:  # reported in the model's place; the others go on
        return f"{type(error).__name__}: {error}"
    return ""


def trial_percent(context: Context, job: TrialJob) -> float:
    """Return the error on the validation sessions of the held-out split [%]."""
    cases = cases_of(context.sources, job.task, job.task.campaign, job.seed)
    fold = folds_of(context.sources, job.task, HELD_OUT, job.seed)[0]
    estimator = _trained(context, job, fold).estimator
    return validation_percent(estimator, [cases[name] for name in fold.validation])


def prediction(context: Context, job: PredictionJob) -> Prediction:
    """Return the estimates, bounds and flags of every test recording of a fold, and what they cost."""
    sources, task = context.sources, job.task
    own = cases_of(sources, task, task.campaign, job.seed)
    tested = cases_of(sources, task, unseen_kind(task), job.seed) if job.split == UNSEEN_RIG else own
    fold = folds_of(sources, task, job.split, job.seed)[job.fold]
    trained = _trained(context, job, fold)
    estimator = trained.estimator
    names = () if job.model.trained_on == "twin" else fold.train
    known = training_range(sources, task, job.seed, names, inputs_of(sources, task, job.seed), causal=True)
    validation = [own[name].recording for name in fold.validation]
    bounds = calibrated(validation, [estimator.estimate(recording) for recording in validation])
    estimates = {name: _estimates(estimator, tested[name].recording, bounds, known) for name in fold.test}
    step_us = None
    if job.timed:
        timed = tested[fold.test[0]].recording
        step_us = 1e6 * time_steps(estimator, timed, TIMED_STEPS, maximum_seconds=LONGEST_TIMING_S).p50_s
    return Prediction(estimates, estimator.multiply_adds(), trained.training_s, step_us)


def validation_percent(estimator: FrictionEstimator, cases: Sequence[EvaluationCase]) -> float:
    """Return MAE / mean |target| [%] over recordings together; against labels, as a user would have to tune."""
    error, friction = 0.0, 0.0
    for case in cases:
        target_n = case.recording.column("friction_n")[case.usable]
        error += float(np.abs(estimator.estimate(case.recording)[case.usable] - target_n).sum())
        friction += float(np.abs(target_n).sum())
    percent = 100.0 * error / friction
    if not np.isfinite(percent):
        raise ValueError(f"error on validation sessions is {percent} %")
    return percent


def _trained(context: Context, job: TrialJob | PredictionJob, fold: Fold) -> Trained:
    model, task, sources = job.model, job.task, context.sources
    if model.trained_on == "twin":
        recordings = list(twin_recordings(sources, task, job.seed))
    else:
        # A model given by equations cannot learn friction ahead: its estimate of now is its forecast.
        cases = training_cases(sources, task, job.seed, of_now=model.family == "analytical")
        recordings = [cases[name].recording for name in fold.train]
        if model.learns_offset and task.drifts:
            recordings = [with_known_zeros(each, sources.cylinder) for each in recordings]
    inputs = inputs_of(sources, task, job.seed)
    if model.family == "analytical" and model.supports(POSITION_ALONE):
        inputs = POSITION_ALONE  # it looks at nothing else, and so is identified once for many tasks
    configuration = BuildConfiguration(
        sources.cylinder, inputs, job.seed, context.effort, {**model.defaults, **job.hyperparameters}
    )
    return trained(model, job.code, configuration, recordings, context.cache.fits)


def trained(
    model: RegisteredModel, code: str, configuration: BuildConfiguration, recordings: Sequence[Recording], fits: Path
) -> Trained:
    """Return a model trained on these recordings, from the folder ``fits`` if it was trained so before.

    What counts is its configuration and what it sees: columns that are none of its inputs may differ, so that a model
    of position alone is identified once for many tasks. It is always read back from where it was saved.
    """
    estimator = model.build(configuration)
    folder = fits / _fit_key(model.name, code, configuration, estimator.inputs, recordings)
    if not folder.is_dir():
        before = process_time()
        estimator.fit(recordings)
        _keep(estimator, process_time() - before, folder)
    return Trained(FrictionEstimator.load(mark_used(folder)), float(read_json(folder / FIT_FILE)["training_s"]))


def _keep(estimator: FrictionEstimator, training_s: float, folder: Path) -> None:
    """Save an estimator whole; of two processes that trained the same one, the first keeps it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        estimator.save(draft)
        write_json(draft / FIT_FILE, {"training_s": training_s})
        with contextlib.suppress(OSError):
            draft.rename(folder)
        if not folder.is_dir():
            raise OSError(f"{folder}: could not be made from {draft}")
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _fit_key(
    name: str, code: str, configuration: BuildConfiguration, inputs: Sequence[str], recordings: Sequence[Recording]
) -> str:
    content = [name, code, {**asdict(configuration), "inputs": list(inputs)}]
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    for recording in recordings:
        metadata = recording.metadata
        digest.update(f"{metadata.name}/{metadata.condition}/{metadata.session}/{metadata.sample_time_s}".encode())
        digest.update(recording.samples(inputs).tobytes())
        digest.update(np.packbits(recording.usable()).tobytes())
        digest.update(recording.column("friction_n")[recording.usable()].tobytes())
    return digest.hexdigest()[:32]


def _estimates(
    estimator: FrictionEstimator, recording: Recording, bounds: ErrorBounds, known: TrainingRange
) -> Estimates:
    friction_n = estimator.estimate(recording)
    if not np.isfinite(friction_n).all():
        row = int(np.argmin(np.isfinite(friction_n)))
        raise ValueError(f"estimate is {friction_n[row]} in row {row + 1} of recording {recording.name!r}")
    lower_n, upper_n = bounds.around(recording, friction_n)
    return Estimates(friction_n, lower_n, upper_n, outside(known, with_causal_velocity(recording)))

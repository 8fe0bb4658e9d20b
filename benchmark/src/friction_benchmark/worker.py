"""The work of the benchmark: tuning, training and prediction, in pieces that any worker can do in any order."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from time import process_time

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.bounds import calibrated_bounds, regimes_of
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.cache import Estimates, Prediction
from friction_benchmark.cases import with_known_zeros
from friction_benchmark.datasets import cases_of, folds_of, inputs_of, training_cases, twin_recordings, unseen_kind
from friction_benchmark.extrapolation import outside, training_range
from friction_benchmark.folds import UNSEEN_RIG, Fold
from friction_benchmark.jobs import Context, Job
from friction_benchmark.registry import BuildConfiguration, Estimator, Values
from friction_benchmark.tuning import Tuned, TuningError, tune

POSITION_ALONE = ("position_m",)


@dataclass(frozen=True)
class Trained:
    """A trained estimator, and the processor's time that it took [s]."""

    estimator: Estimator
    training_s: float


def do_jobs(context: Context, jobs: Sequence[Job]) -> list[str]:
    """Do jobs one after another and keep their predictions; return why not, job by job, else nothing."""
    context.refuse_other_code()
    problems = []
    for job in jobs:
        try:
            context.cache.keep_prediction(job.key(context), prediction(context, job))
            problems.append("")
        except Exception as error:  # reported in the model's place; the others go on
            problems.append(f"{type(error).__name__}: {error}")
    return problems


def do_tuning(context: Context, job: Job, trials: int) -> tuple[Tuned | str, int]:
    """Return what the trials of a model found, or why they failed, and how many were not in the cache."""
    context.refuse_other_code()
    computed = 0

    def percent(choice: Values) -> float:
        nonlocal computed
        trial = replace(job, hyperparameters=choice)
        key = trial.key(context)
        if not context.cache.has_prediction(key):
            computed += 1
            context.cache.keep_prediction(key, prediction(context, trial))
        return context.cache.validation_percent(key)

    try:
        return tune(job.model, trials, job.seed, percent), computed
    except TuningError as error:
        return f"{type(error).__name__}: {error}", computed


def prediction(context: Context, job: Job) -> Prediction:
    """Return the estimates, bounds and flags of every test recording of a fold, what they cost, and the validation.

    Tuning goes by the validation sessions alone; the best trial's estimates of test recordings are needed later.
    """
    sources, task = context.sources, job.task
    own = cases_of(sources, task, task.campaign, job.seed)
    tested = cases_of(sources, task, unseen_kind(task), job.seed) if job.split == UNSEEN_RIG else own
    fold = folds_of(sources, task, job.split, job.seed)[job.fold]
    trained = _trained(context, job, fold)
    names = () if job.model.trained_on == "twin" else fold.train
    known = training_range(sources, task, job.seed, names, inputs_of(sources, task, job.seed))
    validation = [own[name].recording for name in fold.validation]
    validated_n = [trained.estimator.estimate(recording) for recording in validation]
    percent = validation_percent(validation, validated_n)
    bounds = calibrated_bounds(validation, validated_n, validation[0].sample_time_s, warm_up_samples=0)
    estimates, steps_us = {}, []
    for name in fold.test:
        recording, started_s = tested[name].recording, process_time()
        friction_n = trained.estimator.estimate(recording)
        steps_us.append(1e6 * (process_time() - started_s) / len(recording))
        _refuse_not_finite(recording, friction_n)
        regime = regimes_of(recording, bounds.standstill_m_s, bounds.creep_m_s)
        lower_n, upper_n = (friction_n + np.array(each)[regime] for each in (bounds.lower_n, bounds.upper_n))
        estimates[name] = Estimates(friction_n, lower_n, upper_n, outside(known, recording))
    step_us = float(np.median(steps_us))
    return Prediction(estimates, trained.estimator.multiply_adds(), trained.training_s, step_us, percent)


def validation_percent(recordings: Sequence[Recording], estimates_n: Sequence[Array]) -> float:
    """Return MAE / mean |target| [%] over recordings together; against labels, as a user would have to tune."""
    error, friction = 0.0, 0.0
    for recording, estimate_n in zip(recordings, estimates_n, strict=True):
        _refuse_not_finite(recording, estimate_n)
        target_n = recording.column("friction_n")[recording.usable()]
        error += float(np.abs(estimate_n[recording.usable()] - target_n).sum())
        friction += float(np.abs(target_n).sum())
    return 100.0 * error / friction


def _refuse_not_finite(recording: Recording, estimate_n: Array) -> None:
    if not np.isfinite(estimate_n).all():
        row = int(np.argmin(np.isfinite(estimate_n)))
        raise ValueError(f"estimate is {estimate_n[row]} in row {row + 1} of recording {recording.name!r}")


def _trained(context: Context, job: Job, fold: Fold) -> Trained:
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
    hyperparameters = {**model.defaults, **job.hyperparameters}
    build = BuildConfiguration(sources.cylinder, inputs, job.seed, context.effort, hyperparameters)
    estimator = model.build(build)
    key = _fit_key(model.name, job.code, build, estimator.inputs, recordings)
    if key not in _LAST_FIT:
        before = process_time()
        estimator.fit(recordings)
        _LAST_FIT.clear()
        _LAST_FIT[key] = Trained(estimator, process_time() - before)
    return _LAST_FIT[key]


_LAST_FIT: dict[str, Trained] = {}  # The latest fit of this process: jobs that share a fit come one after another


def _fit_key(
    name: str, code: str, build: BuildConfiguration, inputs: Sequence[str], recordings: Sequence[Recording]
) -> str:
    """Return the hash of what a fit sees; columns that are none of its inputs may differ."""
    content = [name, code, {**asdict(build), "inputs": list(inputs)}]
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    for recording in recordings:
        metadata = recording.metadata
        digest.update(f"{metadata.name}/{metadata.condition}/{metadata.session}/{metadata.sample_time_s}".encode())
        digest.update(recording.samples(inputs).tobytes())
        digest.update(np.packbits(recording.usable()).tobytes())
        digest.update(recording.column("friction_n")[recording.usable()].tobytes())
    return digest.hexdigest()

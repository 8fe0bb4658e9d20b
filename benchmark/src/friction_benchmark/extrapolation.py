"""Where an estimate is an extrapolation: any input, or the speed, outside the range of the training recordings."""

from collections.abc import Iterable
from functools import lru_cache

from cylinder_friction.arrays import Mask
from cylinder_friction.realtime.bounds import causal_velocity
from cylinder_friction.realtime.guard import TrainingRange
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.cases import Task
from friction_benchmark.datasets import Sources, cases_of, twin_recordings

VELOCITY = "velocity_m_s"  # The column that counts besides an estimator's inputs, made from samples until now


@lru_cache(maxsize=1024)  # A handful of numbers for each task, fold and seed
def training_range(
    sources: Sources, task: Task, seed: int, names: tuple[str, ...], inputs: tuple[str, ...]
) -> TrainingRange:
    """Return the range of the inputs, and of the velocity last, in the named training recordings, or the twin's."""
    if not names:
        return range_of(twin_recordings(sources, task, seed), inputs)
    # A model whose target is friction now, not ahead, sees the same columns: targets are of no account here.
    cases = cases_of(sources, task, task.campaign, seed)
    return range_of((cases[name].recording for name in names), inputs)


def range_of(recordings: Iterable[Recording], inputs: tuple[str, ...]) -> TrainingRange:
    """Return the range of the inputs, and of the velocity last, in recordings."""
    return TrainingRange.of(map(_with_causal_velocity, recordings), (*inputs, VELOCITY))


def outside(known: TrainingRange, recording: Recording) -> Mask:
    """Return which rows of a recording lie outside a range, shape ``(n,)``."""
    return ~known.holds(_with_causal_velocity(recording).samples(known.columns))


def _with_causal_velocity(recording: Recording) -> Recording:
    return recording.with_columns(**{VELOCITY: causal_velocity(recording)})

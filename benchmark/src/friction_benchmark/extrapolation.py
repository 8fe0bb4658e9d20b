"""Where an estimate is an extrapolation: any input, or the speed, outside the range of the training recordings."""

from collections.abc import Iterable
from functools import lru_cache

from cylinder_friction.arrays import Mask
from cylinder_friction.realtime.bounds import causal_velocity
from cylinder_friction.realtime.guard import TrainingRange
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.cases import Task
from friction_benchmark.datasets import Sources, cases_of, twin_recordings

VELOCITY = "velocity_m_s"
"""The column that counts besides an estimator's inputs: by the off-line filter, or ``with_causal_velocity``."""


@lru_cache(maxsize=1024)
def training_range(
    sources: Sources, task: Task, seed: int, names: tuple[str, ...], inputs: tuple[str, ...], *, causal: bool
) -> TrainingRange:
    """Return the range of the inputs, and of the velocity last, in the training recordings.

    It is the same for all models with one training set, and a handful of numbers, so that a worker keeps those of all
    tasks, folds and seeds.

    Args:
        sources: Where the recordings are.
        task: Which.
        seed: Of the campaign.
        names: Training recordings of the task's campaign; none for the twin's.
        inputs: Columns that count.
        causal: Whether the velocity is made from samples until now, not off line.
    """
    recordings: Iterable[Recording]
    if names:
        # A model whose target is friction now, not ahead, sees the same columns: targets are of no account here.
        cases = cases_of(sources, task, task.campaign, seed)
        recordings = [cases[name].recording for name in names]
    else:
        recordings = twin_recordings(sources, task, seed)
    return TrainingRange.of(map(with_causal_velocity, recordings) if causal else recordings, (*inputs, VELOCITY))


def outside(known: TrainingRange, recording: Recording) -> Mask:
    """Return which rows of a recording lie outside a range, shape ``(n,)``; its columns are the range's."""
    return ~known.holds(recording.samples(known.columns))


def with_causal_velocity(recording: Recording) -> Recording:
    """Return the recording with the velocity that a flag goes by, from samples until now [m/s]."""
    return recording.with_columns(**{VELOCITY: causal_velocity(recording)})

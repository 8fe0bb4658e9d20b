"""Where an estimate goes beyond what its estimator was taught on: any input, or the speed, outside the taught range."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from cylinder_friction.realtime.bounds import causal_velocity
from cylinder_friction.realtime.guard import TrainingRange
from friction_benchmark.data import exams_of, twin_lessons_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from cylinder_friction.evaluation.bootstrap import Mask
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.data import Sources
    from friction_benchmark.tasks import Task

VELOCITY = "velocity_m_s"
"""The column that counts besides an estimator's inputs: by the off-line filter, or ``with_causal_velocity``."""


@lru_cache(maxsize=1024)
def taught_range(
    sources: Sources, task: Task, seed: int, names: tuple[str, ...], inputs: tuple[str, ...], *, causal: bool
) -> TrainingRange:
    """Return the range of the inputs, and of the velocity last, in what teaches.

    It is the same for all models of one teacher, and a handful of numbers, so that a worker keeps those of all tasks,
    folds and seeds.

    Args:
        sources: Where the recordings lie.
        task: What is asked.
        seed: Of the campaign.
        names: Of the recordings of the task's campaign that teach; none where the twin does.
        inputs: Columns that count.
        causal: Whether the velocity is made from samples until now, not off line.
    """
    taught: Iterable[Recording]
    if names:
        # A model that is taught friction now, not ahead, sees the same columns: targets are of no account here.
        exams = exams_of(sources, task, task.campaign, seed)
        taught = [exams[name].recording for name in names]
    else:
        taught = twin_lessons_of(sources, task, seed)
    return TrainingRange.of(map(with_causal_velocity, taught) if causal else taught, (*inputs, VELOCITY))


def outside(known: TrainingRange, recording: Recording) -> Mask:
    """Return which rows of a recording lie outside a range, shape ``(n,)``; its columns are the range's."""
    return ~known.holds(recording.samples(known.columns))


def with_causal_velocity(recording: Recording) -> Recording:
    """Return the recording with the velocity that a flag goes by, from samples until now [m/s]."""
    return recording.with_columns(**{VELOCITY: causal_velocity(recording)})

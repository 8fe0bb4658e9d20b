"""The guard's limits, from what an estimator was trained on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.realtime.model import Guard

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.estimators.training_range import TrainingRange
    from cylinder_friction.recordings.recording import Recording

ACCEPT_SPANS = 1.0
"""A reading may lie this many training spans outside the training range; then no working sensor gave it."""
FREEZE_TRAVEL_M = 5e-3
FREEZE_TIME_S = 2.0
FREEZE_FORCE_RATIO = 2.0
"""A piston that resists more than this many times the largest friction of training is not at rest by friction."""
WARM_UP_S = 3.0
RECOVERY_S = 3.0
"""After NaN, out-of-range and frozen stretches of 1 to 1000 samples the default hybrid is back within 0.5 N of the
undisturbed estimate, and stays there, after 50 samples in half of all cases and after 420 in 99 %; after a reset in the
middle of a motion after 88 and 490. (3360 disturbances of the 16 test recordings at 200 Hz.)"""


def guard_from(training_range: TrainingRange, largest_friction_n: float, sample_time_s: float) -> Guard:
    """Return the guard of an estimator.

    Args:
        training_range: Smallest and largest raw samples of training.
        largest_friction_n: Largest absolute label of training [N]; infinite where it is not known, which leaves a
            frozen position unnoticed.
        sample_time_s: Between two samples [s].
    """
    accept, trained = training_range.widened(ACCEPT_SPANS), training_range.widened()
    return Guard(
        accept_lower=_first_three(accept.lower),
        accept_upper=_first_three(accept.upper),
        trained_lower=_first_three(trained.lower),
        trained_upper=_first_three(trained.upper),
        freeze_travel_m=FREEZE_TRAVEL_M,
        freeze_samples=round(FREEZE_TIME_S / sample_time_s),
        freeze_force_n=min(FREEZE_FORCE_RATIO * largest_friction_n, UNKNOWN_FORCE_N),
        warm_up_samples=round(WARM_UP_S / sample_time_s),
        recovery_samples=round(RECOVERY_S / sample_time_s),
    )


UNKNOWN_FORCE_N = 1e9
"""Larger than any cylinder's force: stands where no label told the largest friction."""


def largest_friction_n(recordings: Sequence[Recording]) -> float:
    """Return the largest absolute label of the usable rows [N]; 0 without any."""
    return max(
        (
            float(abs(recording.column("friction_n")[recording.usable()]).max())
            for recording in recordings
            if recording.usable().any()
        ),
        default=0.0,
    )


def _first_three(values: tuple[float, ...]) -> tuple[float, float, float]:
    """Return the limits of the raw sample, P1, P2, x, which a guarded estimator's inputs begin with."""
    return values[0], values[1], values[2]

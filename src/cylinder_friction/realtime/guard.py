"""What a sample must be: the range that an estimator was trained on, and the limits that follow from it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.model import Guard
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.columns import POSITION, PRESSURES, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

TRAINED_MARGIN = 0.05
"""Share of its span by which a range is widened before a value counts as beyond it, and an estimate as extrapolated."""
ACCEPT_SPANS = 1.0
"""A reading may lie this many training spans outside the training range; beyond, no working sensor gave it."""
FREEZE_TRAVEL_M, FREEZE_TRAVELS = 5e-3, 3.0
"""A pressure that stays exactly constant over more travel is frozen: more than this, and than so many times the longest
travel over which one did in a recording of training, half of them, as converters of coarse steps make it."""
FREEZE_TIME_S = 2.0
FREEZE_FORCE_RATIO = 2.0
"""A piston that resists more than this many times the largest friction of training is not at rest by friction."""
UNKNOWN_FORCE_N = 1e9  # Larger than any cylinder's force: stands for an unknown largest friction of training
WARM_UP_S = 3.0
RECOVERY_S = 3.0
"""After NaN, out-of-range and frozen stretches of 1 to 1000 samples the default hybrid is back within 0.5 N of the
undisturbed estimate, and stays there, after 50 samples in half of all cases and after 420 in 99 %; after a reset in the
middle of a motion after 88 and 490. (3360 disturbances of the 16 test recordings at 200 Hz.)"""


@dataclass(frozen=True)
class TrainingRange:
    """Smallest and largest value of each column in training: raw samples, and the velocity if it counts."""

    columns: tuple[str, ...]  # Of a recording
    # One number per column, in its unit
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @classmethod
    def of(cls, recordings: Iterable[Recording], columns: Sequence[str] = SAMPLE_COLUMNS) -> Self:
        """Return the range of these recordings, at least one."""
        samples = (recording.samples(columns) for recording in recordings)
        lowest, highest = zip(*((each.min(axis=0), each.max(axis=0)) for each in samples), strict=True)
        lower, upper = np.min(lowest, axis=0), np.max(highest, axis=0)
        return cls(tuple(columns), tuple(map(float, lower)), tuple(map(float, upper)))

    def widened(self, share: float = TRAINED_MARGIN) -> Self:
        """Return the range with ``share`` of each column's span more on either side."""
        slack = [share * (upper - lower) for lower, upper in zip(self.lower, self.upper, strict=True)]
        return type(self)(
            self.columns,
            tuple(lower - more for lower, more in zip(self.lower, slack, strict=True)),
            tuple(upper + more for upper, more in zip(self.upper, slack, strict=True)),
        )

    def trusted(self, load: PositionLoad | None) -> Self:
        """Return the range with its margin, cut to the positions between which a load that they decide is known."""
        wide = self.widened()
        if load is None:
            return wide
        lowest, highest = list(wide.lower), list(wide.upper)
        for axis in load.axes:
            place = wide.columns.index(axis.column)
            lowest[place], highest[place] = max(lowest[place], axis.first_m), min(highest[place], axis.last_m)
        return type(self)(wide.columns, tuple(lowest), tuple(highest))

    def holds(self, samples: Array) -> NDArray[np.bool_]:
        """Return which rows of ``samples``, shape ``(n, columns)``, lie in the range, widened by the margin.

        A row outside is what a real-time step flags as ``OUTSIDE``.
        """
        wide = self.widened()
        return np.asarray(((samples >= np.array(wide.lower)) & (samples <= np.array(wide.upper))).all(axis=1))


def guard_from(
    training_range: TrainingRange,
    largest_friction_n: float,
    sample_time_s: float,
    load: PositionLoad | None = None,
    freeze_travel_m: float = FREEZE_TRAVEL_M,
) -> Guard:
    """Return the guard of an estimator.

    Args:
        training_range: Smallest and largest raw samples of training, one column per input.
        largest_friction_n: Largest absolute label of training [N]; infinite if it is not known, which leaves a
            frozen position unnoticed.
        sample_time_s: Between two samples [s].
        load: Decided by position: positions at which it is not known count as outside the training range.
        freeze_travel_m: Over which a healthy pressure may stay exactly constant [m].
    """
    accept, trained = training_range.widened(ACCEPT_SPANS), training_range.trusted(load)
    return Guard(
        accept_lower=accept.lower,
        accept_upper=accept.upper,
        trained_lower=trained.lower,
        trained_upper=trained.upper,
        freeze_travel_m=freeze_travel_m,
        freeze_samples=round(FREEZE_TIME_S / sample_time_s),
        freeze_force_n=min(FREEZE_FORCE_RATIO * largest_friction_n, UNKNOWN_FORCE_N),
        warm_up_samples=round(WARM_UP_S / sample_time_s),
        recovery_samples=round(RECOVERY_S / sample_time_s),
    )


def freeze_travel_m(recordings: Iterable[Recording]) -> float:
    """Return the travel over which a healthy pressure may stay exactly constant [m]."""
    longest_m = [_longest_constant_m(each, name) for each in recordings for name in PRESSURES if name in each.columns]
    return max(FREEZE_TRAVEL_M, FREEZE_TRAVELS * float(np.median(longest_m))) if longest_m else FREEZE_TRAVEL_M


def _longest_constant_m(recording: Recording, column: str) -> float:
    values, position_m = recording.column(column), recording.column(POSITION)
    starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
    return float(np.max(np.maximum.reduceat(position_m, starts) - np.minimum.reduceat(position_m, starts)))


def largest_friction_n(recordings: Iterable[Recording]) -> float:
    """Return the largest absolute label of the usable rows [N]; 0 without any."""
    labels = (recording.column("friction_n")[recording.usable()] for recording in recordings)
    return max((float(abs(label).max()) for label in labels if len(label)), default=0.0)

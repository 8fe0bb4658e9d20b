"""Limits of valid samples: the range that an estimator was trained on, and the limits that follow from it."""

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
"""Share of its span by which a range is widened; an estimate from a value beyond that is an extrapolation."""
ACCEPT_SPANS = 1.0
"""A reading further outside the training range than this many training spans is not from a working sensor."""
FREEZE_TRAVEL_M, FREEZE_TRAVELS = 5e-3, 3.0
"""A pressure is frozen if it stays exactly constant over more travel than this, and than this multiple of the longest
constant travel in training (median of recordings), which converters with coarse steps cause."""
FREEZE_TIME_S = 2.0
FREEZE_FORCE_RATIO = 2.0
"""Friction cannot hold a piston at rest against more than this multiple of the largest friction of training."""
UNKNOWN_FORCE_N = 1e9  # Stands for an unknown largest friction of training: larger than any cylinder's force
WARM_UP_S = 3.0
RECOVERY_S = 3.0
"""Time after which a disturbance no longer shows. After 1 to 1000 bad or frozen samples, the default hybrid stays
within 0.5 N of the undisturbed estimate from 50 samples on in half of all cases, and from 420 on in 99 %. After a reset
in the middle of a motion these are 88 and 490 samples (3360 disturbances of the 16 test recordings at 200 Hz)."""


@dataclass(frozen=True)
class TrainingRange:
    """Smallest and largest value of each column in training: raw samples, and the velocity if it is checked."""

    columns: tuple[str, ...]  # Of a recording
    # One number per column, in its unit
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @classmethod
    def of(cls, recordings: Iterable[Recording], columns: Sequence[str] = SAMPLE_COLUMNS) -> Self:
        """Find the range of at least one recording."""
        samples = (recording.samples(columns) for recording in recordings)
        lowest, highest = zip(*((each.min(axis=0), each.max(axis=0)) for each in samples), strict=True)
        lower, upper = np.min(lowest, axis=0), np.max(highest, axis=0)
        return cls(tuple(columns), tuple(map(float, lower)), tuple(map(float, upper)))

    def widened(self, share: float = TRAINED_MARGIN) -> Self:
        """Widen the range on either side by ``share`` of each column's span."""
        slack = [share * (upper - lower) for lower, upper in zip(self.lower, self.upper, strict=True)]
        return type(self)(
            self.columns,
            tuple(lower - more for lower, more in zip(self.lower, slack, strict=True)),
            tuple(upper + more for upper, more in zip(self.upper, slack, strict=True)),
        )

    def trusted(self, load: PositionLoad | None) -> Self:
        """Widen the range by its margin, and cut it to the positions at which a position-dependent load is known."""
        wide = self.widened()
        if load is None:
            return wide
        lowest, highest = list(wide.lower), list(wide.upper)
        for axis in load.axes:
            place = wide.columns.index(axis.column)
            lowest[place], highest[place] = max(lowest[place], axis.first_m), min(highest[place], axis.last_m)
        return type(self)(wide.columns, tuple(lowest), tuple(highest))

    def holds(self, samples: Array) -> NDArray[np.bool_]:
        """Mark the rows of ``samples``, shape ``(n, columns)``, that lie in the widened range.

        A real-time step flags the other rows as ``OUTSIDE``.
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
    """Derive the guard of an estimator from its training range.

    Args:
        training_range: Smallest and largest raw samples of training, one column per input.
        largest_friction_n: Largest absolute label of training [N]; infinite if it is unknown, and a frozen position
            then goes unnoticed.
        sample_time_s: Sample time [s].
        load: The load that position decides; positions with unknown load count as outside the training range.
        freeze_travel_m: Longest travel over which a healthy pressure stays exactly constant [m].
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
    """Find the longest travel over which a healthy pressure stays exactly constant [m]."""
    longest_m = [_longest_constant_m(each, name) for each in recordings for name in PRESSURES if name in each.columns]
    return max(FREEZE_TRAVEL_M, FREEZE_TRAVELS * float(np.median(longest_m))) if longest_m else FREEZE_TRAVEL_M


def _longest_constant_m(recording: Recording, column: str) -> float:
    values, position_m = recording.column(column), recording.column(POSITION)
    starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
    return float(np.max(np.maximum.reduceat(position_m, starts) - np.minimum.reduceat(position_m, starts)))


def largest_friction_n(recordings: Iterable[Recording]) -> float:
    """Find the largest absolute label of the usable rows [N]; 0 without any."""
    labels = (recording.column("friction_n")[recording.usable()] for recording in recordings)
    return max((float(abs(label).max()) for label in labels if len(label)), default=0.0)

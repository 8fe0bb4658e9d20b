"""What an estimator was taught on, column by column, and how far beyond it still counts as known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.recording import Recording

    Array = NDArray[np.float64]

TRAINED_MARGIN = 0.05
"""Share of its span by which a range is widened before a value counts as beyond it, and an estimate as extrapolated."""


@dataclass(frozen=True)
class TrainingRange:
    """Smallest and largest value of each column that was taught: raw samples, and the velocity where it counts.

    Attributes:
        columns: Of a recording.
        lower, upper: One number a column, in its unit.
    """

    columns: tuple[str, ...]
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

    def holds(self, samples: Array) -> NDArray[np.bool_]:
        """Return which rows of ``samples``, shape ``(n, columns)``, lie in the range, widened by the margin."""
        wide = self.widened()
        return np.asarray(((samples >= np.array(wide.lower)) & (samples <= np.array(wide.upper))).all(axis=1))

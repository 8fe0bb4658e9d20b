"""Types of arrays, runs of a mask, and extremes over sliding windows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def true_runs(mask: Mask) -> NDArray[np.int64]:
    """Find the first place of each run of true values and the place behind its last, shape ``(runs, 2)``."""
    padded = np.concatenate([[False], mask, [False]])
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)


def sliding_extremes(values: Array, width: int) -> tuple[Array, Array]:
    """Find the least and the greatest value within ``width`` samples around each, fewer at the ends, each ``(n,)``.

    ``width // 2`` of them lie before the sample. Spans double from pass to pass; no value is NaN.
    """
    return -_sliding_greatest(-values, width), _sliding_greatest(values, width)


def _sliding_greatest(values: Array, width: int) -> Array:
    rows, span = len(values), 1
    greatest = np.full(rows + width - 1, -np.inf)
    greatest[width // 2 : width // 2 + rows] = values
    while 2 * span <= width:
        greatest, span = np.maximum(greatest[:-span], greatest[span:]), 2 * span
    return np.maximum(greatest[:rows], greatest[width - span :][:rows])

"""Marks the bad samples of a signal, one after the other, in compiled code."""

import numba
import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.checks.marks import AT_ITS_END, BESIDE, INFINITE, MOST_ODD, OUT_OF_RANGE, QUIET, SPIKE


@numba.njit(cache=True)
def mark(
    values: Array, low: float, high: float, bottom: float, top: float, height: float, marks: NDArray[np.uint8]
) -> NDArray[np.int64]:
    """Fill ``marks``; return the longest run of each mark."""
    longest = np.zeros(5, dtype=np.int64)
    run_kind, run = 0, 0
    close = 0  # rows left in which a spike may begin: a jump was seen
    last, middle, peak = np.nan, np.nan, np.nan
    for row in range(values.shape[0]):
        value = values[row]
        kind = 0
        if value < low or value > high:
            kind = INFINITE if np.isinf(value) else OUT_OF_RANGE
        elif value <= bottom or value >= top:
            kind = INFINITE if np.isinf(value) else AT_ITS_END
        else:
            if abs(value - last) > 0.7 * height:
                close = MOST_ODD
            if run_kind == SPIKE and run < MOST_ODD and abs(value - middle) > 0.5 * peak:
                kind = SPIKE  # the rest of one that was found
            elif close > 0:
                close -= 1
                found = _level_below(values, row, low, high, height)
                if not np.isnan(found):
                    kind, middle, peak = SPIKE, found, abs(value - found)
            last = value
        if kind == 0:
            run_kind = 0
            continue
        begin = row
        if kind == SPIKE and run_kind != SPIKE:  # its first samples may have been less clear
            while row - begin + 1 < MOST_ODD and marks[begin - 1] == 0 and abs(values[begin - 1] - middle) > 0.5 * peak:
                begin -= 1
        marks[begin : row + 1] = kind
        run = run + 1 if kind == run_kind else row + 1 - begin
        run_kind = kind
        longest[kind] = max(longest[kind], run)
    return longest


@numba.njit(cache=True)
def _level_below(values: Array, row: int, low: float, high: float, height: float) -> float:
    """Return the level that a spike stands on; NaN if the sample is none.

    It is one if it lies far from the median of its neighbours, and they agree among themselves.
    """
    if row < BESIDE or row >= values.shape[0] - BESIDE:
        return np.nan  # at an end, whether it comes back is unknown
    near = np.empty(2 * BESIDE + 1)
    count = 0
    for other in range(row - BESIDE, row + BESIDE + 1):
        if low <= values[other] <= high and not np.isinf(values[other]):  # NaN fails both
            near[count] = values[other]
            count += 1
    if count < 2 * BESIDE + 1 - MOST_ODD:
        return np.nan
    middle = np.median(near[:count])
    distance = abs(values[row] - middle)
    if distance <= height:
        return np.nan
    odd = 0
    for index in range(count):
        if abs(near[index] - middle) > QUIET * distance:
            odd += 1
    return middle if odd <= MOST_ODD else np.nan

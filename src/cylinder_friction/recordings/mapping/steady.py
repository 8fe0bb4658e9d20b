"""Stretches in which nothing changes, and how well their mean is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FEWEST_BLOCKS = 8
"""Means of fewer blocks scatter too little or too much to be meaningful."""


@numba.njit(cache=True)
def longest_steady(signals: Array, spans: Array, bounds: Array) -> tuple[int, int]:
    """Return the first row and the row after the last of the longest stretch in which every signal is steady.

    Args:
        signals: One column a signal, shape ``(n, m)``; a NaN ends a stretch.
        spans: Within a stretch a signal's largest and smallest value differ by no more than this, shape ``(m,)``.
        bounds: Within a stretch no value is further from zero than this, shape ``(m,)``.

    Of stretches of equal length the first; (0, 0) if there is none. One pass: two monotone queues a signal hold the
    largest and smallest value of the current stretch (Lemire 2006, Streaming maximum-minimum filter).
    """
    rows, count = signals.shape
    highs = np.empty((count, rows), dtype=np.int32)
    lows = np.empty((count, rows), dtype=np.int32)
    ends = np.zeros((count, 4), dtype=np.int64)  # of highs: head, tail; of lows: head, tail
    best_first, best_end, first = 0, 0, 0
    for row in range(rows):
        for signal in range(count):
            value = signals[row, signal]
            if not abs(value) <= bounds[signal]:
                first = row + 1
        if first > row:
            ends[:] = 0
            continue
        for signal in range(count):
            value = signals[row, signal]
            head_high, tail_high, head_low, tail_low = ends[signal]
            while tail_high > head_high and signals[highs[signal, tail_high - 1], signal] <= value:
                tail_high -= 1
            highs[signal, tail_high] = row
            tail_high += 1
            while tail_low > head_low and signals[lows[signal, tail_low - 1], signal] >= value:
                tail_low -= 1
            lows[signal, tail_low] = row
            tail_low += 1
            high, low = highs[signal, head_high], lows[signal, head_low]
            while signals[high, signal] - signals[low, signal] > spans[signal]:
                first = max(first, min(high, low) + 1)
                while highs[signal, head_high] < first:
                    head_high += 1
                while lows[signal, head_low] < first:
                    head_low += 1
                high, low = highs[signal, head_high], lows[signal, head_low]
            ends[signal, 0], ends[signal, 1], ends[signal, 2], ends[signal, 3] = (
                head_high,
                tail_high,
                head_low,
                tail_low,
            )
        for signal in range(count):
            while ends[signal, 0] < ends[signal, 1] and highs[signal, ends[signal, 0]] < first:
                ends[signal, 0] += 1
            while ends[signal, 2] < ends[signal, 3] and lows[signal, ends[signal, 2]] < first:
                ends[signal, 2] += 1
        if row + 1 - first > best_end - best_first:
            best_first, best_end = first, row + 1
    return best_first, best_end


def averaged(signals: Array, half: int) -> Array:
    """Return the centred moving average over ``2·half + 1`` rows, fewer towards the ends, shape ``(n, m)``."""
    if half < 1 or len(signals) == 0:
        return signals
    # Sums of what differs from the first row: a long sum of large numbers loses the digits of small changes.
    sums = np.concatenate([np.zeros((1, signals.shape[1])), np.cumsum(signals - signals[0], axis=0)])
    rows = np.arange(len(signals))
    first, end = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(signals))
    result: Array = signals[0] + (sums[end] - sums[first]) / (end - first)[:, None]
    return result


def mean_uncertainty(values: Array) -> float:
    """Return the standard uncertainty of the mean of samples that may depend on each other, shape ``(n,)``.

    Neighbours are averaged in pairs again and again; σ/√n of the blocks grows until they are independent of each other,
    and its largest value is taken, down to 8 blocks (Flyvbjerg & Petersen 1989, J. Chem. Phys. 91, 461). A slow drift
    counts too: the largest blocks show it.
    """
    blocks = np.asarray(values, dtype=np.float64) - values[0]
    largest = 0.0
    while len(blocks) >= FEWEST_BLOCKS:
        largest = max(largest, float(np.std(blocks, ddof=1)) / len(blocks) ** 0.5)
        even = len(blocks) // 2 * 2
        blocks = 0.5 * (blocks[0:even:2] + blocks[1:even:2])
    return largest

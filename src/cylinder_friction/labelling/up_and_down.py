"""Friction extending and retracting at equal positions: half the difference is friction, half the sum a load."""

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array

POSITION_BINS = 30
LEAST_ROWS_A_BIN = 10

LOAD_SHARE = 0.5
"""Share of friction above which a force that does not turn with the direction counts as a load."""


def holds_load(load_n: float, half_difference_n: float) -> bool:
    """Check whether a force contains a load, from the result of ``up_and_down``; False if that is unknown."""
    return abs(load_n) > LOAD_SHARE * abs(half_difference_n)


def up_and_down(
    position_m: Array, velocity_m_s: Array, friction_n: Array, usable: NDArray[np.bool_], slowest_m_s: float
) -> tuple[float, float]:
    """Compute the medians of half the sum and half the difference of the force up and down at equal positions [N].

    A force that depends on position alone, such as a load's weight, appears in the sum, not in the difference.
    """
    moving = np.flatnonzero(usable & (np.abs(velocity_m_s) > slowest_m_s))
    down = velocity_m_s[moving] < 0.0
    if down.all() or not down.any():
        return float("nan"), float("nan")
    within_m = position_m[usable]
    edges = np.linspace(float(within_m.min()), float(within_m.max()), POSITION_BINS + 1)
    bins = np.searchsorted(edges[1:-1], position_m[moving], side="right") + POSITION_BINS * down
    medians_n, counts = _medians(friction_n[moving], bins.astype(np.uint8), 2 * POSITION_BINS)
    both = (counts.reshape(2, -1) >= LEAST_ROWS_A_BIN).all(axis=0)
    if not both.any():
        return float("nan"), float("nan")
    extending_n, retracting_n = medians_n.reshape(2, -1)[:, both]
    return float(np.median(0.5 * (extending_n + retracting_n))), float(np.median(0.5 * (extending_n - retracting_n)))


def _medians(values: Array, bins: NDArray[np.uint8], count: int) -> tuple[Array, NDArray[np.int64]]:
    """Compute each bin's median and number of values, ``(count,)``; the median of an empty bin is arbitrary."""
    counts, order = np.bincount(bins, minlength=count), np.argsort(values)
    ordered = values[order[np.argsort(bins[order], kind="stable")]]  # small numbers sort fast
    starts = np.minimum(np.cumsum(counts) - counts, len(values) - 1)
    below, above = (ordered[starts + middle] for middle in (np.maximum(counts - 1, 0) // 2, counts // 2))
    return 0.5 * (below + above), counts

"""Friction extending and retracting at equal positions: half the difference is friction, half the sum a load."""

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array

POSITION_BINS = 30
LEAST_ROWS_A_BIN = 10

LOAD_SHARE = 0.5
"""A force that does not turn with the direction and is above this share of the one that does is a load."""


def holds_load(load_n: float, half_difference_n: float) -> bool:
    """Return whether a force holds a load, from what ``up_and_down`` gives; False where that is not known."""
    return abs(load_n) > LOAD_SHARE * abs(half_difference_n)


def up_and_down(
    position_m: Array, velocity_m_s: Array, friction_n: Array, usable: NDArray[np.bool_], slowest_m_s: float
) -> tuple[float, float]:
    """Return half the sum and half the difference of the force up and down at equal positions, medians [N].

    A force that depends on position alone, such as a load's weight, is in the sum and not in the difference.
    """
    up, down = usable & (velocity_m_s > slowest_m_s), usable & (velocity_m_s < -slowest_m_s)
    if not up.any() or not down.any():
        return float("nan"), float("nan")
    edges = np.linspace(float(position_m[usable].min()), float(position_m[usable].max()), POSITION_BINS + 1)
    extending, retracting = (_medians(position_m[rows], friction_n[rows], edges) for rows in (up, down))
    both = extending.keys() & retracting.keys()
    halves = [(0.5 * (extending[n] + retracting[n]), 0.5 * (extending[n] - retracting[n])) for n in sorted(both)]
    if not halves:
        return float("nan"), float("nan")
    load_n, half_difference_n = np.median(np.array(halves), axis=0)
    return float(load_n), float(half_difference_n)


def _medians(position_m: Array, values: Array, edges: Array) -> dict[int, float]:
    """Return the median of the values of each bin that holds enough of them, by the bin's number."""
    order = np.argsort(values)
    numbers = np.clip(np.digitize(position_m[order], edges) - 1, 0, POSITION_BINS - 1).astype(np.uint8)
    values = values[order[np.argsort(numbers, kind="stable")]]  # small numbers sort fast
    counts = np.bincount(numbers, minlength=POSITION_BINS)
    starts, enough = np.cumsum(counts) - counts, np.flatnonzero(counts >= LEAST_ROWS_A_BIN)
    below, above = (values[starts[enough] + middle[enough]] for middle in ((counts - 1) // 2, counts // 2))
    return dict(zip(enough.tolist(), (0.5 * (below + above)).tolist(), strict=True))

"""Bounds around any model's estimate: conformal by what is known at that moment, with sessions kept whole.

Errors on validation sessions are sorted into bins that are known at the moment of an estimate: the regime of motion
(standstill, creep, sliding, reversal), whether the estimate is small or large, and whether it was small, middling or
large over the last seconds, which separates loads where a model can. ``realtime.bounds`` gives each bin its interval,
as it does for the product's regimes. That alone is too narrow for another session, because errors of one session are
alike. So validation sessions are left out in turn, in groups of one per condition, the intervals are made from the
others, and one factor is found by which they must be widened for the left-out rows to lie inside with the probability
asked for: the jackknife+ idea (Barber, Candès, Ramdas and Tibshirani 2021) with sessions as the clusters (Dunn,
Wasserman and Ramdas 2022). It is a correction, not a guarantee; coverage is measured on the test sessions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.realtime.bounds import (
    PROBABILITY,
    REGIMES,
    causal_velocity,
    conformal_offsets,
    creep_below_m_s,
    regimes_of,
    standstill_below_m_s,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.recordings.recording import Recording

    Bins = NDArray[np.int64]

SIZES, LEVELS = 2, 3
LEVEL_TIME_S = 2.0
"""Over which the size of estimates is averaged to separate loads."""
BINS = len(REGIMES) * SIZES * LEVELS
FEWEST_ROWS = 100
"""A bin with fewer calibrating rows takes the interval of all rows together."""
STRIDE = 5
"""Every so many rows calibrate: neighbours are alike, and quantiles take time."""
GROUPS = 6
"""Into how many groups validation sessions are dealt, at most."""


@dataclass(frozen=True, eq=False)
class ErrorBounds:
    """Where reference - estimate lies.

    Attributes:
        lower_n, upper_n: Offset of the bounds from the estimate in each bin [N], shape ``(BINS,)``.
        edges_n: Where a large estimate begins, absolute [N], shape ``(SIZES - 1,)``.
        level_edges_n: Where its middling and its large running mean begin [N], shape ``(LEVELS - 1,)``.
        factor: By which intervals between sessions are wider than within.
        slow_m_s: Below which the piston stands still, and below which it creeps [m/s].
    """

    lower_n: Array
    upper_n: Array
    edges_n: Array
    level_edges_n: Array
    factor: float
    slow_m_s: tuple[float, float]

    def around(self, recording: Recording, estimate_n: Array) -> tuple[Array, Array]:
        """Return lower and upper bound [N] of an estimate, shape ``(n,)`` each."""
        bins = _bins(_known(recording, estimate_n, self.slow_m_s), self.edges_n, self.level_edges_n)
        return estimate_n + self.lower_n[bins], estimate_n + self.upper_n[bins]


@dataclass(frozen=True, eq=False)
class _Known:
    """What bins go by, shape ``(n,)`` each: regime, size of the estimate and running mean of that size [N]."""

    regime: Bins
    size_n: Array
    level_n: Array

    def at(self, rows: Bins) -> _Known:
        return _Known(self.regime[rows], self.size_n[rows], self.level_n[rows])


def calibrated(
    recordings: Sequence[Recording], estimates_n: Sequence[Array], probability: float = PROBABILITY
) -> ErrorBounds:
    """Return bounds between which the label of another session lies with ``probability``.

    Args:
        recordings: Labelled, of sessions that the model was not trained on.
        estimates_n: Its estimates for them [N].
        probability: In (0, 1).

    Raises:
        ValueError: There is no usable row, or no such probability.
    """
    rows = [np.flatnonzero(recording.usable())[::STRIDE] for recording in recordings]
    if not any(len(each) for each in rows):
        raise ValueError(f"none of {len(recordings)} validation recordings has a usable row; expected at least one")
    pairs = list(zip(recordings, estimates_n, rows, strict=True))
    errors = np.concatenate([(each.column("friction_n") - estimate_n)[chosen] for each, estimate_n, chosen in pairs])
    standstill_m_s = standstill_below_m_s(recordings)
    slow_m_s = (standstill_m_s, creep_below_m_s([causal_velocity(each) for each in recordings], standstill_m_s))
    parts = [_known(each, estimate_n, slow_m_s).at(chosen) for each, estimate_n, chosen in pairs]
    known = _Known(
        np.concatenate([part.regime for part in parts]),
        np.concatenate([part.size_n for part in parts]),
        np.concatenate([part.level_n for part in parts]),
    )
    edges_n = np.quantile(known.size_n, np.arange(1, SIZES) / SIZES)
    level_edges_n = np.quantile(known.level_n, np.arange(1, LEVELS) / LEVELS)
    bins = _bins(known, edges_n, level_edges_n)
    group = np.repeat(_groups(recordings), [len(chosen) for chosen in rows])
    factor = _factor(errors, bins, group, probability)
    lower, upper = conformal_offsets(errors, bins, BINS, probability, FEWEST_ROWS)
    centre, half = 0.5 * (lower + upper), 0.5 * factor * (upper - lower)
    return ErrorBounds(centre - half, centre + half, edges_n, level_edges_n, factor, slow_m_s)


def _factor(errors: Array, bins: Bins, group: Bins, probability: float) -> float:
    """Return how much wider intervals made from other sessions must be; at least 1, and 1 for a single group."""
    numbers = np.unique(group)
    if len(numbers) < 2:
        return 1.0
    relative = np.empty(len(errors))
    for number in numbers:
        own = group == number
        lower, upper = conformal_offsets(errors[~own], bins[~own], BINS, probability, FEWEST_ROWS)
        centre, half = 0.5 * (lower + upper), np.maximum(0.5 * (upper - lower), 1e-9)
        relative[own] = np.abs(errors[own] - centre[bins[own]]) / half[bins[own]]
    return max(1.0, float(np.quantile(relative, probability)))


def _groups(recordings: Sequence[Recording]) -> Bins:
    """Return each recording's group, shape ``(len(recordings),)``: the sessions of each condition are dealt in turn."""
    sessions: dict[str, set[str]] = {}
    for recording in recordings:
        sessions.setdefault(recording.metadata.condition, set()).add(recording.metadata.session)
    group = {session: number % GROUPS for names in sessions.values() for number, session in enumerate(sorted(names))}
    return np.array([group[recording.metadata.session] for recording in recordings], dtype=np.int64)


def _known(recording: Recording, estimate_n: Array, slow_m_s: tuple[float, float]) -> _Known:
    size_n = np.abs(estimate_n)
    return _Known(
        regimes_of(recording, *slow_m_s), size_n, _running_mean(size_n, recording.sample_time_s / LEVEL_TIME_S)
    )


@numba.njit(cache=True)
def _running_mean(values: Array, weight: float) -> Array:
    """Return the mean until each row, shape ``(n,)``: of all rows at first, then with exponential forgetting."""
    result = np.empty(values.shape[0])
    mean = 0.0
    for row in range(values.shape[0]):
        mean += max(weight, 1.0 / (row + 1.0)) * (values[row] - mean)
        result[row] = mean
    return result


def _bins(known: _Known, edges_n: Array, level_edges_n: Array) -> Bins:
    place = known.regime * SIZES + np.digitize(known.size_n, edges_n)
    return np.asarray(place * LEVELS + np.digitize(known.level_n, level_edges_n))

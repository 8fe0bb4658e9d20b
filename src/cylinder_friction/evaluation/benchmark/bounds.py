"""Bounds around any model's estimate: conformal by regime of motion and size of the estimate, with sessions kept whole.

Errors on validation sessions are sorted into bins that are known at the moment of an estimate: the regime of motion
(standstill, creep, sliding, reversal) and whether the estimate is small, middling or large. Their quantiles give an
interval a bin, as ``estimators.realtime.bounds`` does. That alone is too narrow for another session, because errors of
one session are alike. So each validation session is left out in turn, the intervals are made from the others, and one
factor is found by which they must be widened for the left-out rows to lie inside with the probability asked for: the
jackknife+ idea (Barber, Candès, Ramdas and Tibshirani 2021) with sessions as the clusters (Dunn, Wasserman and Ramdas
2022). It is a correction, not a guarantee; coverage is measured on the test sessions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.realtime.bounds import REGIMES, regimes_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.evaluation.bootstrap import Array
    from cylinder_friction.recordings import Recording

PROBABILITY = 0.9
SIZES = 3
BINS = len(REGIMES) * SIZES
FEWEST_ROWS = 100
"""A bin with fewer calibrating rows takes the interval of all rows together."""
STRIDE = 5
"""Every so many rows calibrate: neighbours are alike, and quantiles take time."""


@dataclass(frozen=True, eq=False)
class ErrorBounds:
    """Where reference - estimate lies.

    Attributes:
        lower_n, upper_n: Offset of the bounds from the estimate in each bin [N], shape ``(BINS,)``.
        edges_n: Where a middling and a large estimate begin, absolute [N], shape ``(SIZES - 1,)``.
        factor: By which intervals between sessions are wider than within.
    """

    lower_n: Array
    upper_n: Array
    edges_n: Array
    factor: float

    def around(self, recording: Recording, estimate_n: Array) -> tuple[Array, Array]:
        """Returns lower and upper bound [N] of an estimate, shape ``(n,)`` each."""
        bins = _bins(regimes_of(recording), estimate_n, self.edges_n)
        return estimate_n + self.lower_n[bins], estimate_n + self.upper_n[bins]


def calibrated(
    recordings: Sequence[Recording], estimates_n: Sequence[Array], probability: float = PROBABILITY
) -> ErrorBounds:
    """Returns bounds between which the label of another session lies with ``probability``.

    Args:
        recordings: Labelled, of sessions that the model did not learn from.
        estimates_n: What it said of them [N].
        probability: In (0, 1).

    Raises:
        ValueError: There is no usable row, or no such probability.
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability must be in (0, 1), but got {probability!r}")
    rows = [np.flatnonzero(recording.usable())[::STRIDE] for recording in recordings]
    if not any(len(each) for each in rows):
        raise ValueError(f"none of {len(recordings)} validation recordings has a usable row; expected at least one")
    pairs = list(zip(recordings, estimates_n, rows, strict=True))
    estimate = np.concatenate([said[chosen] for _, said, chosen in pairs])
    label = np.concatenate([recording.column("friction_n")[chosen] for recording, _, chosen in pairs])
    regime = np.concatenate([regimes_of(recording)[chosen] for recording, _, chosen in pairs])
    sessions = np.concatenate([np.full(len(c), recording.metadata.session) for recording, _, c in pairs])
    edges = np.quantile(np.abs(estimate), np.arange(1, SIZES) / SIZES)
    bins = _bins(regime, estimate, edges)
    lower, upper = _intervals(label - estimate, bins, probability)
    factor = _factor(label - estimate, bins, sessions, probability)
    centre, half = 0.5 * (lower + upper), 0.5 * factor * (upper - lower)
    return ErrorBounds(centre - half, centre + half, edges, factor)


def _factor(errors: Array, bins: NDArray[np.int64], sessions: NDArray[np.str_], probability: float) -> float:
    """Returns how much wider intervals made from other sessions must be; at least 1, and 1 for a single session."""
    names = np.unique(sessions)
    if len(names) < 2:
        return 1.0
    relative = np.empty(len(errors))
    for name in names:
        own = sessions == name
        lower, upper = _intervals(errors[~own], bins[~own], probability)
        centre, half = 0.5 * (lower + upper), np.maximum(0.5 * (upper - lower), 1e-9)
        relative[own] = np.abs(errors[own] - centre[bins[own]]) / half[bins[own]]
    return max(1.0, float(np.quantile(relative, probability)))


def _intervals(errors: Array, bins: NDArray[np.int64], probability: float) -> tuple[Array, Array]:
    sides = ((1.0 - probability) / 2.0, (1.0 + probability) / 2.0)
    every = np.quantile(errors, sides)
    order = np.argsort(bins, kind="stable")
    ends = np.searchsorted(bins[order], np.arange(BINS + 1))
    lower, upper = np.empty(BINS), np.empty(BINS)
    for one in range(BINS):
        inside = errors[order[ends[one] : ends[one + 1]]]
        lower[one], upper[one] = np.quantile(inside, sides) if len(inside) >= FEWEST_ROWS else every
    return lower, upper


def _bins(regime: NDArray[np.int64], estimate_n: Array, edges_n: Array) -> NDArray[np.int64]:
    return regime * SIZES + np.digitize(np.abs(estimate_n), edges_n)

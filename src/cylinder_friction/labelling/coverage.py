"""At which positions strokes of both directions were seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.labelling.strokes import StrokePoints

    Array = NDArray[np.float64]

BINS = 100
LEAST_SHARE = 0.1
"""Strokes of both directions must share this much of the travel that either of them covers."""


@dataclass(frozen=True)
class Coverage:
    """Stretches of travel that strokes of both directions went through.

    Attributes:
        stretches_m: Pairs of first and last position, ascending, apart from each other [m].
    """

    stretches_m: tuple[tuple[float, float], ...]

    @property
    def range_m(self) -> tuple[float, float]:
        """First and last position of all stretches [m]."""
        return self.stretches_m[0][0], self.stretches_m[-1][1]

    @property
    def length_m(self) -> float:
        """Length of all stretches together [m]."""
        return sum(last - first for first, last in self.stretches_m)

    def holds(self, position_m: Array) -> NDArray[np.bool_]:
        """Return whether each position lies in one of the stretches, of the positions' shape."""
        inside = np.zeros(np.shape(position_m), dtype=np.bool_)
        for first, last in self.stretches_m:
            inside |= (position_m >= first) & (position_m <= last)
        return inside


def coverage_of(points: StrokePoints) -> Coverage:
    """Return where strokes of both directions went.

    Raises:
        RecordingError: There is no stroke in one of the directions, or they have next to no travel in common.
    """
    ways = {name: points.where(points.velocity_m_s * sign > 0.0) for name, sign in (("extend", 1.0), ("retract", -1.0))}
    for name, own in ways.items():
        if not len(own):
            raise RecordingError(
                f"the load cannot be told from friction: got no stroke that {name}s; expected strokes of both "
                "directions over the same travel; record slow strokes up and down, or measure the load"
            )
    low = float(min(points.first_m.min(), points.last_m.min()))
    high = float(max(points.first_m.max(), points.last_m.max()))
    edges = np.linspace(low, high, BINS + 1)
    both = _visited(ways["extend"], low, high) & _visited(ways["retract"], low, high)
    if both.sum() < LEAST_SHARE * BINS:
        spans = {name: (_least(own), _greatest(own)) for name, own in ways.items()}
        raise RecordingError(
            "the load cannot be told from friction: strokes that extend cover "
            f"{spans['extend'][0]:.4g} to {spans['extend'][1]:.4g} m and strokes that retract "
            f"{spans['retract'][0]:.4g} to {spans['retract'][1]:.4g} m, with {both.sum()} % of the travel in common; "
            f"expected at least {100 * LEAST_SHARE:.0f} %; record slow strokes up and down over the same travel, or "
            "measure the load"
        )
    change = np.diff(np.concatenate([[0], both.astype(np.int64), [0]]))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return Coverage(tuple((float(edges[a]), float(edges[b])) for a, b in zip(begins, ends, strict=True)))


def _least(points: StrokePoints) -> float:
    return float(min(points.first_m.min(), points.last_m.min()))


def _greatest(points: StrokePoints) -> float:
    return float(max(points.first_m.max(), points.last_m.max()))


def _visited(points: StrokePoints, low: float, high: float) -> NDArray[np.bool_]:
    """Return which bins between ``low`` and ``high`` some piece touches, shape ``(BINS,)``."""
    scale = BINS / (high - low) if high > low else 0.0
    ends = np.stack([points.first_m, points.last_m])
    first = np.clip(((ends.min(axis=0) - low) * scale).astype(np.int64), 0, BINS - 1)
    last = np.clip(((ends.max(axis=0) - low) * scale).astype(np.int64), 0, BINS - 1)
    change = np.zeros(BINS + 1, dtype=np.int64)
    np.add.at(change, first, 1)
    np.add.at(change, last + 1, -1)
    return np.asarray(np.cumsum(change[:BINS]) > 0)

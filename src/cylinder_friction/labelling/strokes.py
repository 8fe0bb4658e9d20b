"""Strokes: where the cylinder moves one way, long enough that its friction has settled."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cylinder_friction.signals.motion import direction_of_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Counts = NDArray[np.int64]

POINT_DURATION_S = 0.1
"""A point is the mean of this much of a stroke."""


@dataclass(frozen=True)
class StrokePoints:
    """Means over short pieces of strokes, all of shape ``(points,)``.

    Attributes:
        force_n: What drives the piston, in ``identify_load`` less inertia: load and friction together [N].
        position_m: [m].
        velocity_m_s: [m/s], never zero.
        acceleration_m_s2: [m/s²].
        first_m, last_m: Position where the piece begins and ends [m].
        stroke: Which stroke the piece belongs to, counted from 0.
    """

    force_n: Array
    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array
    first_m: Array
    last_m: Array
    stroke: Counts

    def __len__(self) -> int:
        return len(self.force_n)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the points of several recordings; strokes are counted on from one to the next."""
        columns: dict[str, Any] = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)
        }
        counts = [int(part.stroke.max(initial=-1)) + 1 for part in parts]
        columns["stroke"] += np.repeat(np.cumsum([0, *counts[:-1]]), [len(part) for part in parts])
        return cls(**columns)

    def where(self, mask: NDArray[np.bool_]) -> StrokePoints:
        """Return the points of a mask; strokes keep their numbers."""
        return StrokePoints(*(values[mask] for values in vars(self).values()))


def stroke_points(
    force_n: Array,
    position_m: Array,
    velocity_m_s: Array,
    acceleration_m_s2: Array,
    usable: NDArray[np.bool_],
    sample_time_s: float,
    slowest_m_s: float,
    settling_travel_m: float,
) -> StrokePoints:
    """Return the strokes of one recording as points.

    A stroke is an unbroken run of usable rows that move one way at ``slowest_m_s`` or faster; its first
    ``settling_travel_m``, in which bristles bend and the rig takes up its play, is left out.

    Args:
        force_n: Drive force [N], shape ``(n,)``.
        position_m: [m], shape ``(n,)``.
        velocity_m_s, acceleration_m_s2: Smooth, shape ``(n,)``.
        usable: Rows whose force means something, shape ``(n,)``.
        sample_time_s: Time between two rows [s].
        slowest_m_s: Slower rows belong to no stroke [m/s].
        settling_travel_m: Travel after a start or reversal that does not count [m].
    """
    way = np.where(usable, direction_of_motion(velocity_m_s, slowest_m_s), 0.0)
    run = np.concatenate([[0], np.cumsum(way[1:] != way[:-1])]) if len(way) else np.zeros(0, dtype=np.int64)
    path = np.cumsum(np.abs(velocity_m_s)) * sample_time_s
    starts = np.flatnonzero(np.diff(run, prepend=-1))
    travel = path - path[starts][run] if len(way) else path
    rows = np.flatnonzero((way != 0.0) & (travel >= settling_travel_m))
    if len(rows) == 0:
        nothing = np.zeros(0)
        return StrokePoints(nothing, nothing, nothing, nothing, nothing, nothing, np.zeros(0, dtype=np.int64))
    first_of_run = np.searchsorted(run[rows], run[rows], side="left")
    piece = (np.arange(len(rows)) - first_of_run) // max(1, round(POINT_DURATION_S / sample_time_s))
    begins = np.flatnonzero((np.diff(run[rows], prepend=-1) != 0) | (np.diff(piece, prepend=-1) != 0))
    counts = np.diff(np.append(begins, len(rows)))

    def mean(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values[rows], begins) / counts)

    return StrokePoints(
        force_n=mean(force_n),
        position_m=mean(position_m),
        velocity_m_s=mean(velocity_m_s),
        acceleration_m_s2=mean(acceleration_m_s2),
        first_m=position_m[rows[begins]],
        last_m=position_m[rows[begins + counts - 1]],
        stroke=np.unique(run[rows][begins], return_inverse=True)[1].astype(np.int64),
    )

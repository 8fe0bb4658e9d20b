"""Detection of motion in whole recordings: direction, strokes, travel, steady sliding, standstill, starts, stops."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask, sliding_extremes, true_runs

MOVING_M_S = 1e-3
"""A noise-free velocity below this counts as standstill."""
EVENTS = ("start", "stop", "reversal")

STEADY_DURATION_S = 0.2
"""Sliding is steady if velocity varies little for this long around a row."""

STANDSTILL_DURATION_S = 0.5
"""Shortest rest [s]; a shorter one cannot be told from noise."""
CREEP_M_S = 2e-4
"""A mean velocity below this over that time counts as standstill."""
LEAST_STANDSTILL_S = 1.0
"""Least total standstill from which noise is determined [s]."""


def direction_of_motion(velocity_m_s: Array, slowest_m_s: float) -> Array:
    """Return 1 while extending, -1 while retracting and 0 below ``slowest_m_s``, shape ``(n,)``."""
    return np.where(np.abs(velocity_m_s) >= slowest_m_s, np.sign(velocity_m_s), 0.0)


@dataclass(frozen=True)
class StrokePieces:
    """Short pieces of strokes, and the rows of a recording that belong to each."""

    rows: NDArray[np.int64]  # Rows of all pieces, ascending
    # First place of each piece in ``rows``, its number of rows, and its stroke, counted from 0; shape ``(pieces,)``
    begins: NDArray[np.int64]
    counts: NDArray[np.int64]
    stroke: NDArray[np.int64]

    def mean(self, values: Array) -> Array:
        """Average values of shape ``(n,)`` over each piece, shape ``(pieces,)``."""
        if not len(self.rows):
            return np.zeros(0)
        return np.asarray(np.add.reduceat(values[self.rows], self.begins) / self.counts)


def stroke_pieces(direction: Array, progress: Array, settling: float, piece_rows: int) -> StrokePieces:
    """Cut each unbroken run of one direction into pieces of at most ``piece_rows`` rows.

    ``direction`` is 1, -1, or 0 in rows that do not count. ``progress`` is time or path; rows within ``settling`` of
    their run's first row are left out. Both have shape ``(n,)``.
    """
    starts = np.flatnonzero(np.concatenate([[len(direction) > 0], direction[1:] != direction[:-1]]))
    lengths = np.diff(starts, append=len(direction))
    rows = np.flatnonzero((direction != 0.0) & (progress - np.repeat(progress[starts], lengths) >= settling))
    firsts = np.unique(np.searchsorted(rows, starts))  # first place in ``rows`` of each run that has rows left
    firsts = firsts[firsts < len(rows)]
    pieces = -(-np.diff(firsts, append=len(rows)) // piece_rows)
    stroke = np.repeat(np.arange(len(firsts)), pieces)
    begins = firsts[stroke] + piece_rows * (np.arange(len(stroke)) - (np.cumsum(pieces) - pieces)[stroke])
    return StrokePieces(rows, begins, np.diff(np.append(begins, len(rows))), stroke)


def last_direction(velocity_m_s: Array) -> Array:
    """Find the direction of motion, +1 or -1, shape ``(n,)``; at standstill the last one, +1 before any motion."""
    signs = np.sign(velocity_m_s)
    latest = np.maximum.accumulate(np.where(signs != 0.0, np.arange(len(signs)), -1))
    return np.where(latest >= 0, signs[np.maximum(latest, 0)], 1.0)


def travel_since_stop(velocity_m_s: Array, slowest_m_s: float, sample_time_s: float) -> Array:
    """Measure the travel since the last slow row or reversal [m], shape ``(n,)``."""
    speed_m_s, total_m_s = np.abs(velocity_m_s), np.zeros(len(velocity_m_s))
    onwards = (speed_m_s > slowest_m_s) & (velocity_m_s * np.roll(velocity_m_s, 1) > 0.0)
    onwards[:1] = False
    for first, end in true_runs(onwards):
        total_m_s[first:end] = np.cumsum(speed_m_s[first:end])
    return total_m_s * sample_time_s


def steady_rows(velocity_m_s: Array, sample_time_s: float, slowest_m_s: float, variation: float) -> Mask:
    """Mark the rows inside a stroke at constant velocity, shape ``(n,)``.

    ``variation`` is the greatest change of velocity within ``STEADY_DURATION_S``, over its mean.
    """
    least, greatest = sliding_extremes(velocity_m_s, max(3, round(STEADY_DURATION_S / sample_time_s) | 1))
    one_way = (least > slowest_m_s) | (greatest < -slowest_m_s)
    return np.asarray(one_way & (greatest - least <= variation * np.abs(0.5 * (greatest + least))))


def standstill_rows(position_m: Array, sample_time_s: float, around_rows: int = 0) -> Mask:
    """Mark the rows at rest, shape ``(n,)``, from the raw position.

    A row is at rest if the mean positions over half of ``STANDSTILL_DURATION_S`` before and after it differ by less
    than motion at ``CREEP_M_S`` would cause. This must hold for that time and for ``around_rows`` on either side: give
    a filter's support there, so that no row at rest has motion in its filter.
    """
    half = max(2, round(0.5 * STANDSTILL_DURATION_S / sample_time_s))
    if len(position_m) < 4 * half:
        return np.zeros(len(position_m), dtype=np.bool_)
    means = np.convolve(position_m - position_m[0], np.full(half, 1.0 / half), mode="valid")
    slow = np.abs(means[half:] - means[:-half]) <= CREEP_M_S * half * sample_time_s
    moving = np.ones(len(position_m), dtype=np.bool_)
    moving[half : half + len(slow)] = ~slow
    width = min(2 * (half + around_rows) + 1, 2 * len(moving) - 1)
    return sliding_extremes(moving.astype(np.float64), width)[1] == 0.0


def noise_rms(values: Array, rest: Mask) -> float:
    """Compute the root mean square of values about their mean in each rest; NaN without any rest."""
    if not rest.any():
        return float("nan")
    rows = np.flatnonzero(rest)
    stretch = np.cumsum(np.diff(rows, prepend=rows[0]) > 1)
    means = np.bincount(stretch, values[rows]) / np.bincount(stretch)
    return float(np.sqrt(np.mean((values[rows] - means[stretch]) ** 2)))


def near_events(velocity_m_s: Array, window: int) -> Mask:
    """Mark the rows within ``window`` rows of a start, stop or reversal, shape ``(n,)``; see ``event_masks``."""
    return np.asarray(np.logical_or.reduce(list(event_masks(velocity_m_s, window).values())))


def event_masks(velocity_m_s: Array, window: int) -> dict[str, Mask]:
    """Mark the rows within ``window`` rows of each kind of event; each mask has shape ``(n,)``.

    A reversal goes from one direction to the other with at most ``window`` rows of rest between; a longer rest makes it
    a stop and a start. The velocity has no noise, shape ``(n,)``.
    """
    direction = direction_of_motion(velocity_m_s, MOVING_M_S).astype(np.int64)
    changes = np.flatnonzero(np.diff(direction)) + 1
    marks = {kind: np.zeros(len(direction), dtype=np.bool_) for kind in EVENTS}
    for index, row in enumerate(changes):
        before, now = direction[row - 1], direction[row]
        if now == 0:
            following = changes[index + 1] if index + 1 < len(changes) else None
            turns = following is not None and following - row <= window and direction[following] == -before
            marks["reversal" if turns else "stop"][row] = True
        elif before == 0:
            previous = changes[index - 1] if index > 0 else None
            turned = previous is not None and row - previous <= window and direction[previous - 1] == -now
            marks["reversal" if turned else "start"][row] = True
        else:
            marks["reversal"][row] = True
    return {kind: widened(mark, window, window) for kind, mark in marks.items()}


def widened(mask: Mask, before: int, after: int) -> Mask:
    """Widen a mask: true also ``before`` rows ahead of and ``after`` rows behind every true row."""
    rows = len(mask)
    first, end = true_runs(mask).T
    change = np.zeros(rows + 1, dtype=np.int32)
    np.add.at(change, np.maximum(first - before, 0), 1)
    np.add.at(change, np.minimum(end + after, rows), -1)
    return np.asarray(np.cumsum(change[:rows], dtype=np.int32) > 0)

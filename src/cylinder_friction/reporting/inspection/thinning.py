"""Fewer points than samples, without losing what the eye would see."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def extremes(values: Array, points: int) -> NDArray[np.intp]:
    """Return the rows of the least and the greatest value of every stretch, in order, at most ``points`` of them.

    A line through them looks like the line through all rows: no peak is lost. Not finite values are never chosen
    unless a stretch holds nothing else.

    Args:
        values: Shape ``(n,)``.
        points: How many rows to keep, at least 2.
    """
    if len(values) <= points:
        return np.arange(len(values))
    stretch = -(-len(values) // (points // 2))
    whole = np.full(-(-len(values) // stretch) * stretch, np.nan)
    whole[: len(values)] = values
    table = whole.reshape(-1, stretch)
    known = np.isfinite(table)
    least = np.argmin(np.where(known, table, np.inf), axis=1)
    greatest = np.argmax(np.where(known, table, -np.inf), axis=1)
    starts = stretch * np.arange(len(table))
    return np.unique(np.concatenate([starts + least, starts + greatest]))


def spread_evenly(rows: NDArray[np.intp], points: int) -> NDArray[np.intp]:
    """Return at most ``points`` of ``rows``, evenly spaced: for clouds of points, where no row is special."""
    if len(rows) <= points:
        return rows
    return rows[np.linspace(0, len(rows) - 1, points).round().astype(np.intp)]

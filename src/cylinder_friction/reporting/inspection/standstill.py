"""Where the piston stands still, and what the sensors' noise is there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

STANDSTILL_DURATION_S = 0.5
"""A shorter rest is too short to tell noise from motion."""

CREEP_M_S = 2e-4
"""Slower than this over that time counts as standstill."""

LEAST_STANDSTILL_S = 1.0
"""Less standstill than this in all says nothing about noise."""


def standstill_rows(position_m: Array, sample_time_s: float, around_rows: int = 0) -> Mask:
    """Return the mask of rows at rest, shape ``(n,)``.

    At rest are rows around which mean position, over half of ``STANDSTILL_DURATION_S`` before and after, differs by
    less than ``CREEP_M_S`` would make it, for as long as that and ``around_rows`` to either side.

    Args:
        position_m: Raw position [m], shape ``(n,)``.
        sample_time_s: [s].
        around_rows: How far a filter looks: rows whose filter saw motion are not at rest for it.
    """
    half = max(2, round(0.5 * STANDSTILL_DURATION_S / sample_time_s))
    if len(position_m) < 4 * half:
        return np.zeros(len(position_m), dtype=np.bool_)
    means = np.convolve(position_m - position_m[0], np.full(half, 1.0 / half), mode="valid")
    slow = np.abs(means[half:] - means[:-half]) <= CREEP_M_S * half * sample_time_s
    moving = np.ones(len(position_m), dtype=np.bool_)
    moving[half : half + len(slow)] = ~slow
    reach = 2 * (half + around_rows) + 1
    near_motion = uniform_filter1d(moving.astype(np.float64), min(reach, 2 * len(moving) - 1), mode="nearest") > 1e-9
    return np.asarray(~near_motion)


def noise_rms(values: Array, rest: Mask) -> float:
    """Return the root mean square of values about their own mean in each rest, NaN where nothing rests.

    Args:
        values: Shape ``(n,)``.
        rest: Rows at rest, shape ``(n,)``.
    """
    if not rest.any():
        return float("nan")
    rows = np.flatnonzero(rest)
    stretch = np.cumsum(np.diff(rows, prepend=rows[0]) > 1)
    counts = np.bincount(stretch)
    means = np.bincount(stretch, values[rows]) / counts
    return float(np.sqrt(np.mean((values[rows] - means[stretch]) ** 2)))

"""From one sampling to another: shape-preserving cubic for uneven stamps, windowed sinc between even rates."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

CUT_OFF = 0.45
"""Where the windowed sinc lets half of the amplitude through, as a share of the lower of the two rates."""

STOP_BAND_DB = 70.0
"""Attenuation the window is made for; the table between two entries and short sums leave more than 60 dB of it."""

HALF_WIDTH = 22.0
"""Reach of the kernel to either side, in samples of the lower rate: from full to no passage takes 0.1 of that rate."""

ENTRIES = 512
"""Entries of the kernel's table a sample of the lower rate; linear in between is good to 1e-6."""

OVERSHOOT = 2.2
"""No resampled value is further from the middle of its inputs than this many times half their range (at a step, 1.26
times: 13 % of its height); within ``HALF_WIDTH`` of an end, where the continuation may triple the range, three times
as far."""


def shape_preserving_cubic(at: Array, values: Array, wanted: Array) -> Array:
    """Return values between samples, shape ``(m,)``, never beyond the two samples they lie between.

    Args:
        at: Where the samples lie, increasing, shape ``(n,)``, ``n`` at least 1.
        values: Shape ``(n,)``.
        wanted: Where values are wanted, shape ``(m,)``; beyond the first or last sample, that sample.

    Source: Fritsch and Carlson 1980, Monotone piecewise cubic interpolation; slopes after Fritsch and Butland 1984.
    """
    if len(at) == 1:
        return np.full(len(wanted), values[0])
    inside = np.clip(wanted, at[0], at[-1])
    # Counted from the first sample in steps of one: the divided differences of small steps at large times lose digits.
    step = (at[-1] - at[0]) / (len(at) - 1)
    from scipy.interpolate import PchipInterpolator  # half a second that most files do not need

    result: Array = PchipInterpolator((at - at[0]) / step, values)((inside - at[0]) / step)
    return result


def fill_lost(numbers: NDArray[np.int64], values: Array) -> Array:
    """Return one value a sample number, first to last; lost ones interpolated (shape-preserving cubic).

    Args:
        numbers: Sample numbers that are there, increasing, shape ``(n,)``.
        values: Their values, shape ``(n,)``; they come out as they are.
    """
    if numbers[-1] - numbers[0] + 1 == len(numbers):
        return values
    filled = np.empty(int(numbers[-1] - numbers[0]) + 1)
    there = np.zeros(len(filled), dtype=np.bool_)
    there[numbers - numbers[0]] = True
    filled[there] = values
    lost = np.flatnonzero(~there) + numbers[0]
    # The cubic looks at two samples to either side; the many others need not be gone through.
    beside = np.searchsorted(numbers, lost)[:, None] + np.arange(-3, 3)
    used = np.unique(np.clip(beside, 0, len(numbers) - 1))
    filled[~there] = shape_preserving_cubic(numbers[used].astype(np.float64), values[used], lost.astype(np.float64))
    return filled


def windowed_sinc(values: Array, positions: Array, rate_ratio: float) -> Array:
    """Return even samples taken at other instants, with anti-aliasing, shape ``(m,)``.

    A Kaiser-windowed sinc, evaluated at each instant, is anti-aliasing filter and interpolation in one. Its cut-off is
    0.45 times the lower of the two rates: it passes up to 0.4 and stops, by 60 dB, from 0.5 on. Its weights are
    divided by their sum, so that a constant stays what it is. Beyond the ends, the samples are continued by odd
    extension (the mirror image through the end point), so that a straight line goes on straight.

    Args:
        values: At a constant rate, shape ``(n,)``, ``n`` at least 1.
        positions: Wanted instants as sample numbers, fractions allowed, shape ``(m,)``, within 0 to ``n - 1``.
        rate_ratio: Wanted rate over the rate of ``values``.

    Source: Smith 1984, Digital audio resampling; Oppenheim and Schafer, Discrete-time signal processing, section 7.5
    (Kaiser window).
    """
    if not rate_ratio > 0.0:
        raise ValueError(f"expected rate_ratio to be positive, but got {rate_ratio!r}")
    return _sinc(np.ascontiguousarray(values), positions, min(1.0, rate_ratio), _kernel(), HALF_WIDTH)


@lru_cache(maxsize=1)
def _kernel() -> Array:
    """Return the right half of the kernel, ``ENTRIES`` values a sample of the lower rate, and a zero at its end."""
    distance = np.arange(int(HALF_WIDTH * ENTRIES) + 2) / ENTRIES
    from scipy.signal import kaiser_beta

    window = np.i0(kaiser_beta(STOP_BAND_DB) * np.sqrt(np.clip(1.0 - (distance / HALF_WIDTH) ** 2, 0.0, None)))
    kernel: Array = np.sinc(2.0 * CUT_OFF * distance) * window
    kernel[distance >= HALF_WIDTH] = 0.0
    kernel.setflags(write=False)
    return kernel


@numba.njit(cache=True)
def _sinc(values: Array, positions: Array, lower: float, kernel: Array, half_width: float) -> Array:
    """``lower`` is the lower rate over the rate of ``values``: one sample of these is that much of the kernel."""
    last = len(values) - 1
    reach = half_width / lower
    entries = (len(kernel) - 2) / half_width
    result = np.empty(len(positions))
    for row in range(len(positions)):
        position = positions[row]
        # Summed as what differs from the nearest sample: a constant then comes out to the last bit.
        nearest = values[min(max(round(position), 0), last)]
        total, weights = 0.0, 0.0
        for sample in range(int(np.ceil(position - reach)), int(np.floor(position + reach)) + 1):
            place = abs(sample - position) * lower * entries
            entry = int(place)
            weight = kernel[entry] + (place - entry) * (kernel[entry + 1] - kernel[entry])
            if sample < 0:
                value = 2.0 * values[0] - values[min(-sample, last)]
            elif sample > last:
                value = 2.0 * values[last] - values[max(2 * last - sample, 0)]
            else:
                value = values[sample]
            total += weight * (value - nearest)
            weights += weight
        result[row] = nearest + total / weights
    return result

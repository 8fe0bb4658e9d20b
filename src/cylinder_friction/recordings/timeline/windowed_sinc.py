"""Resample uniform samples at other instants with a windowed sinc."""

from functools import lru_cache

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled

CUT_OFF = 0.45  # Frequency at which half of the amplitude passes, as a share of the lower of the two rates
STOP_BAND_DB = 70.0
"""Design attenuation of the window [dB]. Interpolation in the table and short sums reduce it to a little over 60 dB."""
HALF_WIDTH = 22.0  # Half-width of the kernel in samples of the lower rate: a transition band of 0.1 of it
ENTRIES = 512  # Entries of the kernel's table per sample of the lower rate; the error of interpolation is below 1e-6


def windowed_sinc(values: Array, positions: Array, rate_ratio: float) -> Array:
    """Resample uniform samples at other instants, with anti-aliasing, shape ``(m,)``.

    A Kaiser-windowed sinc, evaluated at each instant, filters against aliasing and interpolates in one step. Its
    cut-off is 0.45 times the lower of the two rates: it passes frequencies up to 0.4 and attenuates those above 0.5 by
    60 dB. Its weights are divided by their sum, so that a constant stays constant. Beyond the ends, samples are
    continued by odd extension (the mirror image through the end point), so that a straight line stays straight.

    ``positions`` are sample numbers from 0 to ``n - 1``, fractions allowed; ``rate_ratio`` is the ratio of the wanted
    rate to that of ``values``.

    Source: Smith 1984, Digital audio resampling; Oppenheim and Schafer, Discrete-time signal processing, section 7.5.
    """
    return _sinc(np.ascontiguousarray(values), positions, min(1.0, rate_ratio), _kernel(), HALF_WIDTH)


@lru_cache(maxsize=1)
def _kernel() -> Array:
    """Compute the right half of the kernel, ``ENTRIES`` values per sample of the lower rate, and a zero at its end."""
    distance = np.arange(int(HALF_WIDTH * ENTRIES) + 2) / ENTRIES
    from scipy.signal import kaiser_beta  # takes a quarter of a second

    window = np.i0(kaiser_beta(STOP_BAND_DB) * np.sqrt(np.clip(1.0 - (distance / HALF_WIDTH) ** 2, 0.0, None)))
    kernel: Array = np.sinc(2.0 * CUT_OFF * distance) * window
    kernel[distance >= HALF_WIDTH] = 0.0
    kernel.setflags(write=False)
    return kernel


@compiled
def _sinc(values: Array, positions: Array, lower: float, kernel: Array, half_width: float) -> Array:
    """Evaluate the sinc; ``lower`` is the ratio of the lower rate to the rate of ``values``."""
    last = len(values) - 1
    support = half_width / lower
    entries = (len(kernel) - 2) / half_width
    result = np.empty(len(positions))
    for row in range(len(positions)):
        position = positions[row]
        # Differences from the nearest sample are summed, so that a constant is reproduced to the last bit.
        nearest = values[min(max(round(position), 0), last)]
        total, weights = 0.0, 0.0
        for sample in range(int(np.ceil(position - support)), int(np.floor(position + support)) + 1):
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

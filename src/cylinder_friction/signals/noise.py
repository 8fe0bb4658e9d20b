"""How noisy a signal is, from the signal alone."""

from collections.abc import Iterable

import numpy as np

from cylinder_friction.arrays import Array

BLOCK = 4
"""Samples of a mean: as many as a logger's filter may spread its noise over."""
MEDIAN_OF_NORMAL, VARIANCE_WITHIN_3 = 0.6745, 0.9733
"""Of a standard normal distribution: the median of the magnitude, and the variance within three deviations."""
OTHER_NOISE = 1.5
"""Ratio beyond which noise is another one; recordings of one rig are up to 1.48 times as noisy as their median."""


def noise_deviation(values: Array) -> float:
    """Return the standard deviation of white noise on a signal.

    It is that of second differences, of samples and of means over ``BLOCK`` of them, whichever is larger: noise that a
    logger has filtered shows in the means. Differences beyond three standard deviations, which steps make, are left
    out.
    """
    blocks = values[: len(values) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1)
    return max(_second_difference_noise(values), BLOCK**0.5 * _second_difference_noise(blocks))


def sensor_noise(values: Array) -> float:
    """Return the standard deviation of a sensor's white noise, no less than that of its converter's rounding."""
    return max(noise_deviation(values), quantisation_step(values) / 12.0**0.5)


def median_noise(signals: Iterable[Array]) -> float:
    """Return the median of signals' ``sensor_noise``; 0 without any."""
    known = [sensor_noise(each) for each in signals]
    return float(np.median(known)) if known else 0.0


def times_as_noisy(noise: float, known: float) -> float:
    """Return how many times as large as known noise a noise is; 1 up to ``OTHER_NOISE`` times, or if none is known."""
    return noise / known if 0.0 < OTHER_NOISE * known < noise else 1.0


def quantisation_step(values: Array) -> float:
    """Return the smallest step between two different values: the converter's least significant bit, or 0."""
    steps = np.diff(np.sort(values))
    least = float(steps.min(where=steps > 0.0, initial=np.inf))
    return least if np.isfinite(least) else 0.0


def _second_difference_noise(values: Array) -> float:
    steps = values[1:] - values[:-1]
    sizes = np.abs(steps[1:] - steps[:-1]) / 6.0**0.5
    if not len(sizes):
        return 0.0
    inner = 3.0 * float(np.median(sizes)) / MEDIAN_OF_NORMAL
    return float(np.sqrt(np.mean(np.square(sizes[sizes <= inner])) / VARIANCE_WITHIN_3))

"""The noise of a signal, estimated from the signal alone."""

from collections.abc import Iterable

import numpy as np

from cylinder_friction.arrays import Array

BLOCK = 4
"""Samples of a mean: the most over which a logger's filter spreads noise."""
MEDIAN_OF_NORMAL, VARIANCE_WITHIN_3 = 0.6745, 0.9733
"""Median magnitude of a standard normal distribution, and its variance within three deviations."""
OTHER_NOISE = 1.5
"""Ratio above which noise counts as different; recordings of one rig are up to 1.48 times as noisy as their median."""


def noise_deviation(values: Array) -> float:
    """Estimate the standard deviation of white noise on a signal.

    It comes from second differences of the samples and of means over ``BLOCK`` samples, whichever is larger: noise that
    a logger has filtered shows in the means. Differences beyond three standard deviations come from steps and are left
    out.
    """
    blocks = values[: len(values) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1)
    return max(_second_difference_noise(values), BLOCK**0.5 * _second_difference_noise(blocks))


def sensor_noise(values: Array) -> float:
    """Estimate the standard deviation of a sensor's white noise, at least that of its converter's rounding."""
    return max(noise_deviation(values), quantisation_step(values) / 12.0**0.5)


def median_noise(signals: Iterable[Array]) -> float:
    """Compute the median of signals' ``sensor_noise``; 0 without any."""
    known = [sensor_noise(each) for each in signals]
    return float(np.median(known)) if known else 0.0


def times_as_noisy(noise: float, known: float) -> float:
    """Compare a noise with the known one: their ratio, or 1 if it is below ``OTHER_NOISE`` or nothing is known."""
    return noise / known if 0.0 < OTHER_NOISE * known < noise else 1.0


def quantisation_step(values: Array) -> float:
    """Find the smallest step between two different values: the converter's least significant bit, or 0."""
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

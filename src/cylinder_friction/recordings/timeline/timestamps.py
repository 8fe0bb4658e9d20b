"""Analyse a logger's time stamps: printed resolution, evenness, and the rules for repairing them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.recording import expect

Indices = NDArray[np.int64]

BLOCK = 1024  # Number of samples over which a clock must follow a straight line; slower drift is allowed
RATE_DRIFT = 1e-3  # Largest deviation of a block's rate from the overall one, as a share, by which velocity is wrong
WHOLE_HERTZ = 1e-4
"""Largest deviation from a whole number of hertz that is rounded, as a share; clocks are off by parts per million."""
LATEST_S = 1e11  # Largest credible stamp, about 3000 years [s]; larger ones are ticks, or dates as one number
USUAL_STEP_SHARE = 0.9  # Least share of equal steps of exact stamps; longer steps are then lost samples
JITTER_SHARE = 0.02  # Largest deviation of even stamps from an even clock, as a share of a step


@dataclass(frozen=True)
class TimeRules:
    """Rules for converting raw time stamps to one constant rate."""

    # Rate of the recording [Hz]; None takes the rate of the slowest channel except oil temperature
    rate_hz: float | None = None
    longest_bridge_samples: int = 2  # Most lost samples in a row that are interpolated; more split the recording

    def __post_init__(self) -> None:
        rate_is_valid = self.rate_hz is None or 0.0 < self.rate_hz < math.inf
        expect(rate_is_valid, "rate_hz", "a positive number or None", self.rate_hz)
        expect(self.longest_bridge_samples >= 0, "longest_bridge_samples", "0 or more", self.longest_bridge_samples)


def whole_hertz(rate_hz: float, uncertainty: float = 0.0) -> float:
    """Round a rate within 1e-4 of a whole number of hertz, or within its ``uncertainty`` (a share, at most 1e-3)."""
    whole = float(round(rate_hz))
    return whole if abs(rate_hz - whole) <= max(WHOLE_HERTZ, min(uncertainty, 1e-3)) * rate_hz else rate_hz


def even_rate(time_s: Array) -> float | None:
    """Return the mean rate [Hz] of evenly spaced stamps, one per sample; None if they are uneven.

    Stamps are even if in every 1024 samples they deviate from a straight line by at most 2 % of a step or by what their
    printed resolution explains, and the rate is constant within 1e-3. Stamps with a lost sample are not even.
    """
    if len(time_s) < 3 or not (abs(time_s[0]) < LATEST_S and abs(time_s[-1]) < LATEST_S):
        return None
    step_s = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if step_s <= 0.0:
        return None
    numbers = np.arange(len(time_s))
    if follows_even_clock(time_s, numbers, step_s, JITTER_SHARE * step_s):
        return 1.0 / step_s
    resolution_s = explaining_resolution(time_s, step_s)
    if resolution_s > JITTER_SHARE * step_s and follows_even_clock(time_s, numbers, step_s, 1.05 * resolution_s):
        return whole_hertz(1.0 / step_s, resolution_s / (time_s[-1] - time_s[0]))
    return None


def explaining_resolution(time_s: Array, step_s: float) -> float:
    """Return the printed resolution if it may explain uneven steps, else 0 [s].

    It may if it is well below a step (300 Hz printed in milliseconds: 3, 3, 4 ms), or if it is at most one step and no
    step is usual (600 Hz in milliseconds: 1, 2, 2 ms). A step of 20 ms among steps of 10 ms is a lost sample.
    """
    if not np.isfinite(time_s).all():
        return 0.0
    resolution_s = printed_resolution(time_s)
    if resolution_s <= 0.4001 * step_s:
        return resolution_s
    if resolution_s > step_s:
        return 0.0
    multiples = np.rint(np.diff(time_s) / resolution_s).astype(np.int64)
    _, counts = np.unique(multiples, return_counts=True)
    return resolution_s if counts.max() < USUAL_STEP_SHARE * len(multiples) else 0.0


def printed_resolution(time_s: Array) -> float:
    """Find the power of ten, 1 s to 1 µs, of which all finite stamps are multiples [s]; 0 if they are finer."""
    rounding = 4.0 * np.finfo(np.float64).eps * float(max(time_s.max(), -time_s.min()))
    for digits in range(7):
        tolerance = 1e-4 + rounding * 10.0**digits
        if tolerance > 0.1:  # the number is too large for that many digits
            break
        numbers = (time_s - time_s[0]) * 10.0**digits
        if (np.abs(numbers - np.rint(numbers)) <= tolerance).all():
            return float(10.0**-digits)
    return 0.0


def follows_even_clock(time_s: Array, index: Indices, step_s: float, tolerance_s: float) -> bool:
    """Check whether two or more stamps follow sample numbers on lines of 1024 samples, as in ``even_rate``.

    ``step_s`` is the mean time between two numbers. A number that is missing in ``index`` is a lost sample.
    """
    rows = len(time_s)
    # A short remainder joins the last block, so that every block is long enough to determine its rate.
    start = BLOCK * np.arange(max(1, (rows - 1) // BLOCK))
    end = np.append(start[1:], rows - 1)
    samples = index[end] - index[start]
    slope_s = (time_s[end] - time_s[start]) / samples
    # The comparisons also refuse NaN.
    if not (np.abs(slope_s - step_s) <= RATE_DRIFT * step_s + 2.0 * tolerance_s / samples).all():
        return False
    first_s, first, slope_s = (np.repeat(each, end - start) for each in (time_s[start], index[start], slope_s))
    off_s = np.abs(time_s[1:] - first_s - (index[1:] - first) * slope_s)
    return bool(((off_s <= tolerance_s) & (time_s[1:] > time_s[:-1])).all())

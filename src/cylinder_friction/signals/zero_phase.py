"""Zero-phase filters, which look as far ahead as back: for labels, never for estimates."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.signals.causal import cascade_taps
from cylinder_friction.signals.causal_chain import MovingAverage, OneSidedSavitzkyGolay
from cylinder_friction.signals.noise import noise_deviation
from cylinder_friction.signals.smooth_signals import P1, P2, SignalFilter, SmoothSignals, Support, X, window_samples

GROWTH = 1.3
"""Each window is longer than the last by this factor."""
BLOCK = 1 << 16
"""Windows are chosen in blocks of this many samples, which the processor's cache holds."""


@dataclass(frozen=True)
class CentredMovingAverage(SignalFilter):
    """The paper's chain with each of its filters moved back by its own delay.

    A filter with an even number of taps has no middle sample. It is averaged with itself one sample later, so a window
    of 10 samples becomes one of 11 whose outer two count half.
    """

    window: int = 10  # Window of pressures and position [samples]
    acceleration_window: int = 30  # Window of the acceleration [samples]

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        return run_centred(self._taps(sample_time_s)[0], force_n)

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        _, velocity, acceleration = self._taps(sample_time_s)
        return run_centred(velocity, position_m), run_centred(acceleration, position_m)

    def support(self, sample_time_s: float) -> Support:
        half = max(len(taps) // 2 for taps in self._taps(sample_time_s))
        return Support(half, half)

    def _taps(self, sample_time_s: float) -> list[Array]:
        return [centred_taps(taps) for taps in MovingAverage(self.window, self.acceleration_window).taps(sample_time_s)]


@dataclass(frozen=True)
class SavitzkyGolay(SignalFilter):
    """Polynomials fitted around each sample (Savitzky and Golay 1964), from raw signals.

    A window is the odd number of samples that lasts nearest to its seconds, and at least two samples longer than the
    order. At 200 Hz the defaults are 11, 21 and 41 samples.

    Raises:
        ValueError: A window is not positive, or an order is too low to differentiate.
    """

    pressure_window_s: float = 0.05  # Time from the first to the last sample of a window [s]
    pressure_order: int = 2  # Order of the polynomial
    velocity_window_s: float = 0.1
    velocity_order: int = 3
    acceleration_window_s: float = 0.2
    acceleration_order: int = 3

    def __post_init__(self) -> None:
        for signal, derivative in (("pressure", 0), ("velocity", 1), ("acceleration", 2)):
            window_s, order = getattr(self, f"{signal}_window_s"), getattr(self, f"{signal}_order")
            if not (window_s > 0.0 and math.isfinite(window_s) and order >= derivative):
                raise ValueError(
                    f"Savitzky-Golay for {signal}: expected a positive window and an order of at least {derivative}, "
                    f"but got window {window_s} s and order {order}"
                )

    def causal(self) -> OneSidedSavitzkyGolay:
        """Build the causal filter with the same windows and orders."""
        return OneSidedSavitzkyGolay(**vars(self))

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        return _fitted(force_n, self._windows(sample_time_s)[0], self.pressure_order)

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        _, velocity, acceleration = self._windows(sample_time_s)
        return (
            _fitted(position_m, velocity, self.velocity_order, 1, sample_time_s),
            _fitted(position_m, acceleration, self.acceleration_order, 2, sample_time_s),
        )

    def support(self, sample_time_s: float) -> Support:
        half = max(self._windows(sample_time_s)) // 2
        return Support(half, half)

    def _windows(self, sample_time_s: float) -> tuple[int, int, int]:
        """Return the windows of pressure, velocity and acceleration in samples."""
        return (
            window_samples(self.pressure_window_s, self.pressure_order, sample_time_s),
            window_samples(self.velocity_window_s, self.velocity_order, sample_time_s),
            window_samples(self.acceleration_window_s, self.acceleration_order, sample_time_s),
        )


def _fitted(values: Array, window: int, order: int, derivative: int = 0, sample_time_s: float = 1.0) -> Array:
    """Evaluate a derivative of the polynomial around each sample; edge samples use the first or last window.

    ``scipy.signal`` has the same function, but takes longer to import than most logs take to label.

    Raises:
        ValueError: There are fewer values than the window holds.
    """
    if len(values) < window:
        raise ValueError(f"got {len(values)} samples, but Savitzky-Golay needs at least its window of {window}")
    at, half = _derivatives(window, order, derivative), window // 2
    rest, level = values - values[0], 0.0 if derivative else values[0]  # a large constant would cost digits
    inner = np.convolve(rest, at[half, ::-1], mode="valid")
    fitted = [at[:half] @ rest[:window], inner, at[half + 1 :] @ rest[-window:]]
    return level + np.concatenate(fitted) / sample_time_s**derivative


@cache
def _derivatives(window: int, order: int, derivative: int) -> Array:
    """Build the matrix from a window's values to the derivative at each of its samples, shape ``(window, window)``."""
    half = max(window // 2, 1)
    x = (np.arange(window) - window // 2) / half  # in halves of a window, for exactness
    fit = np.linalg.pinv(np.vander(x, order + 1, increasing=True))
    factors = [math.perm(power, derivative) for power in range(derivative, order + 1)]
    powers = np.vander(x, order + 1 - derivative, increasing=True)
    return np.asarray((powers * factors) @ fit[derivative:]) / half**derivative


def centred_taps(taps: Array) -> Array:
    """Make the number of (anti)symmetric taps odd, with the same delay in the middle."""
    return taps if len(taps) % 2 else cascade_taps(taps, np.array([0.5, 0.5]))


def run_centred(taps: Array, values: Array) -> Array:
    """Filter values without delay, shape ``(n,)``; at the edges the signal is continued in point symmetry."""
    half = len(taps) // 2
    if half == 0:
        return taps[0] * values
    if len(values) <= half:
        raise ValueError(f"got {len(values)} samples, but the filter needs more than half its length, {half}")
    before = 2.0 * values[0] - values[half:0:-1]
    after = 2.0 * values[-1] - values[-2 : -half - 2 : -1]
    return np.convolve(np.concatenate([before, values, after]), taps, mode="valid")


@dataclass(frozen=True)
class AdaptiveWindow(SignalFilter):
    """Means over windows chosen per sample by the intersection of confidence intervals.

    For every sample, one mean over the samples before it and one over those after it, each with the longest window
    whose mean agrees with those of all shorter windows within their confidence intervals (Goldenshluger and Nemirovski
    1997; Katkovnik 1999); both are averaged with the inverse of their variances as weights. Windows are long while
    friction is constant, and end before a step. Only the shortest window is always used, so the few samples beside a
    step are smoothed over it. The noise for the intervals is estimated from the recording. Windows of the pressures are
    those of the force P1·A1 - P2·A2, which ignores changes that both pressures share.

    Args:
        piston_area_m2, annulus_area_m2: Areas A1 and A2 that turn pressures into the force.
        shortest_s: Shortest window on one side.
        longest_s: Longest window on one side.
        confidence: Half-width of the intervals in standard deviations; larger ones give longer windows.
        derivatives: Differentiates the position.

    Raises:
        ValueError: A length or the confidence is not positive, or the shortest window is longer than the longest.
    """

    linear: ClassVar[bool] = False

    piston_area_m2: float
    annulus_area_m2: float
    shortest_s: float = 0.015
    longest_s: float = 0.2
    confidence: float = 1.2
    derivatives: SavitzkyGolay = field(default_factory=SavitzkyGolay)

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest_s <= self.longest_s:
            raise ValueError(
                "adaptive window: expected 0 < shortest_s <= longest_s, but got "
                f"shortest_s {self.shortest_s} and longest_s {self.longest_s}"
            )
        if not self.confidence > 0.0:
            raise ValueError(f"adaptive window: expected a positive confidence, but got {self.confidence}")

    def smooth(self, samples: Array, sample_time_s: float) -> SmoothSignals:
        force_n = samples[:, P1] * self.piston_area_m2 - samples[:, P2] * self.annulus_area_m2
        windows = self.windows(force_n, sample_time_s)
        p1, p2 = (windows.mean(np.ascontiguousarray(samples[:, side])) for side in (P1, P2))
        return SmoothSignals(p1, p2, *self.motion(samples[:, X], sample_time_s))

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        return self.windows(force_n, sample_time_s).mean(force_n)

    def deviation(self, force_n: Array, sample_time_s: float) -> Array:
        """Estimate the standard deviation of a smoothed force about the true one [N], shape ``(n,)``.

        It combines, in quadrature, the noise left in the mean and half of the difference between the means of both
        sides. If these differ, the signal changes within the windows, and the smoothing error is about as large.
        """
        windows = self.windows(force_n, sample_time_s)
        before, after = windows.means(force_n)
        return np.hypot(windows.residual_noise(), 0.5 * (after - before))

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        return self.derivatives.motion(position_m, sample_time_s)

    def support(self, sample_time_s: float) -> Support:
        half = max(self._lengths(sample_time_s)[-1], self.derivatives.support(sample_time_s).before)
        return Support(half, half)

    def windows(self, force_n: Array, sample_time_s: float) -> Windows:
        """Find the windows of a force, shape ``(n,)``."""
        return _windows_once(self, np.asarray(force_n, dtype=np.float64).tobytes(), sample_time_s)

    def _chosen(self, force_n: Array, sample_time_s: float) -> Windows:
        lengths = np.array(self._lengths(sample_time_s))
        noise_n = noise_deviation(force_n)
        force_n = np.ascontiguousarray(force_n - force_n[0])
        before = _one_side(force_n[::-1].copy(), lengths, self.confidence * noise_n)[::-1]
        row, after = np.arange(len(force_n)), _one_side(force_n, lengths, self.confidence * noise_n)
        counts = (before + 1).astype(np.float64), (after + 1).astype(np.float64)
        return Windows(row - before, row + 1 + after, *counts, noise_n)

    def _lengths(self, sample_time_s: float) -> list[int]:
        shortest, longest = (max(1, round(each / sample_time_s)) for each in (self.shortest_s, self.longest_s))
        grown = itertools.accumulate(itertools.repeat(GROWTH), lambda length, by: length * by, initial=float(shortest))
        between = {round(length) for length in itertools.takewhile(lambda length: length < longest, grown)}
        return sorted({*between, longest})


@lru_cache(maxsize=1)
def _windows_once(chosen_by: AdaptiveWindow, force: bytes, sample_time_s: float) -> Windows:
    """Find the windows of a force; kept, because a recording's smoothing and its label's uncertainty need the same."""
    return chosen_by._chosen(np.frombuffer(force), sample_time_s)


@dataclass(frozen=True)
class Windows:
    """The windows before and after each sample, which is part of both; each of shape ``(n,)``.

    ``AdaptiveWindow.windows`` finds them in a force. ``mean`` then smooths any signal of the same recording over them,
    and ``residual_noise`` states how much noise is left.
    """

    first: NDArray[np.int64]  # First row of the window before it
    end: NDArray[np.int64]  # Row behind the window after it
    # Number of samples of each
    before: Array
    after: Array
    noise: float  # Standard deviation of the white noise of the force [N]

    def mean(self, values: Array) -> Array:
        """Average values over both windows, shape ``(n,)``; the sample itself counts on both sides."""
        before, after = self.means(values)
        return before + (after - before) * self.after / (self.before + self.after)

    def means(self, values: Array) -> tuple[Array, Array]:
        """Average values over the windows before and after each sample, which is part of both; each ``(n,)``."""
        sums = np.concatenate([[0.0], np.cumsum(values - values[0])])
        before = (sums[1:] - sums[self.first]) / self.before
        after = (sums[self.end] - sums[:-1]) / self.after
        return values[0] + before, values[0] + after

    def residual_noise(self) -> Array:
        """Compute the standard deviation that the noise leaves in the means, shape ``(n,)``."""
        counted = self.before + self.after
        return self.noise * np.sqrt(counted + 2.0) / counted


def _one_side(values: Array, lengths: NDArray[np.int64], half_width: float) -> NDArray[np.int64]:
    """Find for each sample the longest agreeing window after it, in samples, shape ``(n,)``, integers."""
    rows, widths = len(values), half_width / np.sqrt(lengths + 1.0)
    sums = np.cumsum(np.concatenate([[0.0], values]))
    longer = np.zeros(rows, dtype=np.uint8)
    for first in range(0, rows, BLOCK):
        end = min(first + BLOCK, rows)
        lower, upper = np.full(end - first, -np.inf), np.full(end - first, np.inf)
        for length, width in zip(lengths, widths, strict=True):
            count = min(end, rows - length) - first  # of these samples, the ones with enough after them
            if count <= 0:
                break
            last, lower, upper = first + count, lower[:count], upper[:count]
            mean = (sums[first + length + 1 : last + length + 1] - sums[first:last]) / (length + 1)
            np.maximum(lower, mean - width, out=lower)
            np.minimum(upper, mean + width, out=upper)
            longer[first:last] += lower <= upper  # intervals that once disagree do so from then on
    return np.append(0, lengths)[longer]


def default_filter(cylinder: Cylinder) -> AdaptiveWindow:
    """Make the filter whose labels are nearest to true friction on the simulated rig: ``AdaptiveWindow``.

    ``label`` uses it unless you pass another one. Its windows are in seconds, so any sample rate will do. The
    cylinder's areas weight both pressures. It looks ahead: use it for labels, never in real time.

    Example:
        >>> from cylinder_friction.signals.zero_phase import default_filter
        >>> default_filter(cylinder).piston_area_m2 == cylinder.piston_area_m2
        True
    """
    return AdaptiveWindow(cylinder.piston_area_m2, cylinder.annulus_area_m2)

"""A zero-phase filter with windows as wide as the signal allows: for labels, never for estimates."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.signals.noise import noise_deviation
from cylinder_friction.signals.smooth_signals import P1, P2, SignalFilter, SmoothSignals, Support, X
from cylinder_friction.signals.zero_phase import SavitzkyGolay

GROWTH = 1.3
"""Each window is longer than the last by this factor."""
BLOCK = 1 << 16
"""Windows are chosen in blocks of this many samples, which the processor's cache holds."""


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
        >>> from cylinder_friction.signals.adaptive import default_filter
        >>> default_filter(cylinder).piston_area_m2 == cylinder.piston_area_m2
        True
    """
    return AdaptiveWindow(cylinder.piston_area_m2, cylinder.annulus_area_m2)

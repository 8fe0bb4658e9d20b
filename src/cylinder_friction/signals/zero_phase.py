"""Zero-phase filters, which look as far ahead as back: for labels, never for estimates."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.signals.causal import cascade_taps
from cylinder_friction.signals.causal_chain import MovingAverage, OneSidedSavitzkyGolay
from cylinder_friction.signals.smooth_signals import SignalFilter, Support, window_samples


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

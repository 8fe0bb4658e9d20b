"""Causal filters for whole recordings and for streaming: pressures, velocity and acceleration without looking ahead.

Each block takes raw samples, shape ``(n, 3)``, and returns, shape ``(n, 4)``: smooth pressure 1 [Pa], smooth pressure 2
[Pa], velocity [m/s], acceleration [m/s²].
"""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.signals.causal import (
    CausalBlock,
    FirFilter,
    cascade_taps,
    difference_taps,
    moving_average_taps,
    one_sided_savitzky_golay_taps,
)
from cylinder_friction.signals.smooth_signals import P1, P2, SignalFilter, SmoothSignals, Support, X, window_samples


class CausalFilter(SignalFilter):
    """A filter that never looks ahead; a subclass gives its causal block."""

    @abstractmethod
    def block(self, sample_time_s: float) -> CausalBlock:
        """Make the filter's block for streaming."""

    def smooth(self, samples: Array, sample_time_s: float) -> SmoothSignals:
        block = self.block(sample_time_s)
        return SmoothSignals(*np.ascontiguousarray(block.advance(block.new_state(), np.ascontiguousarray(samples)).T))

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        zero = np.zeros_like(force_n)
        return self.smooth(np.column_stack([force_n, zero, zero]), sample_time_s).pressure_1_smooth_pa

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        zero = np.zeros_like(position_m)
        signals = self.smooth(np.column_stack([zero, zero, position_m]), sample_time_s)
        return signals.velocity_m_s, signals.acceleration_m_s2


class CausalFir(CausalFilter):
    """A causal filter of finite impulse response; a subclass gives its taps."""

    @abstractmethod
    def taps(self, sample_time_s: float) -> tuple[Array, Array, Array]:
        """Build the taps of each pressure, of velocity from position, and of acceleration from position."""

    def block(self, sample_time_s: float) -> FirFilter:
        pressure, velocity, acceleration = self.taps(sample_time_s)
        taps = np.zeros((4, 3, max(len(pressure), len(velocity), len(acceleration))))
        for output, source, own in ((0, P1, pressure), (1, P2, pressure), (2, X, velocity), (3, X, acceleration)):
            taps[output, source, : len(own)] = own
        return FirFilter(taps)

    def support(self, sample_time_s: float) -> Support:
        return Support(self.block(sample_time_s).length - 1, 0)


@dataclass(frozen=True)
class MovingAverage(CausalFir):
    """The paper's filter chain exactly as published (Jamshidi et al., section II A), causal and therefore delayed.

    Pressures: moving average. Velocity: backward differences of the position's moving average. Acceleration:
    backward differences of that velocity, moving average of ``acceleration_window``. With windows of 10 and 30 at
    200 Hz pressures are delayed by 22.5 ms, velocity by 25 ms and acceleration by 100 ms.
    """

    window: int = 10  # Window of pressures and position [samples]
    acceleration_window: int = 30  # Window of the acceleration [samples]

    def taps(self, sample_time_s: float) -> tuple[Array, Array, Array]:
        average, difference = moving_average_taps(self.window), difference_taps(sample_time_s)
        velocity = cascade_taps(average, difference)
        return average, velocity, cascade_taps(velocity, difference, moving_average_taps(self.acceleration_window))


@dataclass(frozen=True)
class OneSidedSavitzkyGolay(CausalFir):
    """Polynomials fitted to the last samples and evaluated at the present one: the causal form of ``SavitzkyGolay``."""

    pressure_window_s: float = 0.05  # Time from the first to the last sample of a window [s]
    pressure_order: int = 2  # Order of the polynomial
    velocity_window_s: float = 0.1
    velocity_order: int = 3
    acceleration_window_s: float = 0.2
    acceleration_order: int = 3

    def taps(self, sample_time_s: float) -> tuple[Array, Array, Array]:
        def taps(window_s: float, order: int, derivative: int) -> Array:
            window = window_samples(window_s, order, sample_time_s)
            return one_sided_savitzky_golay_taps(window, order, derivative, sample_time_s)

        return (
            taps(self.pressure_window_s, self.pressure_order, 0),
            taps(self.velocity_window_s, self.velocity_order, 1),
            taps(self.acceleration_window_s, self.acceleration_order, 2),
        )

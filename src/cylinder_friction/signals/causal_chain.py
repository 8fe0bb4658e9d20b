"""The published causal filter chain, for whole recordings."""

from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.signals.causal import FirFilter, cascade_taps, difference_taps, moving_average_taps
from cylinder_friction.signals.smooth_signals import SignalFilter, Support


@dataclass(frozen=True)
class MovingAverage(SignalFilter):
    """The paper's filter chain exactly as published (Jamshidi et al., section II A), causal and therefore delayed.

    Pressures: moving average. Velocity: backward differences of the position's moving average. Acceleration:
    backward differences of that velocity, moving average of ``acceleration_window``. With windows of 10 and 30 at
    200 Hz pressures are delayed by 22.5 ms, velocity by 25 ms and acceleration by 100 ms.
    """

    window: int = 10  # Window of pressures and position [samples]
    acceleration_window: int = 30  # Window of the acceleration [samples]

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        return _filtered(self.taps(sample_time_s)[0], force_n)

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        _, velocity, acceleration = self.taps(sample_time_s)
        return _filtered(velocity, position_m), _filtered(acceleration, position_m)

    def support(self, sample_time_s: float) -> Support:
        return Support(max(map(len, self.taps(sample_time_s))) - 1, 0)

    def taps(self, sample_time_s: float) -> tuple[Array, Array, Array]:
        """Build the taps of each pressure, of velocity from position, and of acceleration from position."""
        average, difference = moving_average_taps(self.window), difference_taps(sample_time_s)
        velocity = cascade_taps(average, difference)
        return average, velocity, cascade_taps(velocity, difference, moving_average_taps(self.acceleration_window))


def _filtered(taps: Array, values: Array) -> Array:
    return np.ascontiguousarray(FirFilter(taps[None, None]).run(values[:, None])[:, 0])

"""Causal velocity from raw position that is exactly zero at standstill and keeps slow creep.

A velocity dead band cannot distinguish creep at 1 mm/s from the noise of a 12-bit potentiometer. Travel can: creep
adds up, noise does not. So velocity counts only while the smoothed position has recently pushed against a backlash of
some tens of micrometres, and only in the direction of the push.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled
from cylinder_friction.signals.backlash import new_backlash, pushing_velocity
from cylinder_friction.signals.causal import FirFilter, FirState, one_sided_savitzky_golay_taps


@dataclass(frozen=True)
class CausalVelocity:
    """Settings of the filter from raw position to causal velocity."""

    # Samples of the one-sided Savitzky-Golay filter for position and velocity; velocity also counts for this long after
    # the last push against the backlash
    window: int
    order: int  # Order of its polynomial
    backlash_m: float  # Half-width of the backlash; 0 lets everything through [m]
    dead_band_m_s: float  # Velocities below this are zero, whatever the backlash [m/s]

    def block(self, sample_time_s: float) -> VelocityBlock:
        """Build the causal block at a sample time."""
        return VelocityBlock(self, sample_time_s)


@dataclass
class VelocityState:
    """The filter's last positions, and the backlash [m], its age in samples."""

    position: FirState
    backlash: Array


class VelocityBlock:
    """Position [m], shape ``(n, 1)``, to velocity [m/s], shape ``(n,)``; cutting the input changes no bit."""

    def __init__(self, plan: CausalVelocity, sample_time_s: float) -> None:
        taps = [
            one_sided_savitzky_golay_taps(plan.window, plan.order, derivative, sample_time_s)[None, :]
            for derivative in (0, 1)
        ]
        self._plan = plan
        self._filter = FirFilter(np.stack(taps))

    def new_state(self) -> VelocityState:
        return VelocityState(FirState(), new_backlash())

    def advance(self, state: VelocityState, position_m: Array) -> Array:
        smooth = self._filter.advance(state.position, position_m)
        return _gated(smooth, state.backlash, self._plan.backlash_m, self._plan.dead_band_m_s, self._plan.window)


@compiled
def _gated(smooth: Array, backlash: Array, half_width: float, dead_band: float, lasting: int) -> Array:
    velocity = np.zeros(smooth.shape[0])
    for row in range(smooth.shape[0]):
        rate = smooth[row, 1]
        pushing = pushing_velocity(rate, smooth[row, 0], backlash, half_width, lasting, 0.0, 1.0)
        if abs(rate) >= dead_band:
            velocity[row] = rate if half_width == 0.0 else pushing
    return velocity

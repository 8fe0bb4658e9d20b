"""Velocity that is exactly zero at standstill, and a direction of the last motion that a stop does not reverse.

Filters that extrapolate overshoot where a piston stops suddenly and would push a backlash operator back, as if the last
motion had gone the other way. A moving average never overshoots, so here the backlash operator follows one, while
velocity still comes from a filter without its delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.signals.backlash import DIRECTION, new_backlash, pushing_velocity
from cylinder_friction.signals.causal import FirFilter, FirState, moving_average_taps, one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array


AVERAGED = 10
"""Samples of the moving average before the backlash operator."""
BACKLASH_M = 6e-5
"""Half-width of the backlash [m], about five times the noise of a 12-bit potentiometer so averaged."""
LASTING_S = 0.06
"""How long velocity counts after the last push [s]."""
CENTRING_S = 0.5
"""How fast the backlash closes up on the position [s]. Creep below its half-width in this time, 0.12 mm/s, is lost."""
VELOCITY_WINDOW, VELOCITY_ORDER = 21, 2
MEMORY_M_S, MEMORY_S = 0.012, 0.2
"""Speed over which the memory of ``causal_motion`` fades, and how fast it follows."""


@dataclass
class SteadyMotionState:
    """State of the filter, and of the backlash operator."""

    position: FirState
    backlash: Array


class SteadyMotion:
    """Position [m], shape ``(n, 1)``, to velocity [m/s] and direction of the last motion, shape ``(n, 2)``."""

    def __init__(self, sample_time_s: float) -> None:
        velocity = one_sided_savitzky_golay_taps(VELOCITY_WINDOW, VELOCITY_ORDER, 1, sample_time_s)
        average = np.pad(moving_average_taps(AVERAGED), (0, VELOCITY_WINDOW - AVERAGED))
        self._filter = FirFilter(np.stack([average, velocity])[:, None, :])
        self._sample_time_s = sample_time_s

    def new_state(self) -> SteadyMotionState:
        return SteadyMotionState(FirState(), new_backlash())

    def advance(self, state: SteadyMotionState, position_m: Array) -> Array:
        smooth = self._filter.advance(state.position, position_m)
        return np.asarray(_through_backlash(smooth, state.backlash, self._sample_time_s))

    def multiply_adds(self) -> int:
        return AVERAGED + VELOCITY_WINDOW


@numba.njit(cache=True)
def _through_backlash(smooth: Array, backlash: Array, sample_time_s: float) -> Array:
    result, centring = np.empty((smooth.shape[0], 2)), sample_time_s / CENTRING_S
    for row in range(smooth.shape[0]):
        average, velocity = smooth[row]
        result[row, 0] = pushing_velocity(velocity, average, backlash, BACKLASH_M, LASTING_S, centring, sample_time_s)
        result[row, 1] = backlash[DIRECTION]
    return result


def new_causal_motion() -> Array:
    """Return the state of ``causal_motion`` before the first sample, shape ``(7,)``."""
    return np.concatenate([np.full(4, np.nan), new_backlash()])


@numba.njit(cache=True)
def causal_motion(position_m: Array, averaged_m: Array, gains: Array, sample_time_s: float, state: Array) -> Array:
    """Return, shape ``(n, 4)``: velocity, exactly 0 at standstill [m/s]; acceleration [m/s²]; direction of the last
    motion; memory.

    Position, velocity and acceleration are the states of a steady-state Kalman filter; velocity counts only while the
    averaged position has recently pushed against the backlash.

    Args:
        position_m: Shape ``(n,)``.
        averaged_m: The same after a moving average, shape ``(n,)``.
        gains: Of the steady-state filter, shape ``(3,)``.
        sample_time_s: Between two samples [s].
        state: From ``new_causal_motion``, changed in place: position, velocity, acceleration, memory, backlash.
    """
    result = np.empty((position_m.shape[0], 4))
    step, backlash = sample_time_s, state[4:]
    for row in range(position_m.shape[0]):
        if np.isnan(state[0]):
            state[0], state[1], state[2], state[3] = position_m[row], 0.0, 0.0, 1.0
        ahead = state[0] + step * state[1] + 0.5 * step * step * state[2]
        left = position_m[row] - ahead
        state[1] += step * state[2] + gains[1] * left
        state[0] = ahead + gains[0] * left
        state[2] += gains[2] * left
        velocity = pushing_velocity(state[1], averaged_m[row], backlash, BACKLASH_M, LASTING_S, step / CENTRING_S, step)
        fading = math.exp(-abs(velocity) / MEMORY_M_S)
        state[3] += (1.0 - math.exp(-step / MEMORY_S)) * (fading - state[3])
        result[row, 0], result[row, 1], result[row, 2], result[row, 3] = (
            velocity,
            state[2],
            backlash[DIRECTION],
            state[3],
        )
    return result

"""Velocity that is exactly zero at standstill, and a direction of the last motion that a stop does not reverse.

Filters that extrapolate overshoot when a piston stops suddenly. They would push a backlash operator back, as if the
last motion had gone the other way. A moving average never overshoots, so here the backlash operator follows one, while
velocity still comes from a filter without its delay.
"""

import math

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.signals.backlash import DIRECTION, new_backlash, pushing_velocity
from cylinder_friction.signals.causal import FirFilter, moving_average_taps, one_sided_savitzky_golay_taps
from cylinder_friction.signals.kalman import constant_jerk

AVERAGED = 10  # Samples of the moving average before the backlash operator
BACKLASH_M = 6e-5  # Half-width of the backlash [m], about five times the noise of a 12-bit potentiometer so averaged
LASTING_S = 0.06  # How long velocity counts after the last push [s]
CENTRING_S = 0.5
"""How fast the backlash closes up on the position [s]. Creep below its half-width in this time, 0.12 mm/s, is lost."""
VELOCITY_WINDOW, VELOCITY_ORDER = 21, 2
MEMORY_M_S, MEMORY_S = 0.012, 0.2  # Speed over which the memory of ``causal_motion`` fades, and how fast it follows
JERK_M_S3, POSITION_NOISE_M = 12.0, 3.5e-5


def steady_motion(position_m: Array, sample_time_s: float) -> Array:
    """Return velocity [m/s], exactly 0 at standstill, and direction of the last motion, shape ``(n, 2)``."""
    taps = one_sided_savitzky_golay_taps(VELOCITY_WINDOW, VELOCITY_ORDER, 1, sample_time_s)
    return _through_backlash(_filtered(taps, position_m), position_m, sample_time_s)


def causal_motion(position_m: Array, sample_time_s: float) -> Array:
    """Return, shape ``(n, 4)``: velocity, exactly 0 at standstill [m/s]; acceleration [m/s²]; direction of the last
    motion; memory, which follows the exponential of minus the speed.

    Position, velocity and acceleration are the states of a steady-state Kalman filter. Velocity counts only while the
    averaged position has recently pushed against the backlash.
    """
    step = sample_time_s
    gains = constant_jerk(JERK_M_S3, POSITION_NOISE_M, step).gains.filter[-1]
    position, velocity, acceleration = float(position_m[0]), 0.0, 0.0
    states = []
    for measured in position_m.tolist():
        ahead = position + step * velocity + 0.5 * step * step * acceleration
        missed = measured - ahead
        velocity += step * acceleration + gains[1] * missed
        position = ahead + gains[0] * missed
        acceleration += gains[2] * missed
        states.append((velocity, acceleration))
    velocity_m_s, acceleration_m_s2 = np.array(states).T
    motion = _through_backlash(velocity_m_s, position_m, step)
    memory, follows, remembered = 1.0, 1.0 - math.exp(-step / MEMORY_S), []
    for fading in np.exp(-np.abs(motion[:, 0]) / MEMORY_M_S).tolist():
        memory += follows * (fading - memory)
        remembered.append(memory)
    return np.column_stack([motion[:, 0], acceleration_m_s2, motion[:, 1], remembered])


def _filtered(taps: Array, values: Array) -> Array:
    return np.asarray(FirFilter(taps[None, None, :]).run(values[:, None])[:, 0])


def _through_backlash(velocity_m_s: Array, position_m: Array, step: float) -> Array:
    """Return velocity and direction, shape ``(n, 2)``; velocity is zero unless the backlash was pushed recently."""
    average_m = _filtered(moving_average_taps(AVERAGED), position_m)
    result, backlash = np.empty((len(average_m), 2)), new_backlash()
    for row, (velocity, average) in enumerate(zip(velocity_m_s.tolist(), average_m.tolist(), strict=True)):
        pushed = pushing_velocity(velocity, average, backlash, BACKLASH_M, LASTING_S, step / CENTRING_S, step)
        result[row] = pushed, backlash[DIRECTION]
    return result

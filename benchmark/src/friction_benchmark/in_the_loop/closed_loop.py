"""The servo rig in a closed loop, one cycle of 1 ms after the other, with the friction estimate fed forward.

A position loop gives the reference of a pressure-difference loop, whose output is a speed for the valve:

    F_ref = k_x·(e + k_i·∫e) + F_load + share·F̂        u = v_ref + k_F·(F_ref - (p1·A1 - p2·A2))

The valve's overlap is bridged by a steep piece of characteristic around its centre. ``controller.c`` is the same in C.
"""

import math
from dataclasses import astuple
from typing import Any, NamedTuple

import numba
import numpy as np
from scipy import signal

from cylinder_friction.arrays import Array
from cylinder_friction.signals.backlash import new_backlash, pushing_velocity
from cylinder_friction.signals.kalman import constant_jerk
from friction_benchmark.models import disturbance_observer as kalman
from friction_benchmark.models import steady_motion as motion
from friction_benchmark.servo_rig import dynamics
from friction_benchmark.servo_rig.dynamics import P1, P2, TICK_S, X
from friction_benchmark.servo_rig.parameters import CYLINDER, Sensors
from friction_benchmark.servo_rig.simulate import TICK_STEPS

SERIES, EXPORTED_C, OBSERVER, TRUTH = range(4)  # Where the fed-forward friction comes from
REFERENCE, POSITION, FRICTION, FED, SPOOL = range(5)  # Columns of a trace
START_2_PA = 70e5  # Rod side at the beginning [Pa]


class Controller(NamedTuple):
    """Gains of the cascade, and what its valve is; ``controller.c`` has the same fields in the same order."""

    position_n_m: float = 0.0  # k_x
    integral_1_s: float = 0.0  # k_i
    force_m_s_n: float = 0.0  # k_F
    share: float = 0.0  # Of the friction estimate that is fed forward
    most_n: float = 600.0  # The integral's part of the force reference stays within this [N]
    piston_area_m2: float = CYLINDER.piston_area_m2
    annulus_area_m2: float = CYLINDER.annulus_area_m2
    extend_m_s: float = 0.33  # Speed of the open valve
    retract_m_s: float = 0.26
    overlap: float = 0.02  # Of the valve, as a share of its travel
    knee: float = 0.005  # Command at which the overlap is bridged
    null_m_s: float = 0.0  # Speed that trims the valve's null


class Observer(NamedTuple):
    """The Kalman filter of ``disturbance_observer`` and its state, to be stepped sample by sample."""

    numbers: tuple[Array, Array, Array, float]  # Law, noise, areas, sample time
    state: tuple[Array, Array, Array]  # Covariance, mean, memory
    gains: Array  # Of position, velocity and acceleration
    motion: Array  # Position, velocity, acceleration, memory of the motion
    latest_m: Array  # Positions that the moving average takes, in a ring
    backlash: Array


def new_observer(fitted: kalman.DisturbanceObserver, p1: float, p2: float, x: float, step_s: float) -> Observer:
    """Return a fitted observer before its first sample."""
    areas, mean = np.array([fitted.cylinder.piston_area_m2, fitted.cylinder.annulus_area_m2]), np.zeros(kalman.STATES)
    mean[kalman.SCALE] = 1.0
    gains = np.array(constant_jerk(motion.JERK_M_S3, motion.POSITION_NOISE_M, step_s).gains.filter[-1], dtype=float)
    numbers = fitted.law, np.array(astuple(fitted.noise)), areas, step_s
    state = kalman.first_covariance(fitted.noise, areas), mean, np.array([0.0, (p1 + p2) / kalman.BAR_PA])
    return Observer(numbers, state, gains, np.array([x, 0, 0, 1.0]), np.full(motion.AVERAGED, x), new_backlash())


@numba.njit(nogil=True)
def observer_step(kept: Observer, p1: float, p2: float, x: float, mass_kg: float, row: int) -> float:
    """Return the friction [N] of one sample, as ``DisturbanceObserver.estimate`` gives it row by row."""
    (law, noise, areas, step), (covariance, mean, memory), state = kept.numbers, kept.state, kept.motion
    ahead = state[0] + step * state[1] + 0.5 * step * step * state[2]
    missed = x - ahead
    state[1] += step * state[2] + kept.gains[1] * missed
    state[0] = ahead + kept.gains[0] * missed
    state[2] += kept.gains[2] * missed
    kept.latest_m[row % motion.AVERAGED] = x
    limits = (motion.BACKLASH_M, motion.LASTING_S, step / motion.CENTRING_S, step)
    velocity = pushing_velocity(state[1], kept.latest_m.mean(), kept.backlash, *limits)
    state[3] += (1.0 - math.exp(-step / motion.MEMORY_S)) * (math.exp(-abs(velocity) / motion.MEMORY_M_S) - state[3])
    moved = np.array([velocity, state[2], kept.backlash[1], state[3]])
    measured = (moved, p1 * areas[0] - p2 * areas[1] - mass_kg * state[2], (p1 + p2) / kalman.BAR_PA)
    return kalman.observe_one(measured, law, noise, areas, step, covariance, mean, memory)


@numba.njit(nogil=True)
def control(gains: Any, integral: Any, reference: tuple[float, float], sample: Any, friction: float) -> float:
    """Return the spool command, -1 to 1, for the reference now and one cycle later, and a sample p1, p2, x, load."""
    error = reference[0] - sample[2]
    most = gains.most_n / max(gains.position_n_m * gains.integral_1_s, 1e-9)
    integral[0] = min(max(integral[0] + TICK_S * error, -most), most)
    wanted_n = gains.position_n_m * (error + gains.integral_1_s * integral[0]) + sample[3] + gains.share * friction
    force_n = sample[0] * gains.piston_area_m2 - sample[1] * gains.annulus_area_m2
    speed = (reference[1] - reference[0]) / TICK_S + gains.force_m_s_n * (wanted_n - force_n) + gains.null_m_s
    opened = speed / (gains.extend_m_s if speed > 0.0 else gains.retract_m_s)
    opened += gains.overlap * min(max(opened / gains.knee, -1.0), 1.0)
    return min(max(opened, -1.0), 1.0)


@numba.njit(nogil=True)
def sense(sensors: Any, filtering: Any, state: Any, load_n: float, noise: Any, sample: Any) -> None:
    """Fill a sample p1, p2, x, load as a controller sees it: behind the anti-aliasing filter, noisy, quantised."""
    sections, delays = filtering
    step_pa = sensors.pressure_span_pa / 2.0**sensors.pressure_bits
    for side, offset_pa in ((P1, sensors.offset_1_pa), (P2, sensors.offset_2_pa)):
        value = state[side]
        for k in range(sections.shape[0]):
            b0, b1, b2, _, a1, a2 = sections[k]
            z = delays[side, k]
            out = b0 * value + z[0]
            z[0], z[1] = b1 * value - a1 * out + z[1], b2 * value - a2 * out
            value = out
        value += offset_pa + sensors.pressure_noise_pa * noise[side]
        sample[side] = min(max(round(value / step_pa) * step_pa, 0.0), sensors.pressure_span_pa)
    steps = round((state[X] + sensors.position_noise_m * noise[2]) / dynamics.POSITION_STEP_M)
    sample[2] = steps * dynamics.POSITION_STEP_M
    sample[3] = load_n + noise[3] if load_n != 0.0 else 0.0  # a load cell with noise of 1 N


def sensor_filter(sensors: Sensors, p1: float, p2: float) -> tuple[Array, Array]:
    """Return the pressures' anti-aliasing filter and its state at rest, as ``sessions.measure`` has them."""
    sections = signal.bessel(4, sensors.anti_alias_hz, fs=1.0 / TICK_S, norm="mag", output="sos")
    return sections, np.stack([signal.sosfilt_zi(sections) * pressure for pressure in (p1, p2)])


@numba.njit(nogil=True)
def plant_tick(rig: Any, elements: Any, state: Any, spool: float, load_n: float, oil: float) -> None:
    """Advance the rig by one cycle of the controller."""
    for _ in range(TICK_STEPS):
        load = rig[1].gravity_n + rig[1].spring_n_m * state[X] + load_n
        dynamics.advance(rig[0], rig[1], elements, state, spool, load, oil, TICK_S / TICK_STEPS)


@numba.njit(nogil=True)
def run(
    rig: Any,  # Seals, drive, sensors
    gains: Any,
    course: Any,  # Reference [m], one value more than there are cycles, and load [N]
    noise: Any,  # Standard normal, shape (cycles, 4)
    filtering: Any,  # From ``sensor_filter``
    source: int,
    series: Any,  # Friction of SERIES [N], one value per cycle
    exported: Any,  # ``loop_estimate``, the addresses of an exported C's step and state, and its output
    kept: Any,  # An ``Observer``
    lag: int,  # Cycles by which the fed-forward friction is late
    trace: Any,
) -> None:
    """Fill ``trace``, one row per cycle. The estimator sees every fourth cycle, as the logger does."""
    call, step, memory, output = exported
    state, elements = dynamics.at_rest(rig[1], course[0][0], START_2_PA), dynamics.element_shares(rig[0])
    oil, every = dynamics.viscosity_ratio(rig[1].oil_c), round(rig[2].sample_time_s / TICK_S)
    late, integral, sample, estimate = np.zeros(lag + 1), np.zeros(1), np.zeros(4), 0.0
    for tick in range(trace.shape[0]):
        sense(rig[2], filtering, state, course[1][tick], noise[tick], sample)
        true_n = dynamics.friction_n(rig[0], rig[1], state, oil)
        p1 = sample[0] - sample[3] / gains.piston_area_m2  # without the measured load
        if source == SERIES:
            estimate = series[tick]
        elif source == TRUTH:
            estimate = true_n
        elif tick % every == 0 and source == EXPORTED_C:
            call(step, memory, p1, sample[1], sample[2], output.ctypes)
            estimate = output[0]
        elif tick % every == 0:
            estimate = observer_step(kept, p1, sample[1], sample[2], rig[1].mass_kg, tick // every)
        late[tick % (lag + 1)] = estimate
        row, fed = trace[tick], late[(tick + 1) % (lag + 1)]
        row[REFERENCE], row[POSITION], row[FRICTION], row[FED] = course[0][tick], state[X], true_n, fed
        row[SPOOL] = state[dynamics.SPOOL]
        spool = control(gains, integral, (course[0][tick], course[0][tick + 1]), sample, fed)
        plant_tick(rig, elements, state, spool, course[1][tick], oil)

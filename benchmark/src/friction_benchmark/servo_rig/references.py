"""Position references of the servo rig, one value each millisecond [m]: sine sweeps, trapezoids, random steps."""

import numpy as np
from numpy.random import Generator
from scipy import signal

from cylinder_friction.arrays import Array
from friction_benchmark.servo_rig.dynamics import TICK_S

LOWEST_M, HIGHEST_M = 0.035, 0.265  # References keep within this, so that overshoot stays clear of the ends
LONGEST_STROKE_S = 3.0  # Slow strokes are short, so that a session has many


def sine_sweeps(generator: Generator, rows: int) -> Array:
    """Return sweeps from slow to fast and back, several per 40 s, whose amplitude bounds speed and acceleration."""
    time_s = TICK_S * np.arange(rows)
    period_s, slow_hz, fast_hz = (generator.uniform(*ends) for ends in ((25.0, 45.0), (0.06, 0.12), (1.5, 2.5)))
    part = 0.5 * (1.0 - np.cos(2.0 * np.pi * (time_s / period_s + generator.uniform(0.0, 1.0))))
    omega = 2.0 * np.pi * slow_hz * (fast_hz / slow_hz) ** part
    speed_m_s, acceleration_m_s2 = generator.uniform(0.08, 0.16), generator.uniform(0.8, 1.6)
    largest_m = np.minimum(generator.uniform(0.05, 0.085), speed_m_s / omega)
    amplitude_m = np.minimum(largest_m, acceleration_m_s2 / omega**2)
    angle = np.cumsum(omega) * TICK_S
    begun = np.sin(0.5 * np.pi * np.minimum(0.5 * time_s, 1.0)) ** 2
    return generator.uniform(0.13, 0.17) + begun * amplitude_m * np.sin(angle - angle[0])


def trapezoids(generator: Generator, rows: int) -> Array:
    """Return strokes of constant speed, 3 to 200 mm/s, between rests of 0.1 to 5 s."""
    at_m = generator.uniform(0.1, 0.2)
    pieces = [np.full(round(0.3 / TICK_S), at_m)]
    while sum(map(len, pieces)) < rows:
        speed_m_s = np.exp(generator.uniform(np.log(0.003), np.log(0.2)))
        farthest_m = LONGEST_STROKE_S * speed_m_s
        target_m = at_m + np.clip(generator.uniform(LOWEST_M, HIGHEST_M) - at_m, -farthest_m, farthest_m)
        pieces.append(_stroke(at_m, target_m, speed_m_s, generator.uniform(0.4, 1.2)))
        at_m = target_m
        rest_s = np.exp(generator.uniform(np.log(0.1), np.log(5.0)))
        pieces.append(np.full(round(rest_s / TICK_S), at_m))
    return np.concatenate(pieces)[:rows]


def random_steps(generator: Generator, rows: int) -> Array:
    """Return steps of up to some centimetres behind a critically damped set-point filter of 1.2 Hz."""
    at_m = generator.uniform(0.1, 0.2)
    wanted_m = np.empty(0)
    while len(wanted_m) < rows:
        hold_s = np.exp(generator.uniform(np.log(0.3), np.log(3.0)))
        wanted_m = np.concatenate([wanted_m, np.full(round(hold_s / TICK_S), at_m)])
        at_m = float(np.clip(at_m + generator.normal(0.0, 0.03), LOWEST_M, HIGHEST_M))
    keep = np.exp(-2.0 * np.pi * 1.2 * TICK_S)
    sections = signal.zpk2sos([], [keep, keep], (1.0 - keep) ** 2)
    return np.asarray(wanted_m[0] + signal.sosfilt(sections, wanted_m[:rows] - wanted_m[0]))


def _stroke(from_m: float, to_m: float, speed_m_s: float, acceleration_m_s2: float) -> Array:
    """Return a stroke with constant acceleration at either end; too short a one never reaches its speed."""
    length_m = abs(to_m - from_m)
    speed_m_s = min(speed_m_s, np.sqrt(length_m * acceleration_m_s2))
    ramp_s = speed_m_s / acceleration_m_s2
    steady_s = length_m / max(speed_m_s, 1e-9) - ramp_s
    time_s = TICK_S * np.arange(1, int((2.0 * ramp_s + steady_s) / TICK_S) + 1)
    speeding, slowing = np.minimum(time_s, ramp_s), np.maximum(time_s - ramp_s - steady_s, 0.0)
    gone_m = 0.5 * acceleration_m_s2 * (speeding**2 - slowing**2) + speed_m_s * np.maximum(time_s - ramp_s, 0.0)
    return from_m + np.sign(to_m - from_m) * np.minimum(gone_m, length_m)

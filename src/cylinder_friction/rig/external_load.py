"""External forces on the rod: a boom with a weight, a spring, weights that somebody adds and removes, a slow sine.

A load is positive if it resists extension, as in ``friction = P1·A1 - P2·A2 - m·a - F_load``. It is

    F_load(t, x) = force(t) + share(t)·along(x)

The inertia of the load is ignored, as if it hung on a long rope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.random import Generator

from cylinder_friction.arrays import Array
from cylinder_friction.rig.lever import TICK_S, ornstein_uhlenbeck

PLACES = 65  # Positions at which a position-dependent load is given, equidistant from 0 to the stroke
LARGEST_N = 3000.0  # Greatest load, the sum of all parts [N]
GRAVITY_M_S2 = 9.81
FRAME_M, BOOM_M, CLOSED_M = 0.55, 0.35, 0.45
"""Distances from the boom's pivot to the cylinder's foot and rod eye; the cylinder's length with the rod in [m]."""
REACH_M = 1.0  # Distance from the boom's pivot to its weight
CRANE_MASS_KG, CRANE_ANGLE_RAD = 165.0, math.radians(65.0)
"""Weight on the crane's boom, and the boom's angle above the horizon with the rod in. The boom swings over its pivot:
over 250 mm of stroke the load changes from 1960 N against extension to 2040 N with it."""


@dataclass(frozen=True)
class ExternalLoad:
    """A load for the simulation."""

    force_n: Array  # Force that depends on time alone, one value per millisecond, shape ``(ticks,)`` [N]
    share: Array  # Share of ``along_n`` that acts, one value per millisecond, shape ``(ticks,)``
    along_n: Array  # Force at positions spaced evenly from 0 to the stroke, shape ``(places,)`` [N]

    @classmethod
    def of_time(cls, force_n: Array) -> ExternalLoad:
        """Make a load that depends on time alone, one value each millisecond [N]."""
        force_n = np.asarray(force_n, dtype=np.float64)
        return cls(force_n, np.zeros_like(force_n), np.zeros(2))

    def at_start(self, position_m: float, stroke_m: float) -> float:
        """Compute the load at time 0 [N]."""
        return float(load_at(self.force_n, self.share, self.along_n, 0.0, position_m, stroke_m))


@numba.njit(cache=True)
def load_at(force_n: Any, share: Any, along_n: Any, time_s: float, position_m: float, stroke_m: float) -> float:
    """Interpolate the load linearly at a time and a position [N]; beyond the ends it is constant."""
    place = position_m / stroke_m * (len(along_n) - 1)
    return between(force_n, time_s / TICK_S) + between(share, time_s / TICK_S) * between(along_n, place)


@numba.njit(cache=True)
def between(values: Any, place: float) -> float:
    """Interpolate linearly at a place counted in values; beyond the ends the value is constant."""
    index = min(max(int(place), 0), len(values) - 2)
    part = min(max(place - index, 0.0), 1.0)
    return values[index] + (values[index + 1] - values[index]) * part


def varied_load(generator: Generator, duration_s: float, stroke_m: float) -> ExternalLoad:
    """Make a load drawn at random, to about ±3 kN, that changes within the recording.

    The load is a boom, a spring or neither, and drifts by a few percent. Added to it are weights that somebody puts on
    and takes off at random, or a slow sine, or both.
    """
    ticks = round(duration_s / TICK_S) + 2
    base = generator.choice(3, p=(0.45, 0.30, 0.25))
    along_n = np.zeros(PLACES) if base == 2 else (boom_n, spring_n)[base](generator, stroke_m)
    share = 1.0 + np.clip(ornstein_uhlenbeck(generator, ticks, TICK_S, 3.0, 0.03), -0.1, 0.1)
    with_steps, with_sine = ((True, False), (False, True), (True, True))[generator.choice(3, p=(0.4, 0.2, 0.4))]
    force_n = np.zeros(ticks)
    if with_steps:
        force_n += steps_n(generator, ticks)
    if with_sine:
        force_n += slow_sine_n(generator, ticks)
    greatest = float(np.abs(force_n).max() + 1.1 * np.abs(along_n).max())
    scale = min(1.0, LARGEST_N / greatest)
    return ExternalLoad(scale * force_n, share, scale * along_n)


def boom_n(generator: Generator, stroke_m: float) -> Array:
    """Draw a weight on a boom that the cylinder lifts or holds back; return its force at each position [N]."""
    above_horizon = generator.uniform(math.radians(-40.0), math.radians(20.0))
    sign = 1.0 if generator.random() < 0.6 else -1.0
    return sign * weight_n(generator.uniform(12.0, 65.0), above_horizon, stroke_m)


def crane_load(duration_s: float, stroke_m: float) -> ExternalLoad:
    """Build the load of the crane, which depends on position alone and is the same in every recording."""
    ticks = round(duration_s / TICK_S) + 2
    return ExternalLoad(np.zeros(ticks), np.ones(ticks), weight_n(CRANE_MASS_KG, CRANE_ANGLE_RAD, stroke_m))


def weight_n(mass_kg: float, angle_rad: float, stroke_m: float) -> Array:
    """Compute the force of a weight on a boom at each position, shape ``(PLACES,)`` [N].

    The boom turns by some 45° over the stroke. The weight's lever arm changes with the cosine of the boom's angle. The
    cylinder's lever arm follows from the law of cosines in the triangle of frame, boom and cylinder.

    With the rod in, the boom is ``angle_rad`` above the horizon.
    """
    length = CLOSED_M + np.linspace(0.0, 1.0, PLACES) * stroke_m
    cosine = np.clip((FRAME_M**2 + BOOM_M**2 - length**2) / (2.0 * FRAME_M * BOOM_M), -0.95, 0.95)
    angle = np.arccos(cosine)
    lever_m = FRAME_M * BOOM_M * np.sin(angle) / length
    return np.asarray(mass_kg * GRAVITY_M_S2 * REACH_M * np.cos(angle_rad + angle - angle[0]) / lever_m)


def spring_n(generator: Generator, stroke_m: float) -> Array:
    """Draw a spring that the rod meets in its stroke, in either direction; return its force at each position [N]."""
    along_m = np.linspace(0.0, stroke_m, PLACES)
    stiffness_n_m = generator.uniform(4e3, 15e3)
    free_m = generator.uniform(0.0, 0.5) * stroke_m
    pressed_n = np.minimum(stiffness_n_m * np.maximum(along_m - free_m, 0.0), 2500.0)
    return pressed_n if generator.random() < 0.5 else -pressed_n[::-1]


def steps_n(generator: Generator, ticks: int) -> Array:
    """Draw a load that somebody changes: another force every 2 to 10 s, reached within a third of a second [N]."""
    duration_s = ticks * TICK_S
    at_s, force_n = [0.0], [generator.uniform(-1000.0, 1000.0)]
    while at_s[-1] < duration_s:
        began_s = at_s[-1] + (generator.uniform(2.0, 10.0) if len(at_s) > 1 else generator.uniform(0.5, 3.0))
        at_s += [began_s, began_s + generator.uniform(0.06, 0.35)]
        force_n += [force_n[-1], generator.uniform(-1300.0, 1300.0)]
    return np.interp(TICK_S * np.arange(ticks), at_s, force_n)


def slow_sine_n(generator: Generator, ticks: int) -> Array:
    """Draw a sine of 0.05 to 0.3 Hz and 200 to 900 N; return its force at each tick [N]."""
    rate = 2.0 * math.pi * generator.uniform(0.05, 0.3)
    phase = generator.uniform(0.0, 2.0 * math.pi)
    return np.asarray(generator.uniform(200.0, 900.0) * np.sin(rate * TICK_S * np.arange(ticks) + phase))

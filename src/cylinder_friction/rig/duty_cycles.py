"""Duty cycles of an operator at the hand lever: mostly free work, with sines, staircases and ramps in between."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from cylinder_friction.rig.lever import APPROACH, MOVE, RAMP, SINE, DutyCycle, hand_remnant
from cylinder_friction.rig.parameters import RigParameters

Row = tuple[float, ...]
EXPECTED_FRICTION_N = 350.0  # Friction that the operator allows for when choosing the lever


def lever_for_speed(rig: RigParameters, speed_m_s: float) -> float:
    """Choose the lever position that moves the piston steadily at this signed speed, as an operator does by eye.

    The position follows from the steady force balance with both metering edges and the throttle. If the piston cannot
    reach the speed, the position is full lever.
    """
    y = rig.hydraulics
    speed = abs(speed_m_s)
    if speed == 0.0:
        return 0.0
    into, out, ratio, throttle = y.piston_area_m2, y.annulus_area_m2, y.return_ratio_2, y.throttle_gain
    if speed_m_s < 0.0:
        into, out, ratio, throttle = out, into, y.return_ratio_1, math.inf
    force = y.pump_pressure_pa * into - y.tank_pressure_pa * out - EXPECTED_FRICTION_N
    left = force - out**3 * (speed / throttle) ** 2
    needed = speed**2 * (into**3 + out**3 / ratio**2) / y.valve_gain**2
    opening = math.sqrt(needed / left) if left > needed else 1.0
    return math.copysign(y.valve_overlap + (1.0 - y.valve_overlap) * opening ** (1.0 / y.metering_exponent), speed_m_s)


def hand_work(rig: RigParameters, generator: Generator, duration_s: float) -> list[Row]:
    """Plan about ``duration_s`` of free work: strokes at random speeds, corrections, inching and pauses."""
    rows: list[Row] = []
    direction = float(generator.choice((-1.0, 1.0)))
    while sum(row[2] + row[3] for row in rows) < duration_s:
        kind = generator.choice(4, p=(0.68, 0.12, 0.12, 0.08))
        if kind == 0:
            rows += _stroke(rig, generator, direction)
            if generator.random() < 0.45:
                rows.append(_row(0.0, generator.uniform(0.1, 0.25), generator.uniform(0.05, 0.6)))
        elif kind == 1:
            rows += _inching(rig, generator, direction)
        elif kind == 2:
            rows.append(_row(0.0, generator.uniform(0.12, 0.3), min(0.5 * (1.0 + generator.pareto(1.5)), 20.0)))
        else:
            # A change of mind in mid-stroke: directly from one direction into the other.
            rows += _stroke(rig, generator, direction)[:1] + _stroke(rig, generator, -direction)[:1]
        direction = -direction if generator.random() < 0.75 else direction
    return rows


def staircase(rig: RigParameters, generator: Generator, steps: int = 6) -> list[Row]:
    """Plan strokes at constant speeds, about 1.5 to 45 mm/s, out and back, with the lever held against a stop."""
    low, high = 0.05 * rig.hydraulics.stroke_m, 0.92 * rig.hydraulics.stroke_m
    rows: list[Row] = [
        (APPROACH, lever_for_speed(rig, -0.045), 0.3, 8.0, 0.0, 0.13 * rig.hydraulics.stroke_m, 9.0, 0.3, 0.0, 1.0),
        _row(0.0, 0.2, 0.4),
    ]
    for sign in (1.0, -1.0):
        speeds = np.geomspace(0.0015, 0.045, steps) * generator.uniform(0.8, 1.25, steps)
        rows += [
            _row(lever_for_speed(rig, sign * speed), 0.15, 1.6 - 0.12 * step, low, high, shake=0.08)
            for step, speed in enumerate(speeds)
        ]
    return [*rows, _row(0.0, 0.2, 0.4)]


def sines(rig: RigParameters, generator: Generator, duration_s: float) -> list[Row]:
    """Plan two sines of the lever, each for half the time."""
    rows: list[Row] = []
    for _ in range(2):
        size = lever_for_speed(rig, generator.uniform(0.015, 0.06))
        frequency_hz = generator.uniform(0.25, 1.2)
        rows.append((SINE, size, 0.2, duration_s / 2.0 - 0.2, frequency_hz, -1.0, 9.0, 0.3, 0.0, 1.0))
    return rows


def breakaway_ramps(rig: RigParameters, generator: Generator) -> list[Row]:
    """Plan slow openings of the valve after dwells of different length, each until well after breakaway."""
    rows: list[Row] = []
    direction = float(generator.choice((-1.0, 1.0)))
    for _ in range(3):
        rows.append(_row(0.0, 0.15, generator.uniform(0.5, 4.0)))
        lever = lever_for_speed(rig, direction * generator.uniform(0.004, 0.015))
        rows.append((RAMP, lever, generator.uniform(0.8, 2.0), 0.3, 0.0, *_limits(rig, generator), 0.3, 0.0, 0.3))
        direction = -direction
    return rows


def duty_cycle(
    rig: RigParameters, generator: Generator, duration_s: float, turn: int = 0, before: Sequence[Row] = ()
) -> DutyCycle:
    """Plan an operator's duty cycle of about ``duration_s``: free work around one or two set exercises.

    ``turn`` rotates the exercises, so that a session of two recordings contains them all: even turns have a staircase,
    odd turns have sines and breakaway ramps. Short recordings begin with the free work. ``before`` comes first.
    """
    if turn % 2 == 0:
        exercises = staircase(rig, generator)
    else:
        exercises = sines(rig, generator, 8.0) + breakaway_ramps(rig, generator)
    taken = sum(row[2] + row[3] for row in exercises)
    free_s = generator.uniform(0.3, 0.7) * max(duration_s - taken, 0.4 * duration_s)
    rows = [*before, *hand_work(rig, generator, free_s), *exercises, *hand_work(rig, generator, 1.5 * duration_s)]
    return DutyCycle(np.array(rows), hand_remnant(generator, duration_s))


def unlogged_stroke(rig: RigParameters, generator: Generator, to_end: bool) -> tuple[list[Row], float]:
    """Plan a stroke, to an end stop or not, and a rest after it; also return how long it lasts before the log [s].

    The first second of the rest is not logged either, so that pressures have settled.
    """
    direction = float(generator.choice((-1.0, 1.0)))
    lever = direction if to_end else lever_for_speed(rig, direction * generator.uniform(0.01, 0.03))
    stroke_s = 8.0 if to_end else 1.0
    return [_row(lever, 0.2, stroke_s), _row(0.0, 0.15, 1.0 + generator.uniform(2.0, 5.0))], stroke_s + 1.35


def _row(
    target: float,
    move_s: float,
    hold_s: float,
    low: float = -1.0,
    high: float = 9.0,
    reaction_s: float = 0.3,
    chained: bool = False,
    shake: float = 1.0,
) -> Row:
    return (MOVE, target, move_s, hold_s, 0.0, low, high, reaction_s, float(chained), shake)


def _limits(rig: RigParameters, generator: Generator) -> tuple[float, float]:
    """Choose the two positions at which the operator means to reverse; now and then, these are the end stops."""
    stroke_m = rig.hydraulics.stroke_m
    if generator.random() < 0.08:
        return -1.0, 9.0
    return float(generator.uniform(0.1, 0.3) * stroke_m), float(generator.uniform(0.7, 0.9) * stroke_m)


def _stroke(rig: RigParameters, generator: Generator, direction: float) -> list[Row]:
    """Plan a stroke: a quick move with overshoot, then one or two corrections, each held for a while."""
    if generator.random() < 0.4:
        target = direction * generator.uniform(0.75, 1.0)
    else:
        target = lever_for_speed(rig, direction * math.exp(generator.uniform(math.log(0.008), math.log(0.07))))
        target *= float(np.clip(generator.normal(1.0, 0.04), 0.9, 1.1))
    low, high = _limits(rig, generator)
    reaction_s = generator.uniform(0.2, 0.4)
    overshoot = 1.0 + abs(generator.normal(0.0, 0.06))
    quick = float(np.clip(target * overshoot, -1.0, 1.0))
    rows = [_row(quick, generator.uniform(0.12, 0.5), generator.uniform(0.05, 0.3), low, high, reaction_s)]
    for _ in range(generator.integers(1, 3)):
        corrected = float(np.clip(target * generator.normal(1.0, 0.03), -1.0, 1.0))
        hold_s = generator.uniform(0.6, 3.0)
        rows.append(_row(corrected, generator.uniform(0.1, 0.3), hold_s, low, high, reaction_s, chained=True))
    return rows


def _inching(rig: RigParameters, generator: Generator, direction: float) -> list[Row]:
    """Plan short pulls at the lever with stops between them."""
    low, high = 0.15 * rig.hydraulics.stroke_m, 0.85 * rig.hydraulics.stroke_m
    rows: list[Row] = []
    for _ in range(generator.integers(2, 6)):
        lever = lever_for_speed(rig, direction * generator.uniform(0.008, 0.03))
        rows.append(_row(lever, generator.uniform(0.12, 0.2), generator.uniform(0.05, 0.25), low, high))
        rows.append(_row(0.0, generator.uniform(0.1, 0.2), generator.uniform(0.15, 0.6)))
    return rows

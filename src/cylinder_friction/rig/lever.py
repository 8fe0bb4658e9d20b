"""The operator's hand on the lever: moves, holds, corrections, tremor, and reversals near the ends of the stroke.

A duty cycle is a table of actions, made from a seed before the simulation. The compiled ``hand_step`` runs inside the
simulation, because a person reverses when the piston nears an end, after a reaction time, and so closes the loop on the
position. The lever ranges from -1 (retract) to 1 (extend).
"""

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.random import Generator
from scipy import signal

from cylinder_friction.arrays import Array

TICK_S = 0.001  # Sample time of the hand [s]; between two ticks the lever moves linearly

KIND, TARGET, MOVE_S, HOLD_S, FREQUENCY_HZ, LOW_M, HIGH_M, REACTION_S, CHAINED, SHAKE = range(10)
"""Columns of the table of actions; ``SHAKE`` is 1 for a free hand, less for one that rests on a stop."""
MOVE, RAMP, SINE, APPROACH = 0.0, 1.0, 2.0, 3.0
"""Kinds of actions: a minimum-jerk move to a target, a straight ramp, a sine in the middle of the stroke, and a move
that is skipped if the piston is there already. A move or ramp beyond its limits goes in the other direction instead."""

ROW, TIME_S, START, BASE, SIGN, NOTICED_S = range(6)
"""Entries of the hand's state: the current row, the time in it, the lever at its start, the intended lever, the sign,
and the time since the hand noticed that the piston must reverse (below 0: not yet)."""

RELEASED = 0.02  # Lever below which the hand lets go: the spring centres it, without tremor


@dataclass(frozen=True)
class DutyCycle:
    """The operator's intended actions, and the hand's remnant."""

    actions: Array  # Shape ``(rows, 10)``, columns as ``KIND`` ... ``SHAKE``
    remnant: Array  # Shape ``(ticks,)``: unintended motion of the hand, at full lever


@numba.njit(cache=True)
def new_hand() -> Any:
    """Make the hand's state before the first tick."""
    hand = np.zeros(6)
    hand[SIGN] = 1.0
    hand[NOTICED_S] = -1.0
    return hand


@numba.njit(cache=True)
def hand_step(hand: Any, actions: Any, remnant: float, position_m: float, overlap: float, middle_m: float) -> float:
    """Move the lever by one tick; updates ``hand``."""
    row = actions[int(hand[ROW])]
    if hand[TIME_S] == 0.0 and row[CHAINED] == 0.0:
        hand[SIGN] = 1.0
        beyond = (row[TARGET] > 0.0 and position_m > row[HIGH_M]) or (row[TARGET] < 0.0 and position_m < row[LOW_M])
        if beyond and row[KIND] == APPROACH:
            hand[NOTICED_S] = row[REACTION_S]
        elif beyond and row[KIND] != SINE:
            hand[SIGN] = -1.0
    hand[TIME_S] += TICK_S
    hand[BASE] = _intended(hand, row, position_m, middle_m)
    _notice(hand, row, position_m, overlap)
    reverse = hand[NOTICED_S] >= row[REACTION_S]
    if reverse or hand[TIME_S] >= row[MOVE_S] + row[HOLD_S]:
        _next_row(hand, actions, reverse)
    grip = row[SHAKE] * min(max((abs(hand[BASE]) - RELEASED) / 0.1, 0.0), 1.0)
    return min(max(hand[BASE] + grip * remnant, -1.0), 1.0)


@numba.njit(cache=True)
def _intended(hand: Any, row: Any, position_m: float, middle_m: float) -> float:
    """Compute the lever position that the present action intends."""
    time_s = hand[TIME_S]
    if row[KIND] == SINE:
        grown = min(time_s / 0.5, 1.0, max((row[MOVE_S] + row[HOLD_S] - time_s) / 0.5, 0.0))
        wave = math.sin(2.0 * math.pi * row[FREQUENCY_HZ] * time_s)
        return row[TARGET] * grown * (wave - 0.5 * min(max((position_m - middle_m) / 0.05, -1.0), 1.0))
    part = min(time_s / row[MOVE_S], 1.0)
    if row[KIND] != RAMP:
        # Minimum jerk (Flash and Hogan, 1985).
        part = part * part * part * (10.0 + part * (6.0 * part - 15.0))
    return hand[START] + (hand[SIGN] * row[TARGET] - hand[START]) * part


@numba.njit(cache=True)
def _notice(hand: Any, row: Any, position_m: float, overlap: float) -> None:
    if row[KIND] == SINE:
        return
    intended = hand[SIGN] * row[TARGET]
    out = intended > 0.0 and hand[BASE] > overlap
    back = intended < 0.0 and hand[BASE] < -overlap
    near = (out and position_m > row[HIGH_M]) or (back and position_m < row[LOW_M])
    if hand[NOTICED_S] >= 0.0:
        hand[NOTICED_S] += TICK_S
    elif near:
        hand[NOTICED_S] = 0.0


@numba.njit(cache=True)
def _next_row(hand: Any, actions: Any, reverse: bool) -> None:
    """Continue with the next action; a reversal skips the corrections that belong to this one."""
    row = (int(hand[ROW]) + 1) % len(actions)
    while reverse and actions[row, CHAINED] != 0.0:
        row = (row + 1) % len(actions)
    hand[ROW] = row
    hand[TIME_S] = 0.0
    hand[START] = hand[BASE]
    hand[NOTICED_S] = -1.0


def hand_remnant(generator: Generator, duration_s: float) -> Array:
    """Compute the hand's unintended motion, one value per tick: drift of about 1 %, tremor of 8 to 12 Hz and 0.5 %."""
    ticks = round(duration_s / TICK_S) + 2
    drift = ornstein_uhlenbeck(generator, ticks, TICK_S, 1.5, 0.01)
    frequency_hz = np.clip(10.0 + ornstein_uhlenbeck(generator, ticks, TICK_S, 0.5, 1.0), 8.0, 12.0)
    size = 0.005 * np.abs(1.0 + ornstein_uhlenbeck(generator, ticks, TICK_S, 0.3, 0.5))
    return np.asarray(drift + size * np.sin(2.0 * np.pi * TICK_S * np.cumsum(frequency_hz)))


def ornstein_uhlenbeck(
    generator: Generator, count: int, step_s: float, time_constant_s: float, deviation: float
) -> Array:
    """Compute a stationary Ornstein-Uhlenbeck process of this standard deviation, shape ``(count,)``."""
    keep = math.exp(-step_s / time_constant_s)
    shocks = generator.normal(0.0, deviation * math.sqrt(1.0 - keep * keep), count)
    shocks[0] = generator.normal(0.0, deviation)
    return np.asarray(signal.lfilter([1.0], [1.0, -keep], shocks))

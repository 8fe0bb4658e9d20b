"""What is measured in a run of the loop: tracking error, settling, limit cycles, work of the valve."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from friction_benchmark.in_the_loop.closed_loop import POSITION, REFERENCE, SPOOL
from friction_benchmark.in_the_loop.courses import MICRO_STEP_M, WARM_UP_S
from friction_benchmark.servo_rig.dynamics import TICK_S

AFTER_REVERSAL_S = 0.3  # What counts as at a reversal or start, and as the transient before a search for cycles
SETTLED_M = 1.5e-5  # Three steps of the position sensor
LEAST_SWING_M = 1e-5  # Smaller swings are no limit cycle: two steps of the position sensor
LEAST_SWINGS = 4  # Of a limit cycle
LASTING = 0.6  # Swings of its second half are at least this share of those of its first
IRREGULAR = 0.35  # Its periods scatter by at most this share of their mean


class Measures(NamedTuple):
    """Measures of one run; lengths in micrometres."""

    rms_um: float
    reversal_um: float  # RMS within 0.3 s of a start or reversal of the reference
    steady_um: float  # RMS of the rest
    settling_s: float  # Mean time until a micro-step stays within 15 µm; the whole hold if it never does; NaN without
    cycles: int  # Stretches of constant reference speed that hold a limit cycle
    cycle_um: float  # Largest amplitude of them
    valve_percent_s: float  # Travel of the spool, in percent of its range from closed to open, per second


def measure(trace: Array) -> Measures:
    """Return the measures of a trace, without its warm-up."""
    scored = trace[round(WARM_UP_S / TICK_S) :]
    reference_m, error_m = scored[:, REFERENCE], scored[:, REFERENCE] - scored[:, POSITION]
    speed = np.diff(reference_m, append=reference_m[-1]) / TICK_S
    steps = np.flatnonzero(np.abs(speed) > 0.9 * MICRO_STEP_M / TICK_S) + 1
    turned = reversals(speed)
    found = [limit_cycle(error_m[part]) for part in constant_stretches(speed)]
    cycles_um = [1e6 * cycle[0] for cycle in found if cycle is not None]
    whole, at_reversals, steady = (1e6 * _rms(part) for part in (error_m, error_m[turned], error_m[~turned]))
    settling = settling_s(error_m, steps) if len(steps) else math.nan
    valve = 100.0 * float(np.abs(np.diff(scored[:, SPOOL])).mean()) / TICK_S
    return Measures(whole, at_reversals, steady, settling, len(cycles_um), max(cycles_um, default=0.0), valve)


def reversals(speed_m_s: Array) -> Mask:
    """Return which rows are at most 0.3 s after the reference has started or turned."""
    direction, count = np.sign(np.round(speed_m_s, 9)), round(AFTER_REVERSAL_S / TICK_S)
    starts = (direction != 0.0) & (np.diff(direction, prepend=0.0) != 0.0)
    return np.asarray(np.convolve(starts, np.ones(count))[: len(starts)] > 0.5)


def constant_stretches(speed_m_s: Array) -> list[slice]:
    """Return the stretches of constant speed, 1 s or longer, each without its first 0.3 s."""
    edges = np.flatnonzero(np.abs(np.diff(speed_m_s, prepend=np.inf, append=np.inf)) > 1e-6)
    skipped, least = round(AFTER_REVERSAL_S / TICK_S), round(1.0 / TICK_S) - 1
    return [slice(a + skipped, b) for a, b in pairwise(edges) if b - a >= least]


def settling_s(error_m: Array, steps: NDArray[np.int64]) -> float:
    """Return the mean time from each step to the last row outside ``SETTLED_M`` before the next step [s]."""
    outside = [np.flatnonzero(np.abs(part) > SETTLED_M) for part in np.split(error_m, steps)[1:]]
    return TICK_S * float(np.mean([rows[-1] + 1 if len(rows) else 0 for rows in outside]))


def limit_cycle(error_m: Array) -> tuple[float, float] | None:
    """Return amplitude [m] and period [s] of a limit cycle, or None.

    It swings by 10 µm or more at least four times, evenly, does not die away, and goes on to the end.
    """
    turns = turning_points(error_m, LEAST_SWING_M)
    swings, periods = np.abs(np.diff(error_m[turns])), turns[2:] - turns[:-2]
    if len(swings) < LEAST_SWINGS:
        return None
    middle = len(swings) // 2
    dies = np.median(swings[middle:]) < LASTING * np.median(swings[:middle])
    uneven = periods.std() > IRREGULAR * periods.mean()
    ended = len(error_m) - turns[-1] > periods.max()
    return None if dies or uneven or ended else (0.5 * float(np.median(swings)), TICK_S * float(periods.mean()))


def turning_points(values: Array, least: float) -> NDArray[np.int64]:
    """Return the rows of extremes, each followed by a way back of at least ``least``."""
    rows, extreme, direction = [], 0, 0
    for row, value in enumerate(values.tolist()):
        beyond = value - values[extreme]
        if direction * beyond > 0.0 or (direction == 0 and abs(beyond) >= least):
            direction, extreme = (direction or int(np.sign(beyond))), row
        elif direction * beyond <= -least and direction:
            rows.append(extreme)
            direction, extreme = -direction, row
    return np.array(rows, dtype=np.int64)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))

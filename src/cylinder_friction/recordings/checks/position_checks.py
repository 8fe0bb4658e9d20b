"""Where a position cannot be right: it jumps, is held or disturbed, or moves although no force pushes it.

A piston has mass: from one sample to the next its velocity changes little. If it changes more, the sensor is at fault.

A piston slides only if the force F, less the load L, pushes it in the direction of its motion, and rests only if
friction, little more than the sliding one b, can hold it. Load and friction come from the recording itself, fitted over
rows of clear motion with least absolute residuals, so that a fault in some of them counts little:

    F = b·sign(v) + a0 + a1·x + a2·x² + a3·x³ + c·(positions of other cylinders)
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask, sliding_extremes, sliding_mean, true_runs
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding
from cylinder_friction.recordings.checks.plausibility import ClearMotion, powers, solve_normal_equations
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    LOAD_FORCE,
    OTHER_POSITIONS,
    POSITION,
    PRESSURE_1,
    PRESSURE_2,
    TIME,
)

NOISE, STROKES = 12.0, 2e-3
"""A second difference is a fault above this multiple of the usual one, and above this share of the stroke."""
TOGETHER_S = 0.3  # Faults closer to each other than this are one [s]
SMALL, SLIGHT = 0.01, 0.05
"""A jump, and a disturbance, of less than these shares of the stroke are noted: a stick-slip or impact may look so."""
LINE_S = 0.1  # A jump's height is measured between straight lines over this time on either side [s]
FEWEST_HELD, MOST_SINGLE = 5, 3
"""This many equal values before a jump are a held value; a single sample that is off bends this many rows at most."""
STILL_S, ALIVE_S = 1.0, 2.0
"""A value without any noise for this long is held, if the sensor has noise elsewhere for this long in all [s]."""
UP_AND_DOWN, CHANGES = 0.25, 0.95
"""With noise, this share of the steps goes up, as many go down, and this share is not zero."""
ALTERNATES, QUIETEST = 0.6, 0.1
"""White noise changes the sign of its fourth difference at 80 % of the samples. Noise is usual as in the quietest
tenth of the stretches that have any."""
NOISIER, FAINT = 20.0, 1e-3
"""A stretch is noisy above this multiple of that, if its fourth differences exceed this share of the stroke."""
RANGE_END_SHARE = 0.01  # This close to an end of the stroke, a position may be the end of its sensor's range

CHECK = "position_against_force"
WINDOW_S = 0.5  # Positions are means over this time; of the force, the value nearest to friction within it counts [s]
SLIDES, DEVIATIONS = 0.02, 5.0
"""A piston slides if it is faster than this share of its usual top speed, and than this multiple of the speed that the
position's noise shows at standstill."""
PUSHES, LEAST_S, LEAST_TRAVEL = 0.1, 0.5, 0.005
"""Sliding needs at least this share of friction. Inertia carries the piston for less time [s] or less of the stroke."""
HOLDS, SURGE_S = 2.0, 1.0
"""At rest the force is at most this multiple of friction. A surge of pressure is over within this time [s]."""
STOP_SHARE = 0.05  # Within this share of the stroke from an end, a stop may hold the piston
GREATEST_RESIDUAL = 0.5  # With a greater median residual, over friction, position does not explain the force
FEWEST_ROWS = 20  # Of clear motion in either direction
LEAST_VARIATION_M = 1e-3  # Another cylinder that moves less does not count
REACH_M = 0.01  # Distance from clear motion within which the load is known [m]

_ITERATIONS, _SETTLED, _LEAST_RESIDUAL = 10, 1e-3, 1e-2
_ROWS = 1024  # Of clear motion, spread evenly, that the fit takes: it has a handful of terms


def check_position_against_force(columns: Mapping[str, Array], motion: ClearMotion, limits: CheckLimits) -> Finding:
    """Return the finding ``position_against_force``, noted with the times if they contradict each other.

    ``columns`` are those of a uniformly sampled recording in SI units, without NaN; ``motion`` is its clear motion.
    """
    time_s, position_m = columns[TIME], columns[POSITION]
    force_n = _driving_force(columns, limits)
    friction_n, load_n, residual_n, known = 0.0, np.zeros(1), 0.0, np.zeros(1, dtype=np.bool_)
    if force_n is not None and min(np.count_nonzero(motion.direction == each) for each in (-1.0, 1.0)) >= FEWEST_ROWS:
        positions_m = np.column_stack([position_m, *(columns[name] for name in OTHER_POSITIONS if name in columns)])
        velocity_m_s = np.gradient(sliding_mean(position_m, 3), time_s)
        friction_n, load_n, residual_n = _fit(force_n, positions_m, velocity_m_s, motion)
        lowest_m, highest_m = (end(positions_m[motion.rows], axis=0) for end in (np.min, np.max))
        known = ((positions_m > lowest_m - REACH_M) & (positions_m < highest_m + REACH_M)).all(axis=1)
        known &= np.abs(position_m / limits.stroke_m - 0.5) < 0.5 - STOP_SHARE
    if force_n is None or friction_n <= 0.0 or residual_n > GREATEST_RESIDUAL * friction_n:
        return Finding(CHECK, "ok", "whether position and force contradict each other cannot be decided")
    pushed = (force_n - load_n) / friction_n
    found = sorted(_contradictions(pushed, position_m, time_s, known, motion.rows, LEAST_TRAVEL * limits.stroke_m))
    if not found:
        return Finding(CHECK, "ok", "position and force do not contradict each other")
    more = f" (first of {len(found)}, the last ends at {time_s[found[-1][1] - 1]:.2f} s)" if len(found) > 1 else ""
    text = (
        f"position_m {found[0][2]}{more}; friction is wrong there: check the position sensor and what it is fixed to, "
        "then both pressures and whether the load is the same throughout, and leave this time out"
    )
    return Finding(CHECK, "noted", text)


def _driving_force(columns: Mapping[str, Array], limits: CheckLimits) -> Array | None:
    """Return what drives the piston less a measured load, shape ``(n,)`` [N]; None if that is not known."""
    load_n = columns.get(LOAD_FORCE, 0.0) if limits.load == "measured" else 0.0
    if DRIVE_FORCE in columns:
        return columns[DRIVE_FORCE] - load_n
    if limits.areas_m2 is None:
        return None
    a1, a2 = limits.areas_m2
    return columns[PRESSURE_1] * a1 - columns[PRESSURE_2] * a2 - load_n


def _contradictions(
    pushed: Array, position_m: Array, time_s: Array, known: Mask, rows: NDArray[np.int64], least_m: float
) -> list[tuple[int, int, str]]:
    """Return first row, the one behind the last, and words of each contradiction if the load is ``known``.

    ``pushed`` is the force less the load over friction; a motion counts from ``least_m`` on.
    """
    step_s = float(time_s[1] - time_s[0])
    window = max(3, round(WINDOW_S / step_s))
    mean_m, (lowest, highest) = sliding_mean(position_m, window), sliding_extremes(pushed, window)
    speed_m_s = np.gradient(mean_m, step_s)
    noise_m = float(np.median(np.abs(np.diff(position_m, 2)))) / 1.65  # as of white noise
    top_m_s = float(np.quantile(np.abs(speed_m_s[rows]), 0.95))
    slides_m_s = max(SLIDES * top_m_s, DEVIATIONS * noise_m / WINDOW_S)
    found = []
    for way, speeds_m_s, most in (("extends", speed_m_s, highest), ("retracts", -speed_m_s, -lowest)):
        for begin, end in _longer(known & (speeds_m_s > slides_m_s) & (most < PUSHES), LEAST_S / step_s):
            moved_m = abs(mean_m[end - 1] - mean_m[begin])
            words = f"{way} by {1e3 * moved_m:.3g} mm {_when(time_s, begin, end)} although the force does not push it"
            if moved_m > least_m:
                found.append((begin, end, words))
    least = np.maximum(lowest, -highest)
    for begin, end in _longer(known & (np.abs(speed_m_s) <= slides_m_s) & (least > HOLDS), SURGE_S / step_s):
        times = float(np.median(least[begin:end]))
        words = (
            f"rests {_when(time_s, begin, end)} although the force is {times:.3g} times friction and no end stop near"
        )
        found.append((begin, end, words))
    return found


def _when(time_s: Array, begin: int, end: int) -> str:
    return f"from {time_s[begin]:.2f} to {time_s[end - 1]:.2f} s"


def _fit(drive_n: Array, positions_m: Array, velocity_m_s: Array, motion: ClearMotion) -> tuple[float, Array, float]:
    """Return dry friction [N], the load at every row, shape ``(n,)`` [N], and the median absolute residual [N].

    What grows with the square of speed and exceeds dry friction, as lines lose pressure, is neither.
    """
    spread = slice(None, None, -(-len(motion.rows) // _ROWS))
    rows, direction = motion.rows[spread], motion.direction[spread]
    varied = np.std(positions_m[rows], axis=0)
    used = np.append(True, varied[1:] > LEAST_VARIATION_M)
    scaled = ((positions_m - positions_m[rows].mean(axis=0)) / np.maximum(varied, 1e-12))[:, used]
    load = np.column_stack([powers(np.clip(scaled[:, 0], -3.0, 3.0)), scaled[:, 1:]])
    square = velocity_m_s[rows] * np.abs(velocity_m_s[rows])
    square = square / max(float(np.abs(square).max()), 1e-12)
    terms, force_n = np.column_stack([direction, load[rows]]), drive_n[rows]
    factors, residual_n = _least_absolute(np.column_stack([terms, square]), force_n)
    if not factors[-1] > factors[0] > 0.0:
        factors, residual_n = _least_absolute(terms, force_n)
    return float(factors[0]), load @ factors[1 : terms.shape[1]], residual_n


def _least_absolute(terms: Array, force_n: Array) -> tuple[Array, float]:
    """Return the factors with about the least absolute residual, and the median of that [N]."""
    weights, factors = np.ones(len(terms)), np.zeros(terms.shape[1])
    for _ in range(_ITERATIONS):
        weighted = terms * weights[:, None]
        before, factors = factors, solve_normal_equations(weighted.T @ terms, weighted.T @ force_n)
        if np.abs(factors - before).max() <= _SETTLED * np.abs(factors[0]):
            break
        off_n = np.abs(force_n - terms @ factors)
        weights = 1.0 / np.maximum(off_n, _LEAST_RESIDUAL * float(np.median(off_n)) + 1e-9)
    return factors, float(np.median(off_n))


def _longer(where: Mask, least: float) -> list[tuple[int, int]]:
    """Return the runs of true rows that are longer than ``least``, as ``true_runs`` does."""
    return [(begin, end) for begin, end in true_runs(where).tolist() if end - begin > least]


def check_position_steps(position_m: Array, time_s: Array, stroke_m: float) -> Finding:
    """Return the finding ``position_steps``: refused at a jump, a held value or a disturbance.

    Small jumps and disturbances, single samples that are off, and a value without the noise that the sensor has
    elsewhere, are noted.

    Args:
        position_m, time_s: Of a uniformly sampled recording, shape ``(n,)``.
        stroke_m: Of the cylinder [m].
    """
    step_s = float(time_s[1] - time_s[0])
    bend_m = np.abs(np.diff(position_m, 2))
    usual_m = float(np.quantile(bend_m[:: max(1, len(bend_m) // 4096)], 0.95))
    found = np.flatnonzero(bend_m > max(NOISE * usual_m, STROKES * stroke_m)) + 1
    groups = np.split(found, np.flatnonzero(np.diff(found) * step_s > TOGETHER_S) + 1) if len(found) else []
    words = [(int(each[0]), *_words(position_m, time_s, int(each[0]), int(each[-1]), stroke_m)) for each in groups]
    faults = [(row, what) for row, what, small in words if what and not small]
    jumps = [(row, what) for row, what, small in words if what and small]
    more = f" (first of {len(faults or jumps)} such faults)" if len(faults or jumps) > 1 else ""
    if faults:
        row, what = faults[0]
        text = f"position_m {what}, in row {row + 1}{more}; check the sensor and its cable, and cut the log there"
        return Finding("position_steps", "refused", text)
    if jumps:
        row, what = jumps[0]
        text = f"position_m {what}, in row {row + 1}{more}; velocity and friction are wrong there"
        return Finding("position_steps", "noted", text)
    if words:
        text = (
            f"position_m has {len(words)} single samples that no piston can follow (first: row {words[0][0] + 1}, at "
            f"{time_s[words[0][0]]:.2f} s); check the sensor and its cable"
        )
        return Finding("position_steps", "noted", text)
    noisy = _noisy(position_m, time_s, max(16, round(WINDOW_S / step_s)), stroke_m)
    return noisy or _still(position_m, time_s, max(2, round(STILL_S / step_s)), stroke_m)


def _noisy(x_m: Array, time_s: Array, rows: int, stroke_m: float) -> Finding | None:
    """Note stretches of ``rows`` with far more noise than the quietest; None if there are none.

    Fourth differences leave little of a motion; those of noise change their sign at most samples.
    """
    change_m = np.diff(x_m, 4)
    stretches_m = change_m[: len(change_m) // rows * rows].reshape(-1, rows)
    level_m = np.median(np.abs(stretches_m), axis=1)
    alive = (stretches_m[:, 1:] * stretches_m[:, :-1] < 0.0).mean(axis=1) > ALTERNATES
    if np.count_nonzero(alive) * rows < ALIVE_S / (time_s[1] - time_s[0]):
        return None
    usual_m = float(np.quantile(level_m[alive], QUIETEST))
    noisy = np.flatnonzero(alive & (level_m > max(NOISIER * usual_m, FAINT * stroke_m)))
    if len(noisy) * rows < STILL_S / (time_s[1] - time_s[0]):
        return None
    begin, end = time_s[noisy[0] * rows], time_s[min((noisy[-1] + 1) * rows, len(time_s) - 1)]
    times = float(np.median(level_m[noisy])) / usual_m
    text = (
        f"position_m has {times:.2g} times its usual noise between {begin:.2f} and {end:.2f} s; velocity and friction "
        "are wrong there; check the sensor and its cable, and leave this time out"
    )
    return Finding("position_steps", "noted", text)


def _words(x_m: Array, time_s: Array, first: int, last: int, stroke_m: float) -> tuple[str, bool]:
    """Describe the fault whose second differences run from row ``first`` to ``last``, and whether it is small.

    The words are empty for a single sample.
    """
    held = first
    while held > 0 and x_m[held - 1] == x_m[first]:
        held -= 1
    if first - held >= FEWEST_HELD and x_m[min(last + 1, len(x_m) - 1)] != x_m[first]:
        when = f"from {time_s[held]:.2f} to {time_s[first]:.2f} s"
        return f"holds {1e3 * x_m[first]:.4g} mm {when} while the piston moves on", False
    if last - first > MOST_SINGLE:
        ends = [max(first - 1, 0), min(last + 1, len(x_m) - 1)]
        off_m = x_m[slice(*ends)] - np.interp(np.arange(*ends), ends, x_m[ends])
        return f"is disturbed from {time_s[first]:.2f} to {time_s[last]:.2f} s", bool(
            np.abs(off_m).max() < SLIGHT * stroke_m
        )
    height_m = _height(x_m, first, last, max(3, round(LINE_S / float(time_s[1] - time_s[0]))))
    if abs(height_m) > 0.5 * STROKES * stroke_m:
        text = f"jumps by {1e3 * height_m:+.3g} mm at {time_s[first]:.2f} s, and on one side it is wrong by as much"
        return text, abs(height_m) < SMALL * stroke_m
    return "", False


def _height(x_m: Array, first: int, last: int, line: int) -> float:
    """Return how much higher the line behind a fault is than the line before it, in the middle between them [m]."""
    rows, middle = np.arange(len(x_m)), 0.5 * (first + last)
    sides = slice(max(0, first - line), first), slice(last + 1, last + 1 + line)
    if min(len(x_m[side]) for side in sides) < 2:
        return 0.0
    before_m, behind_m = (float(np.polyval(np.polyfit(rows[side] - middle, x_m[side], 1), 0.0)) for side in sides)
    return behind_m - before_m


def _still(x_m: Array, time_s: Array, rows: int, stroke_m: float) -> Finding:
    """Note if the position is exactly the same for ``rows`` or more, although it has noise elsewhere, also at rest.

    Noise goes up and down at almost every sample; steps of a converter do not, nor does a motion.
    """
    steps_m = np.diff(x_m)
    stretches_m = steps_m[: len(steps_m) // rows * rows].reshape(-1, rows)
    up, down = (stretches_m > 0.0).mean(axis=1), (stretches_m < 0.0).mean(axis=1)
    alive = (np.minimum(up, down) >= UP_AND_DOWN) & (up + down >= CHANGES)
    if np.count_nonzero(alive) * STILL_S >= ALIVE_S:
        for begin, end in true_runs(steps_m == 0.0).tolist():
            if end - begin >= rows and RANGE_END_SHARE * stroke_m < x_m[begin] < (1.0 - RANGE_END_SHARE) * stroke_m:
                text = (
                    f"position_m holds {1e3 * x_m[begin]:.4g} mm from {time_s[begin]:.2f} to {time_s[end]:.2f} s "
                    "without the noise that it has elsewhere; check the sensor, and leave this time out"
                )
                return Finding("position_steps", "noted", text)
    return Finding("position_steps", "ok", "position_m never jumps, and holds no value while the piston moves")

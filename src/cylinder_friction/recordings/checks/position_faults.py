"""Where a position sensor cannot be right: it jumps, holds its value while the piston moves on, or is disturbed.

A piston has mass: from one sample to the next its velocity changes little. What changes more is the sensor's doing. It
becomes missing samples, so that what lies on either side is used. ``screening`` takes single spikes out before.
``position_against_force`` looks for what is smooth, and so shows in the force alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cylinder_friction.arrays import Array, true_runs
from cylinder_friction.recordings.columns import POSITION
from cylinder_friction.recordings.recording import Signal

NOISE, STROKES = 12.0, 2e-3
"""A second difference is a fault from so many times the usual one, and from this share of the stroke."""
TOGETHER_S = 0.3
"""Faults closer to each other than this are one."""
LINE_S = 0.1
"""A jump's height is that between straight lines over this long on either side."""
FEWEST_HELD, FEWEST_LOST = 5, 3
"""So many equal values before a jump are a held value; a jump loses so many samples, which splits the recording."""
OFF_SHARE = 0.5
"""Without single samples those around them bend by at most this share of what the single ones are off by."""
STILL_S, ALIVE_S = 1.0, 2.0
"""A value without any noise for this long is held, if the sensor has noise elsewhere for this long altogether,"""
UP_AND_DOWN, CHANGES = 0.25, 0.95
"""which is where this share of the steps goes up, as much down, and this share is not zero."""
END_SHARE = 0.01
"""So close to an end of the stroke a position may be the end of its sensor's range."""
MOST_SINGLE, MOST_SENTENCES = 2, 5
"""At most so many samples between others that fit each other are lost by themselves; so many faults are named."""


@dataclass(frozen=True)
class PositionFault:
    """One fault of a position sensor."""

    # First row that is not to be used, and the one behind the last
    begin: int
    end: int
    words: str  # What it is, with times; empty for single samples


def without_position_faults(signals: dict[str, Signal], stroke_m: float) -> tuple[dict[str, Signal], tuple[str, ...]]:
    """Return the signals without the rows at which the position is faulty, and sentences on the faults."""
    signal = signals.get(POSITION)
    if signal is None:
        return signals, ()
    faults = position_faults(signal.values, signal.time_s, stroke_m)
    if not faults:
        return signals, ()
    values = signal.values.copy()
    for fault in faults:
        values[fault.begin : fault.end] = np.nan
    changed: Mapping[str, Signal] = {POSITION: replace(signal, values=values)}
    return signals | dict(changed), _sentences(faults, signal.time_s)


def _sentences(faults: list[PositionFault], time_s: Array) -> tuple[str, ...]:
    """Return one sentence on each of the first faults, one on those after them, and one on all single samples."""
    named, single = [each for each in faults if each.words], [each for each in faults if not each.words]
    words = [each.words for each in named[:MOST_SENTENCES]]
    if more := named[MOST_SENTENCES:]:
        words.append(f"{POSITION}: {len(more)} more faults, the last at {time_s[more[-1].begin]:.2f} s; left out")
    if single:
        rows, first_s = sum(each.end - each.begin for each in single), time_s[single[0].begin]
        words.append(f"{POSITION}: {rows} single samples that no piston can follow left out (first at {first_s:.2f} s)")
    return tuple(words)


def position_faults(position_m: Array, time_s: Array, stroke_m: float) -> list[PositionFault]:
    """Return the faults of a position in order of time; missing samples are skipped.

    Args:
        position_m, time_s: As logged, shape ``(n,)``.
        stroke_m: Of the cylinder [m].
    """
    rows = np.flatnonzero(np.isfinite(position_m) & np.isfinite(time_s))
    if len(rows) < 4 * FEWEST_HELD:
        return []
    x_m, at_s = (position_m, time_s) if len(rows) == len(time_s) else (position_m[rows], time_s[rows])
    steps_s = np.diff(at_s)
    step_s = float(np.median(steps_s))
    if step_s <= 0.0:  # a clock too coarse for velocities from one sample to the next
        return []
    even = np.abs(steps_s - step_s) < 0.5 * step_s
    bend_m = np.where(even[1:] & even[:-1], np.abs(x_m[2:] - 2.0 * x_m[1:-1] + x_m[:-2]), 0.0)
    usual_m = float(np.quantile(bend_m[:: max(1, len(bend_m) // 4096)], 0.95))
    most_m = max(NOISE * usual_m, STROKES * stroke_m)
    found = np.flatnonzero(bend_m > most_m) + 1
    groups = np.split(found, np.flatnonzero(np.diff(at_s[found]) > TOGETHER_S) + 1) if len(found) else []
    line = max(3, round(LINE_S / step_s))
    ends = [(int(group[0]), int(group[-1])) for group in groups]
    faults = [_single(x_m, *each, most_m) or _fault(x_m, at_s, *each, line, stroke_m) for each in ends]
    still = _still(x_m, at_s, max(2, round(STILL_S / step_s)), stroke_m)
    faults += [each for each in still if not any(one.begin < each.end and each.begin < one.end for one in faults)]
    faults.sort(key=lambda each: each.begin)
    return [replace(each, begin=int(rows[each.begin]), end=int(rows[each.end - 1]) + 1) for each in faults]


def _single(x_m: Array, first: int, last: int, most_m: float) -> PositionFault | None:
    """Return the one or two samples between ``first`` and ``last`` without which those around them fit each other."""
    for count in range(1, MOST_SINGLE + 1):
        begins = np.arange(max(2, last - count), min(first + 1, len(x_m) - count - 2) + 1)
        if last - first > count + 1 or not len(begins):
            continue
        before_m, behind_m = x_m[begins - 1], x_m[begins + count]
        across_m = (behind_m - before_m) / (count + 1)
        bend_m = np.maximum(
            np.abs(across_m - before_m + x_m[begins - 2]), np.abs(x_m[begins + count + 1] - behind_m - across_m)
        )
        best = int(np.argmin(bend_m))
        at = int(begins[best]) + np.arange(count)
        off_m = np.abs(x_m[at] - before_m[best] - across_m[best] * (1 + np.arange(count))).max()
        # Across a step half of it is left as a bend, however fast the piston: the sample is off by as much.
        if bend_m[best] <= min(most_m, OFF_SHARE * off_m):
            return PositionFault(int(begins[best]), int(begins[best]) + count, "")
    return None


def _fault(x_m: Array, at_s: Array, first: int, last: int, line: int, stroke_m: float) -> PositionFault:
    """Return the fault that second differences from row ``first`` to ``last`` show."""
    held = first
    while held > 0 and x_m[held - 1] == x_m[first]:
        held -= 1
    if first - held >= FEWEST_HELD and abs(x_m[last + 1 if last < len(x_m) - 1 else last] - x_m[first]) > 0.0:
        words = (
            f"holds {1e3 * x_m[first]:.4g} mm from {at_s[held]:.2f} to {at_s[first]:.2f} s while the piston moves on"
        )
        return PositionFault(held + 1, max(last, first + 1), f"{POSITION} {words}; left out")
    height_m = _height(x_m, at_s, first, last, line)
    if last - first <= FEWEST_LOST and abs(height_m) > 0.5 * STROKES * stroke_m:
        words = (
            f"{POSITION} jumps by {1e3 * height_m:+.3g} mm at {at_s[first]:.2f} s; split there, and on one side it is "
            "wrong by as much: check the sensor and whether it was exchanged"
        )
        return PositionFault(first, min(first + FEWEST_LOST, len(x_m)), words)
    words = f"{POSITION} is disturbed from {at_s[first]:.2f} to {at_s[last]:.2f} s; left out"
    return PositionFault(first, max(last + 1, min(first + FEWEST_LOST, len(x_m))), words)


def _still(x_m: Array, at_s: Array, rows: int, stroke_m: float) -> list[PositionFault]:
    """Return where the position is exactly the same for ``rows`` or more, though it has noise elsewhere, also at rest.

    Noise goes up and down at almost every sample; steps of a converter do not, nor does a motion. At either end of the
    stroke a sensor may be at the end of its range, where nothing of its noise is left.
    """
    steps_m = np.diff(x_m)
    stretches_m = steps_m[: len(steps_m) // rows * rows].reshape(-1, rows)
    up, down = (stretches_m > 0.0).mean(axis=1), (stretches_m < 0.0).mean(axis=1)
    alive = (np.minimum(up, down) >= UP_AND_DOWN) & (up + down >= CHANGES)
    if np.count_nonzero(alive) * STILL_S < ALIVE_S:
        return []
    return [
        PositionFault(
            begin + 1,
            end + 1,
            f"{POSITION} holds {1e3 * x_m[begin]:.4g} mm from {at_s[begin]:.2f} to {at_s[end]:.2f} s without the noise "
            "that it has elsewhere; left out",
        )
        for begin, end in true_runs(steps_m == 0.0).tolist()
        if end - begin >= rows and END_SHARE * stroke_m < x_m[begin] < (1.0 - END_SHARE) * stroke_m
    ]


def _height(x_m: Array, at_s: Array, first: int, last: int, line: int) -> float:
    """Return how much higher the line behind a fault is than that before it, in its middle [m]."""
    middle_s = 0.5 * (at_s[first] + at_s[last])
    sides = slice(max(0, first - line), first), slice(last + 1, last + 1 + line)
    levels = []
    for side in sides:
        if len(x_m[side]) < 2:
            return 0.0
        levels.append(float(np.polyval(np.polyfit(at_s[side] - middle_s, x_m[side], 1), 0.0)))
    return levels[1] - levels[0]

"""Where a position sensor cannot be right: it jumps, holds its value while the piston moves on, or is disturbed.

A piston has mass: from one sample to the next its velocity changes little. If it changes more, the sensor is at fault.
Faults without a step show in the force alone, see ``position_against_force``.
"""

import numpy as np

from cylinder_friction.arrays import Array, true_runs
from cylinder_friction.recordings.checks.limits import Finding

NOISE, STROKES = 12.0, 2e-3
"""A second difference is a fault above this multiple of the usual one, and above this share of the stroke."""
TOGETHER_S = 0.3  # Faults closer to each other than this are one [s]
LINE_S = 0.1  # A jump's height is measured between straight lines over this time on either side [s]
FEWEST_HELD, MOST_SINGLE = 5, 3
"""This many equal values before a jump are a held value; a single sample that is off bends this many rows at most."""
STILL_S, ALIVE_S = 1.0, 2.0
"""A value without any noise for this long is held, if the sensor has noise elsewhere for this long in all [s]."""
UP_AND_DOWN, CHANGES = 0.25, 0.95
"""With noise, this share of the steps goes up, as many go down, and this share is not zero."""
END_SHARE = 0.01  # This close to an end of the stroke, a position may be the end of its sensor's range


def check_position_steps(position_m: Array, time_s: Array, stroke_m: float) -> Finding:
    """Return the finding ``position_steps``: refused at a jump, a held value or a disturbance.

    Single samples that are off, and a value without the noise that the sensor has elsewhere, are noted.

    Args:
        position_m, time_s: Of a uniformly sampled recording, shape ``(n,)``.
        stroke_m: Of the cylinder [m].
    """
    step_s = float(time_s[1] - time_s[0])
    bend_m = np.abs(np.diff(position_m, 2))
    usual_m = float(np.quantile(bend_m[:: max(1, len(bend_m) // 4096)], 0.95))
    found = np.flatnonzero(bend_m > max(NOISE * usual_m, STROKES * stroke_m)) + 1
    groups = np.split(found, np.flatnonzero(np.diff(found) * step_s > TOGETHER_S) + 1) if len(found) else []
    words = [(int(each[0]), _words(position_m, time_s, int(each[0]), int(each[-1]), stroke_m)) for each in groups]
    faults = [(row, what) for row, what in words if what]
    if faults:
        row, what = faults[0]
        more = f" (first of {len(faults)} such faults)" if len(faults) > 1 else ""
        text = f"position_m {what}, in row {row + 1}{more}; check the sensor and its cable, and cut the log there"
        return Finding("position_steps", "refused", text)
    if words:
        text = (
            f"position_m has {len(words)} single samples that no piston can follow (first: row {words[0][0] + 1}, at "
            f"{time_s[words[0][0]]:.2f} s); check the sensor and its cable"
        )
        return Finding("position_steps", "noted", text)
    return _still(position_m, time_s, max(2, round(STILL_S / step_s)), stroke_m)


def _words(x_m: Array, time_s: Array, first: int, last: int, stroke_m: float) -> str:
    """Describe the fault whose second differences run from row ``first`` to ``last``; empty for a single sample."""
    held = first
    while held > 0 and x_m[held - 1] == x_m[first]:
        held -= 1
    if first - held >= FEWEST_HELD and x_m[min(last + 1, len(x_m) - 1)] != x_m[first]:
        when = f"from {time_s[held]:.2f} to {time_s[first]:.2f} s"
        return f"holds {1e3 * x_m[first]:.4g} mm {when} while the piston moves on"
    if last - first > MOST_SINGLE:
        return f"is disturbed from {time_s[first]:.2f} to {time_s[last]:.2f} s"
    height_m = _height(x_m, first, last, max(3, round(LINE_S / float(time_s[1] - time_s[0]))))
    if abs(height_m) > 0.5 * STROKES * stroke_m:
        return f"jumps by {1e3 * height_m:+.3g} mm at {time_s[first]:.2f} s, and on one side it is wrong by as much"
    return ""


def _height(x_m: Array, first: int, last: int, line: int) -> float:
    """Return how much higher the line behind a fault is than the line before it, in the middle between them [m]."""
    rows, middle = np.arange(len(x_m)), 0.5 * (first + last)
    sides = slice(max(0, first - line), first), slice(last + 1, last + 1 + line)
    if min(len(x_m[side]) for side in sides) < 2:
        return 0.0
    before_m, behind_m = (float(np.polyval(np.polyfit(rows[side] - middle, x_m[side], 1), 0.0)) for side in sides)
    return behind_m - before_m


def _still(x_m: Array, time_s: Array, rows: int, stroke_m: float) -> Finding:
    """Note where the position is exactly the same for ``rows`` or more, although it has noise elsewhere, also at rest.

    Noise goes up and down at almost every sample; steps of a converter do not, nor does a motion.
    """
    steps_m = np.diff(x_m)
    stretches_m = steps_m[: len(steps_m) // rows * rows].reshape(-1, rows)
    up, down = (stretches_m > 0.0).mean(axis=1), (stretches_m < 0.0).mean(axis=1)
    alive = (np.minimum(up, down) >= UP_AND_DOWN) & (up + down >= CHANGES)
    if np.count_nonzero(alive) * STILL_S >= ALIVE_S:
        for begin, end in true_runs(steps_m == 0.0).tolist():
            if end - begin >= rows and END_SHARE * stroke_m < x_m[begin] < (1.0 - END_SHARE) * stroke_m:
                text = (
                    f"position_m holds {1e3 * x_m[begin]:.4g} mm from {time_s[begin]:.2f} to {time_s[end]:.2f} s "
                    "without the noise that it has elsewhere; check the sensor, and leave this time out"
                )
                return Finding("position_steps", "noted", text)
    return Finding("position_steps", "ok", "position_m never jumps, and holds no value while the piston moves")

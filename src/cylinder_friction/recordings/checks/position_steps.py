"""Find faults of a position signal: jumps, held values and disturbances.

A piston has mass, so that its velocity changes little between two samples. If it changes more, the sensor is faulty.
"""

import numpy as np

from cylinder_friction.arrays import Array, true_runs
from cylinder_friction.recordings.checks.limits import Finding, Outcome

CHECK = "position_steps"
NOISE, STROKES = 12.0, 2e-3
"""Limits above which a second difference is a fault: a multiple of the usual one, and a share of the stroke."""
TOGETHER_S = 0.3  # Longest time between faults that count as one [s]
SMALL, SLIGHT = 0.01, 0.05
"""Shares of the stroke below which a jump, and a disturbance, is only noted: stick-slip or an impact may look alike."""
LINE_S = 0.1  # Duration of the straight lines on either side between which a jump's height is measured [s]
FEWEST_HELD, MOST_SINGLE = 5, 3
"""Fewest equal values before a jump that are a held value; most rows whose second difference one bad sample affects."""
STILL_S, ALIVE_S = 1.0, 2.0
"""Shortest time without noise that is a held value, and least total time with noise elsewhere [s]."""
UP_AND_DOWN, CHANGES = 0.25, 0.95
"""Of a signal with noise: least share of steps up, and of steps down; least share of steps that are not zero."""
ALTERNATES, QUIETEST = 0.6, 0.1
"""Least share of samples at which noise changes the sign of the fourth difference (80 % for white noise); quantile of
the stretches with noise that gives the usual noise."""
NOISY_S, NOISIER, FAINT = 0.5, 20.0, 1e-3
"""Duration of a stretch [s]. It is noisy above this multiple of the usual noise, if its fourth differences exceed this
share of the stroke."""
RANGE_END_SHARE = 0.01  # Distance from an end of the stroke, as a share, within which the sensor's range may end


def check_position_steps(position_m: Array, time_s: Array, stroke_m: float) -> list[Finding]:
    """Refuse a position with a jump, a held value or a disturbance (finding ``position_steps``).

    Small jumps, slight disturbances, single bad samples, and a value without the noise that the sensor has elsewhere
    are only noted.

    Args:
        position_m, time_s: Columns of a uniformly sampled recording, shape ``(n,)``.
        stroke_m: Stroke of the cylinder [m].
    """
    step_s = float(time_s[1] - time_s[0])
    bend_m = np.abs(np.diff(position_m, 2))
    usual_m = float(np.quantile(bend_m[:: max(1, len(bend_m) // 4096)], 0.95))
    bent = np.flatnonzero(bend_m > max(NOISE * usual_m, STROKES * stroke_m)) + 1
    groups = np.split(bent, np.flatnonzero(np.diff(bent) * step_s > TOGETHER_S) + 1) if len(bent) else []
    found = [(int(each[0]), *_described(position_m, time_s, int(each[0]), int(each[-1]), stroke_m)) for each in groups]
    outcomes: tuple[tuple[Outcome, str], ...] = (
        ("refused", "check the sensor and its cable, and cut the log there"),
        ("noted", "velocity and friction are wrong there"),
    )
    for outcome, advice in outcomes:
        alike = [(row, words) for row, words, own in found if words and own == outcome]
        if alike:
            more = f" (first of {len(alike)} such faults)" if len(alike) > 1 else ""
            return [Finding(CHECK, outcome, f"position_m {alike[0][1]}, in row {alike[0][0] + 1}{more}; {advice}")]
    if found:
        text = (
            f"position_m has {len(found)} single samples that no piston can follow (first: row {found[0][0] + 1}, at "
            f"{time_s[found[0][0]]:.2f} s); check the sensor and its cable"
        )
    else:
        text = _noisy(position_m, time_s, max(16, round(NOISY_S / step_s)), stroke_m)
        text = text or _still(position_m, time_s, max(2, round(STILL_S / step_s)), stroke_m)
    return [Finding(CHECK, "noted", text)] if text else []


def _noisy(x_m: Array, time_s: Array, rows: int, stroke_m: float) -> str:
    """Name stretches of ``rows`` rows with far more noise than the quietest ones; empty if there are none.

    Fourth differences remove most of a motion. Those of noise change their sign at most samples.
    """
    change_m = np.diff(x_m, 4)
    stretches_m = change_m[: len(change_m) // rows * rows].reshape(-1, rows)
    level_m = np.median(np.abs(stretches_m), axis=1)
    alive = (stretches_m[:, 1:] * stretches_m[:, :-1] < 0.0).mean(axis=1) > ALTERNATES
    if np.count_nonzero(alive) * rows < ALIVE_S / (time_s[1] - time_s[0]):
        return ""
    usual_m = float(np.quantile(level_m[alive], QUIETEST))
    noisy = np.flatnonzero(alive & (level_m > max(NOISIER * usual_m, FAINT * stroke_m)))
    if len(noisy) * rows < STILL_S / (time_s[1] - time_s[0]):
        return ""
    begin, end = time_s[noisy[0] * rows], time_s[min((noisy[-1] + 1) * rows, len(time_s) - 1)]
    return (
        f"position_m has {float(np.median(level_m[noisy])) / usual_m:.2g} times its usual noise between {begin:.2f} "
        f"and {end:.2f} s; velocity and friction are wrong there; check the sensor and its cable, and leave this time "
        "out"
    )


def _described(x_m: Array, time_s: Array, first: int, last: int, stroke_m: float) -> tuple[str, Outcome]:
    """Describe the fault with second differences in rows ``first`` to ``last``; empty for a single bad sample."""
    held = first
    while held > 0 and x_m[held - 1] == x_m[first]:
        held -= 1
    if first - held >= FEWEST_HELD and x_m[min(last + 1, len(x_m) - 1)] != x_m[first]:
        when = f"from {time_s[held]:.2f} to {time_s[first]:.2f} s"
        return f"holds {1e3 * x_m[first]:.4g} mm {when} while the piston moves on", "refused"
    if last - first > MOST_SINGLE:
        ends = [max(first - 1, 0), min(last + 1, len(x_m) - 1)]
        off_m = float(np.abs(x_m[slice(*ends)] - np.interp(np.arange(*ends), ends, x_m[ends])).max())
        words = f"is disturbed from {time_s[first]:.2f} to {time_s[last]:.2f} s"
        return words, "noted" if off_m < SLIGHT * stroke_m else "refused"
    height_m = _height(x_m, first, last, max(3, round(LINE_S / float(time_s[1] - time_s[0]))))
    if abs(height_m) <= 0.5 * STROKES * stroke_m:
        return "", "noted"
    words = f"jumps by {1e3 * height_m:+.3g} mm at {time_s[first]:.2f} s, and on one side it is wrong by as much"
    return words, "noted" if abs(height_m) < SMALL * stroke_m else "refused"


def _height(x_m: Array, first: int, last: int, line: int) -> float:
    """Measure how much higher the line after a fault is than the line before it, in the middle between them [m]."""
    rows, middle = np.arange(len(x_m)), 0.5 * (first + last)
    sides = slice(max(0, first - line), first), slice(last + 1, last + 1 + line)
    if min(len(x_m[side]) for side in sides) < 2:
        return 0.0
    before_m, behind_m = (float(np.polyval(np.polyfit(rows[side] - middle, x_m[side], 1), 0.0)) for side in sides)
    return behind_m - before_m


def _still(x_m: Array, time_s: Array, rows: int, stroke_m: float) -> str:
    """State if the position is exactly constant for ``rows`` rows or more, although the sensor has noise elsewhere.

    Noise goes up and down at almost every sample; converter steps and motion do not.
    """
    steps_m = np.diff(x_m)
    stretches_m = steps_m[: len(steps_m) // rows * rows].reshape(-1, rows)
    up, down = (stretches_m > 0.0).mean(axis=1), (stretches_m < 0.0).mean(axis=1)
    alive = (np.minimum(up, down) >= UP_AND_DOWN) & (up + down >= CHANGES)
    if np.count_nonzero(alive) * STILL_S >= ALIVE_S:
        for begin, end in true_runs(steps_m == 0.0).tolist():
            if end - begin >= rows and RANGE_END_SHARE * stroke_m < x_m[begin] < (1.0 - RANGE_END_SHARE) * stroke_m:
                return (
                    f"position_m holds {1e3 * x_m[begin]:.4g} mm from {time_s[begin]:.2f} to {time_s[end]:.2f} s "
                    "without the noise that it has elsewhere; check the sensor, and leave this time out"
                )
    return ""

"""Check a uniformly sampled table before it counts as a recording."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, true_runs
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding, Outcome, spoken
from cylinder_friction.recordings.checks.plausibility import check_friction
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    LOAD_FORCE,
    OIL_TEMPERATURE,
    OTHER_POSITIONS,
    POSITION,
    PRESSURES,
    TIME,
)
from cylinder_friction.recordings.line_loss import BAR_PA
from cylinder_friction.recordings.recording import Columns, Recording, RecordingError

RATE_TOLERANCE = 1e-3  # Largest error of a logger's clock, as a share of its rate
LOWEST_PRESSURE_PA = -2e5  # Lowest credible gauge pressure: vacuum and a sensor's offset [Pa]
POSITION_SLACK = 0.05  # Largest reading of position beyond the stroke, as a share of the stroke
STUCK_TRAVEL = 0.25  # Travel, as a share of the stroke, beyond which an exactly constant sensor is stuck
LEAST_SPANS = {"pressure": 1e3, "force": 1e-3}  # Least change of a live sensor on a moving cylinder [Pa, N]
NOISY_SHARE = 0.25  # Share of rows with a change from which on a sensor shows noise and never stays constant for long
NEW_UNIT, SAME_FACTOR = 0.7, 0.05  # Least change of both pressures in a row, and largest difference (logarithms)
NEXT_STEP = 1.5  # Largest distance of neighbouring values, in converter steps
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
NOISY_S, NOISIER, FAINT, HELD = 0.5, 20.0, 1e-3, 0.6
"""Duration of a stretch [s]. It is noisy above this multiple of the usual noise, if its fourth differences exceed this
share of the stroke. Values are held if at most this share of its rows has a new one."""
RANGE_END_SHARE = 0.01  # Distance from an end of the stroke, as a share, within which the sensor's range may end
IN_TURN, MIXED, LEAST_MIXED = (1, 2, 3), 5.0, 0.02  # Rows (over 4, 50 Hz of the mains repeats); least ratio, share
MOST_IN_A_ROW = 0.05  # Largest share of the changes of a held signal that come in the third row in turn
FEWEST_HOLDS, EVEN_HOLDS, LATE_HOLD, LARGE_STEPS = 20, 0.75, 0.2, 0.1
"""Of a signal that is refreshed less often than logged: fewest refreshes, least share at the usual distance, largest
deviation from it, and least share of larger steps, because slow motion passes the steps of a converter as evenly."""


def checked_recording(piece: Recording, limits: CheckLimits) -> Recording:
    """Check a piece of a log; findings that are only noted join its repairs."""
    noted = []
    for finding in inspect_recording(piece.columns, limits, piece.sample_time_s):
        if finding.outcome == "refused":
            raise RecordingError(finding.text)
        noted.append(finding.text)
    return Recording(replace(piece.metadata, repairs=(*piece.metadata.repairs, *noted)), piece.columns)


class _Survey:
    """Extremes of a column, and its constant stretch of longest travel that no converter's ``step`` explains."""

    def __init__(self, values: Array, position_m: Array, step: float) -> None:
        self.stuck_from, self.stuck_to, self.stuck_travel_m = 0, 1, 0.0
        runs = true_runs(values[1:] == values[:-1]) + np.array([0, 1])
        if len(runs):
            places = runs.ravel()[: -1 if runs[-1, 1] == len(values) else None]
            travel_m = (np.maximum.reduceat(position_m, places) - np.minimum.reduceat(position_m, places))[::2]
            travel_m *= _unexplained(values, runs, step)
            stuck = int(np.argmax(travel_m))
            (self.stuck_from, self.stuck_to), self.stuck_travel_m = runs[stuck].tolist(), float(travel_m[stuck])
        self.stuck_at = float(values[self.stuck_from])
        self.lowest_row, self.highest_row = int(np.argmin(values)), int(np.argmax(values))
        self.lowest, self.highest = float(values[self.lowest_row]), float(values[self.highest_row])
        self.span = self.highest - self.lowest

    def stuck(self, name: str, check: str, unit: str, stroke_m: float, remedy: str) -> Iterator[Finding]:
        """Refuse a column that is constant over a long travel."""
        if self.stuck_travel_m > STUCK_TRAVEL * stroke_m:
            text = (
                f"{name} stays at exactly {self.stuck_at:.6g} {unit} from row {self.stuck_from + 1} to row "
                f"{self.stuck_to} while the piston travels {self.stuck_travel_m:.3g} m{remedy}"
            )
            yield Finding(check, "refused", text)

    def worst(self, low: float, high: float) -> tuple[float, int]:
        """Find the value furthest outside of two bounds; return it and its row, counted from 1."""
        lowest, highest = (self.lowest, self.lowest_row + 1), (self.highest, self.highest_row + 1)
        return lowest if low - self.lowest > self.highest - high else highest


def _unexplained(values: Array, runs: NDArray[np.int64], step: float) -> Array:
    """Compute the share of each constant stretch that the step does not explain: 1/2 at an end of the recording."""
    start, end, last = runs[:, 0], runs[:, 1], len(values) - 1
    before, behind = (np.abs(values[at] - values[start]) for at in (np.maximum(start - 1, 0), np.minimum(end, last)))
    explained = (step > 0.0) & (np.maximum(before, behind) <= NEXT_STEP * step)
    at_an_end = (start == 0) | (end > last)
    return np.where(explained, 0.5 * at_an_end, 1.0)


def inspect_recording(columns: Columns, limits: CheckLimits, sample_time_s: float) -> Iterator[Finding]:
    """Yield everything wrong with the complete columns of a piece; the direction only if the rest is in order."""
    rows, least_s, least_hz = len(columns[POSITION]), limits.minimum_duration_s, limits.minimum_rate_hz
    duration_s, rate_hz = rows * sample_time_s, 1.0 / sample_time_s
    if duration_s < least_s:
        text = (
            f"lasts {duration_s:.3g} s ({rows} rows), expected at least {least_s:.3g} s; log longer or lower "
            "checks.minimum_duration_s in the mapping"
        )
        yield Finding("length", "refused", text)
    if rate_hz < least_hz * (1.0 - RATE_TOLERANCE):
        text = (
            f"is sampled at {rate_hz:.4g} Hz, expected at least {least_hz:.4g} Hz; the filters would smear starts, "
            "stops and reversals over each other; log faster, or correct the unit of time_s (ms read as s?)"
        )
        yield Finding("rate", "refused", text)
    seen = {
        name: _Survey(values, columns[POSITION], limits.steps.get(name, 0.0))
        for name, values in columns.items()
        if name not in (TIME, OIL_TEMPERATURE)
    }
    findings = [*_of_mixed_rows(columns), *_of_refreshes(columns, rate_hz, least_hz)]
    findings += _of_position(columns, seen, limits)
    if DRIVE_FORCE in columns:
        findings += _alive(DRIVE_FORCE, "force", seen[DRIVE_FORCE], limits)
    else:
        findings += _of_pressures(columns, seen, limits)
    if LOAD_FORCE in columns and limits.load == "measured" and limits.stated_load is None:
        findings += _of_load(columns[LOAD_FORCE], seen[LOAD_FORCE], limits)
    yield from findings
    if all(finding.outcome != "refused" for finding in findings):
        yield from check_friction(columns, sample_time_s, limits)


def _of_mixed_rows(columns: Columns) -> Iterator[Finding]:
    """Refuse a signal that changes far more from row to row than over some rows: rows of several are in turn."""
    for name in (*PRESSURES, DRIVE_FORCE, POSITION):
        own = columns.get(name, np.empty(0))
        if len(own) < 2 * IN_TURN[-1] or np.mean(np.abs(np.diff(own)) > LEAST_MIXED * np.ptp(own)) <= 0.25:
            continue
        change, *others = (float(np.quantile(np.abs(own[rows:] - own[:-rows]), 0.75)) for rows in IN_TURN)
        if change > MIXED * min(others):
            text = (
                f"{name} changes by {spoken(name, change)} from row to row, but by {spoken(name, min(others))} over "
                f"{IN_TURN[1 + others.index(min(others))]} rows: rows of several cylinders, sensors or statistics are "
                "in turn; keep those of one, which another column may name, or filter the interference of the mains"
            )
            yield Finding("mixed_rows", "refused", text)
            return


def _of_refreshes(columns: Columns, rate_hz: float, least_hz: float) -> Iterator[Finding]:
    """Refuse signals that are logged at a sufficient rate, but hold each sample of their sensor for too many rows."""
    places = ((name, refreshes(columns[name])) for name in (POSITION, *PRESSURES, DRIVE_FORCE) if name in columns)
    rows = {name: float(np.median(np.diff(at))) for name, at in places if len(at)}
    held = {name: each for name, each in rows.items() if rate_hz < (1.0 - RATE_TOLERANCE) * least_hz * each}
    if held and rate_hz >= (1.0 - RATE_TOLERANCE) * least_hz:
        most = max(held.values())
        text = (
            f"new values of {', '.join(held)} come only every {most:.3g} rows, at {rate_hz / most:.3g} Hz, in rows of "
            f"{rate_hz:.4g} Hz: each sample is held until the next; expected at least {least_hz:.4g} Hz; let sensor, "
            "bus or controller refresh it faster"
        )
        yield Finding("refresh", "refused", text)


def refreshes(values: Array) -> NDArray[np.int64]:
    """Find the rows at which a held signal changes; none if it is not held. A row may lie between two values.

    A sensor without noise also shows steps at even distances while it moves slowly, but changes in every row if fast.
    """
    changes = np.diff(values) != 0.0
    if (changes[:-2] & changes[1:-1] & changes[2:]).sum() > MOST_IN_A_ROW * changes.sum():
        return np.empty(0, dtype=np.int64)
    at = np.flatnonzero(changes & ~np.append(False, changes[:-1])) + 1
    distances, steps = np.diff(at), np.abs(np.diff(values[at - 1]))
    if len(distances) < FEWEST_HOLDS or not steps.any():
        return at[:0]
    even = np.mean(np.abs(distances / np.median(distances) - 1.0) <= LATE_HOLD) >= EVEN_HOLDS
    return at if even and np.mean(steps > 1.5 * steps[steps > 0.0].min()) >= LARGE_STEPS else at[:0]


def _of_position(columns: Columns, of_columns: dict[str, _Survey], limits: CheckLimits) -> Iterator[Finding]:
    seen, stroke_m, slack_m = of_columns[POSITION], limits.cylinder.stroke_m, POSITION_SLACK * limits.cylinder.stroke_m
    if seen.lowest < -slack_m or seen.highest > stroke_m + slack_m:
        value, row = seen.worst(0.0, stroke_m)
        advice = "its unit (mm read as m?)"
        if seen.span <= stroke_m + slack_m:
            fits = f"for its travel of {seen.span:.4g} m fits"
            advice = f"sign and zero of the sensor (sign and offset in the mapping), {fits}"
        text = (
            f"position_m is {value:.4g} m in row {row} (it runs from {seen.lowest:.4g} to {seen.highest:.4g} m), "
            f"expected 0 to {stroke_m:.4g} m, the stroke; check {advice}"
        )
        yield Finding("position_range", "refused", text)
    least_m, moves = limits.least_travel * stroke_m, f"position_m moves by {seen.span:.3g} m only"
    elsewhere = [name for name in OTHER_POSITIONS if name in of_columns and of_columns[name].span >= least_m]
    if seen.span < least_m and elsewhere:
        text = (
            f"{moves}, while {elsewhere[0]} moves by {of_columns[elsewhere[0]].span:.3g} m: the piston rests, or "
            "its sensor is stuck; the recording shows no friction of sliding"
        )
        yield Finding("motion", "noted", text)
        return
    if seen.span < least_m:
        text = (
            f"{moves}, expected at least {least_m:.3g} m; nothing moves, the sensor is stuck, or its unit is wrong "
            "(m read as mm?); if another cylinder moved instead, map its position as other_position_1_m"
        )
        yield Finding("motion", "refused", text)
    at = refreshes(columns[POSITION])  # a held position steps, and stands between
    x_m, time_s = (columns[name][at] if len(at) else columns[name] for name in (POSITION, TIME))
    yield from check_position_steps(x_m, time_s, stroke_m)


def _of_pressures(columns: Columns, seen: dict[str, _Survey], limits: CheckLimits) -> Iterator[Finding]:
    low, high = LOWEST_PRESSURE_PA, limits.highest_pressure_pa
    for name in PRESSURES:
        if seen[name].lowest < low or seen[name].highest > high:
            value, row = seen[name].worst(low, high)
            advice = "check unit (Pa or kPa read as bar?) and sign"
            if seen[name].highest <= 0.0:
                advice = "no value is positive, so the sign is reversed; write sign: -1 for it in the mapping"
            expected = f"expected {low / 1e5:.4g} to {high / 1e5:.4g} bar gauge"
            text = f"{name} is {spoken(name, value)} in row {row}, {expected}; {advice}"
            yield Finding("pressure_range", "refused", text)
        yield from _alive(name, "pressure", seen[name], limits)
    pressures_pa = np.maximum([columns[name] for name in PRESSURES], BAR_PA)
    factors = np.diff(np.log(pressures_pa)) * (np.minimum(pressures_pa[:, 1:], pressures_pa[:, :-1]) > BAR_PA)
    row = int(np.argmax(np.abs(factors).min(axis=0)))
    if np.abs(factors[:, row]).min() > NEW_UNIT and np.ptp(factors[:, row]) < SAME_FACTOR:
        text = (
            f"both pressures change by a factor of {math.exp(factors[0, row]):.3g} behind row {row + 1}, as if their "
            "unit had been changed there; cut the log there, and state the unit of each part"
        )
        yield Finding("unit_changed", "refused", text)
    if np.array_equal(columns[PRESSURES[0]], columns[PRESSURES[1]]):
        text = (
            "pressure_1_pa and pressure_2_pa are equal in every row, which no two sensors are; one channel was logged "
            "twice or mapped twice; correct the mapping"
        )
        yield Finding("pressures_differ", "refused", text)
    # If pressure is low throughout, its unit is too small, or the supply was off.
    name = max(PRESSURES, key=lambda column: seen[column].highest)
    if seen[name].highest < limits.least_peak_pressure_pa:
        text = (
            f"the highest pressure in the whole recording is {spoken(name, seen[name].highest)} ({name}), expected at "
            f"least {limits.least_peak_pressure_pa / 1e5:.4g} bar; check the unit (MPa read as bar, kPa as Pa?) and "
            "that the supply was on, or lower least_peak_pressure_pa for pneumatics"
        )
        yield Finding("unit_plausible", "refused", text)


def _alive(name: str, kind: str, seen: _Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Refuse a sensor that does not change with the motion, or sticks while the piston travels."""
    unit, wrong = ("Pa", "bar read as Pa?") if kind == "pressure" else ("N", "MN or kN read as N?")
    if seen.span < LEAST_SPANS[kind]:
        what = "is constant" if seen.span == 0.0 else f"changes by {seen.span:.3g} {unit} only"
        text = (
            f"{name} {what} (at {seen.highest:.4g} {unit}) while the cylinder moves; the sensor is stuck or not "
            f"connected, or the unit is wrong ({wrong})"
        )
        yield Finding(f"{kind}_alive", "refused", text)
        return
    remedy = (
        "; the sensor is stuck or at the end of its range, or its values are rounded: then state its range and bits "
        "as its sensor in the mapping"
    )
    yield from seen.stuck(name, f"{kind}_stuck", unit, limits.cylinder.stroke_m, remedy)


def _of_load(load_n: Array, seen: _Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Check that a load cell changes. A constant load is only noted, but a cell whose noise stops is refused."""
    if seen.span == 0.0:
        why = "the load cell is idle, stuck or not connected"
        if seen.highest != 0.0:
            why = "right for a constant weight; a load cell would be stuck, as its noise is missing"
        yield Finding("load_alive", "noted", f"load_force_n is constant (at {seen.highest:.4g} N); {why}")
    elif np.count_nonzero(np.diff(load_n)) > NOISY_SHARE * (len(load_n) - (seen.stuck_to - seen.stuck_from)):
        remedy = ", and changes from row to row elsewhere; the load cell or its amplifier was stuck; cut the log there"
        yield from seen.stuck(LOAD_FORCE, "load_stuck", "N", limits.cylinder.stroke_m, remedy)


def check_position_steps(position_m: Array, time_s: Array, stroke_m: float) -> list[Finding]:
    """Refuse a position with a jump, a held value or a disturbance; note small ones and single bad samples."""
    step_s = float(time_s[1] - time_s[0])
    bend_m = np.abs(np.diff(position_m, 2))
    usual_m = float(np.quantile(bend_m[:: max(1, len(bend_m) // 4096)], 0.95))
    bent = np.flatnonzero(bend_m > max(NOISE * usual_m, STROKES * stroke_m)) + 1
    groups = np.split(bent, np.flatnonzero(np.diff(bent) * step_s > TOGETHER_S) + 1) if len(bent) else []
    found = [(int(each[0]), *_described(position_m, time_s, int(each[0]), int(each[-1]), stroke_m)) for each in groups]
    faults = sorted((each for each in found if each[1]), key=lambda each: each[2] != "refused")
    if faults:
        row, words, outcome = faults[0]
        alike = [each for each in faults if each[2] == outcome]
        more = f" (first of {len(alike)} such faults)" if len(alike) > 1 else ""
        effect = "velocity and friction are wrong there"
        advice = effect if outcome == "noted" else "check the sensor and its cable, and cut the log there"
        text = f"position_m {words}, in row {row + 1}{more}; {advice}"
        return [Finding("position_steps", outcome, text)]
    if found:
        text = (
            f"position_m has {len(found)} single samples that no piston can follow (first: row {found[0][0] + 1}, at "
            f"{time_s[found[0][0]]:.2f} s); check the sensor and its cable"
        )
    else:
        text = _noisy(position_m, time_s, max(16, round(NOISY_S / step_s)), stroke_m)
        text = text or _still(position_m, time_s, max(2, round(STILL_S / step_s)), stroke_m)
    return [Finding("position_steps", "noted", text)] if text else []


def _noisy(x_m: Array, time_s: Array, rows: int, stroke_m: float) -> str:
    """Name stretches of ``rows`` rows whose fourth differences have far more noise than the quietest ones have."""
    change_m = np.round(np.diff(x_m, 4), 9)  # without what floating-point numbers add to a coarse converter
    stretches_m = change_m[: len(change_m) // rows * rows].reshape(-1, rows)
    level_m = np.median(np.abs(stretches_m), axis=1)
    alive = (stretches_m[:, 1:] * stretches_m[:, :-1] < 0.0).mean(axis=1) > ALTERNATES
    if np.count_nonzero(alive) * rows < ALIVE_S / (time_s[1] - time_s[0]):
        return ""
    usual_m = float(np.quantile(level_m[alive], QUIETEST))
    noisy = np.flatnonzero(alive & (level_m > max(NOISIER * usual_m, FAINT * stroke_m)))
    if len(noisy) * rows < STILL_S / (time_s[1] - time_s[0]):
        return ""
    new = float((np.diff(x_m)[: len(stretches_m) * rows].reshape(-1, rows)[noisy] != 0.0).mean())
    if new <= HELD:
        late_ms = 500.0 * float(time_s[1] - time_s[0]) * (1.0 / new - 1.0)
        advice = f"so it is late by about {late_ms:.2g} ms, which its sensor.delay_s in the mapping may state"
        return f"position_m has a new value in {100.0 * new:.0f} % of the rows while the piston moves, {advice}"
    begin, end = time_s[noisy[0] * rows], time_s[min((noisy[-1] + 1) * rows, len(time_s) - 1)]
    return (
        f"position_m has {float(np.median(level_m[noisy])) / usual_m:.2g} times its usual noise between {begin:.2f} "
        f"and {end:.2f} s; velocity and friction are wrong there; check the sensor and its cable"
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
    """State if the position is constant for ``rows`` rows or more, although its noise goes up and down elsewhere."""
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

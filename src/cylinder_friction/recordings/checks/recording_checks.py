"""Check a uniformly sampled table before it counts as a recording."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, true_runs
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding, spoken
from cylinder_friction.recordings.checks.plausibility import check_friction
from cylinder_friction.recordings.checks.position_steps import check_position_steps
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    LOAD_FORCE,
    OTHER_POSITIONS,
    POSITION,
    PRESSURES,
    TIME,
)
from cylinder_friction.recordings.recording import Columns, Recording, RecordingError, RecordingMetadata, missing_column

RATE_TOLERANCE = 1e-3  # Largest error of a logger's clock, as a share of its rate
LOWEST_PRESSURE_PA = -2e5  # Lowest credible gauge pressure: vacuum and a sensor's offset [Pa]
POSITION_SLACK = 0.05  # Largest reading of position beyond the stroke, as a share of the stroke
STUCK_TRAVEL = 0.25  # Travel, as a share of the stroke, beyond which an exactly constant sensor is stuck
LEAST_SPANS = {"pressure": 1e3, "force": 1e-3}
"""Least change of a live sensor on a moving cylinder [Pa, N]."""
NOISY_SHARE = 0.25  # Share of rows with a change from which on a sensor shows noise and never stays constant for long
NEXT_STEP = 1.5  # Largest distance of neighbouring values, in converter steps


def checked_recording(metadata: RecordingMetadata, columns: Columns, findings: Iterable[Finding]) -> Recording:
    """Make a recording of columns that pass their checks; findings that are only noted join its repairs.

    Raises:
        RecordingError: The first finding that is a refusal, see ``inspect_recording``.
    """
    noted = []
    for finding in findings:
        if finding.outcome == "refused":
            raise RecordingError(finding.text)
        if finding.outcome == "noted":
            noted.append(finding.text)
    return Recording(replace(metadata, repairs=(*metadata.repairs, *noted)), columns)


class _Survey:
    """Extremes of a column, and the constant stretch over which the piston travels furthest.

    ``step`` is the column's converter step, 0 if not known. A stretch between two neighbouring steps does not count,
    because the value changed by less than the converter resolves.
    """

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
        if low - self.lowest > self.highest - high:
            return self.lowest, self.lowest_row + 1
        return self.highest, self.highest_row + 1


def _unexplained(values: Array, runs: NDArray[np.int64], step: float) -> Array:
    """Compute the share of each constant stretch that the converter's step does not explain, shape ``(m,)``.

    The share is 0 between two neighbouring steps, and 1/2 at an end of the recording, whose next value is not known.
    """
    start, end, last = runs[:, 0], runs[:, 1], len(values) - 1
    before, behind = (np.abs(values[at] - values[start]) for at in (np.maximum(start - 1, 0), np.minimum(end, last)))
    explained = (step > 0.0) & (np.maximum(before, behind) <= NEXT_STEP * step)
    at_an_end = (start == 0) | (end > last)
    return np.where(explained, 0.5 * at_an_end, 1.0)


def inspect_recording(table: Columns, limits: CheckLimits, sample_time_s: float) -> Iterator[Finding]:
    """Yield everything that is wrong with a table. After missing columns or values, no further check is made.

    The names of the checks, in their order: ``columns``, ``length``, ``finite``, ``rate``, ``position_range``,
    ``motion``, ``position_steps``; for each pressure ``pressure_range``, ``pressure_alive``, ``pressure_stuck``, for
    both ``pressures_differ`` and ``unit_plausible``; with a drive force ``force_alive`` and ``force_stuck`` instead;
    ``load_alive`` and ``load_stuck``; ``direction`` and ``friction_size``. The last two are checked only if the areas
    are known and the signals have passed the other checks.
    """
    if missing := missing_column(table):
        yield Finding("columns", "refused", f"{missing}; map it to a channel")
        return
    columns = {name: np.asarray(table[name], dtype=np.float64) for name in table}
    rows = len(columns[POSITION])
    if rows < 3:
        yield Finding("length", "refused", f"has {rows} rows, expected at least 3")
        return
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            text = f"{name} is {values[bad[0]]} in row {bad[0] + 1} ({len(bad)} such rows in all)"
            yield Finding("finite", "refused", f"{text}; expected finite numbers; repair or cut the log")
            return
    duration_s, rate_hz, least_s, least_hz = (
        rows * sample_time_s,
        1.0 / sample_time_s,
        limits.minimum_duration_s,
        limits.minimum_rate_hz,
    )
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
        if name != TIME
    }
    findings = [*_of_position(columns, seen, limits)]
    if DRIVE_FORCE in columns:
        findings += _alive(DRIVE_FORCE, "force", seen[DRIVE_FORCE], limits)
    else:
        findings += _of_pressures(columns, seen, limits)
    if LOAD_FORCE in columns and limits.load == "measured" and limits.stated_load is None:
        findings += _of_load(columns[LOAD_FORCE], seen[LOAD_FORCE], limits)
    yield from findings
    valid = all(finding.outcome != "refused" for finding in findings)
    if valid and (DRIVE_FORCE in columns or limits.areas_m2 is not None):
        yield from check_friction(columns, sample_time_s, limits)


def _of_position(columns: Columns, of_columns: dict[str, _Survey], limits: CheckLimits) -> Iterator[Finding]:
    seen, stroke_m, slack_m = of_columns[POSITION], limits.stroke_m, POSITION_SLACK * limits.stroke_m
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
    yield from check_position_steps(columns[POSITION], columns[TIME], stroke_m)


def _of_pressures(columns: dict[str, Array], seen: dict[str, _Survey], limits: CheckLimits) -> Iterator[Finding]:
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
    yield from seen.stuck(name, f"{kind}_stuck", unit, limits.stroke_m, remedy)


def _of_load(load_n: Array, seen: _Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Check that a load cell changes. A constant load is only noted, but a cell whose noise stops is refused."""
    if seen.span == 0.0:
        text = f"load_force_n is constant (at {seen.highest:.4g} N); the load cell is idle, stuck or not connected"
        yield Finding("load_alive", "noted", text)
    elif np.count_nonzero(np.diff(load_n)) > NOISY_SHARE * (len(load_n) - (seen.stuck_to - seen.stuck_from)):
        remedy = ", and changes from row to row elsewhere; the load cell or its amplifier was stuck; cut the log there"
        yield from seen.stuck(LOAD_FORCE, "load_stuck", "N", limits.stroke_m, remedy)

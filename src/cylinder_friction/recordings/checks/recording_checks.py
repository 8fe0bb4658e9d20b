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
    missing_column,
)
from cylinder_friction.recordings.recording import Columns, Recording, RecordingError, RecordingMetadata

RATE_TOLERANCE = 1e-3  # A logger's clock may be off by this share of its rate
LOWEST_PRESSURE_PA = -2e5  # Gauge: vacuum and a sensor's offset [Pa]
POSITION_SLACK = 0.05  # Share of the stroke by which position may read beyond it
STUCK_TRAVEL = 0.25  # A sensor that stays exactly constant over more than this share of the stroke is stuck
LEAST_SPANS = {"pressure": 1e3, "force": 1e-3}
"""By what a live sensor on a moving cylinder changes at least [Pa, N]."""
NOISY_SHARE = 0.25  # A sensor that changes in this share of the rows shows noise, and never stays constant for long
NEXT_STEP = 1.5  # Values at most this many steps of the converter apart are neighbours


def checked_recording(metadata: RecordingMetadata, columns: Columns, findings: Iterable[Finding]) -> Recording:
    """Return the columns as a recording, with what its checks only noted among its repairs.

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

    ``step`` is that of the column's converter, 0 if it is not known. A stretch between two neighbouring steps does not
    count: the value changed by less than the converter shows.
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

    def stuck(self, name: str, check: str, unit: str, stroke_m: float, remedy: str, *, may_be: bool = False) -> Finding:
        """Refuse a column that is constant over a long travel, unless it ``may_be``."""
        return Finding.of(
            check,
            may_be or self.stuck_travel_m <= STUCK_TRAVEL * stroke_m,
            f"{name} stays exactly constant over {self.stuck_travel_m:.3g} m of travel at most",
            f"{name} stays at exactly {self.stuck_at:.6g} {unit} from row {self.stuck_from + 1} to row {self.stuck_to} "
            f"while the piston travels {self.stuck_travel_m:.3g} m{remedy}",
        )

    def worst(self, low: float, high: float) -> tuple[float, int]:
        """Return the value furthest outside of two bounds, and its row, counted from 1."""
        if low - self.lowest > self.highest - high:
            return self.lowest, self.lowest_row + 1
        return self.highest, self.highest_row + 1


def _unexplained(values: Array, runs: NDArray[np.int64], step: float) -> Array:
    """Return the share of each constant stretch that a converter of this step does not explain, shape ``(m,)``.

    Between two neighbouring steps nothing is; at an end of the recording, if the next value is not known, half.
    """
    start, end, last = runs[:, 0], runs[:, 1], len(values) - 1
    before, behind = (np.abs(values[at] - values[start]) for at in (np.maximum(start - 1, 0), np.minimum(end, last)))
    explained = (step > 0.0) & (np.maximum(before, behind) <= NEXT_STEP * step)
    at_an_end = (start == 0) | (end > last)
    return np.where(explained, 0.5 * at_an_end, 1.0)


def inspect_recording(table: Columns, limits: CheckLimits, sample_time_s: float) -> Iterator[Finding]:
    """Yield what every check finds, refusals included. After missing columns or values no further check is made.

    The names of the checks, in their order: ``columns``, ``length``, ``finite``, ``rate``, ``position_range``,
    ``motion``, ``position_steps``; for each pressure ``pressure_range``, ``pressure_alive``, ``pressure_stuck``, for
    both ``pressures_differ`` and ``unit_plausible``, or in their place ``force_alive`` and ``force_stuck``;
    ``load_alive`` and ``load_stuck``; ``direction``, ``friction_size`` and ``load_delay``. The last three need signals
    that passed and known areas.
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
    yield Finding("finite", "ok", "every value is a finite number")
    duration_s, least_s, least_hz = rows * sample_time_s, limits.minimum_duration_s, limits.minimum_rate_hz
    lasts, rate = f"lasts {duration_s:.3g} s ({rows} rows)", f"is sampled at {1.0 / sample_time_s:.4g} Hz"
    yield Finding.of(
        "length",
        duration_s >= least_s,
        lasts,
        f"{lasts}, expected at least {least_s:.3g} s; log longer or lower checks.minimum_duration_s in the mapping",
    )
    yield Finding.of(
        "rate",
        1.0 / sample_time_s >= least_hz * (1.0 - RATE_TOLERANCE),
        rate,
        f"{rate}, expected at least {least_hz:.4g} Hz; the filters would smear starts, stops and reversals over each "
        "other; log faster, or correct the unit of time_s (ms read as s?)",
    )
    seen = {name: _Survey(values, columns[POSITION], limits.steps.get(name, 0.0)) for name, values in columns.items()}
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
    runs = f"it runs from {seen.lowest:.4g} to {seen.highest:.4g} m"
    value, row = seen.worst(0.0, stroke_m)
    advice = "its unit (mm read as m?)"
    if seen.span <= stroke_m + slack_m:
        advice = (
            f"sign and zero of the sensor (sign and offset in the mapping), for its travel of {seen.span:.4g} m fits"
        )
    yield Finding.of(
        "position_range",
        seen.lowest >= -slack_m and seen.highest <= stroke_m + slack_m,
        f"position_m lies within the stroke of {stroke_m:.4g} m; {runs}",
        f"position_m is {value:.4g} m in row {row} ({runs}), expected 0 to {stroke_m:.4g} m, the stroke; "
        f"check {advice}",
    )
    least_m, moves = limits.least_travel * stroke_m, f"position_m moves by {seen.span:.3g} m"
    elsewhere = [name for name in OTHER_POSITIONS if name in of_columns and of_columns[name].span >= least_m]
    if seen.span < least_m and elsewhere:
        text = (
            f"{moves} only, while {elsewhere[0]} moves by {of_columns[elsewhere[0]].span:.3g} m: the piston rests, or "
            "its sensor is stuck; the recording shows no friction of sliding"
        )
        yield Finding("motion", "noted", text)
        return
    yield Finding.of(
        "motion",
        seen.span >= least_m,
        moves,
        f"{moves} only, expected at least {least_m:.3g} m; nothing moves, the sensor is stuck, or its unit is wrong "
        "(m read as mm?); if another cylinder moved instead, map its position as other_position_1_m",
    )
    yield check_position_steps(columns[POSITION], columns[TIME], stroke_m)


def _of_pressures(columns: dict[str, Array], seen: dict[str, _Survey], limits: CheckLimits) -> Iterator[Finding]:
    low, high = LOWEST_PRESSURE_PA, limits.highest_pressure_pa
    for name in PRESSURES:
        value, row = seen[name].worst(low, high)
        advice = "check unit (Pa or kPa read as bar?) and sign"
        if seen[name].highest <= 0.0:
            advice = "no value is positive, so the sign is reversed; write sign: -1 for it in the mapping"
        yield Finding.of(
            "pressure_range",
            seen[name].lowest >= low and seen[name].highest <= high,
            f"{name} runs from {spoken(name, seen[name].lowest)} to {spoken(name, seen[name].highest)}",
            f"{name} is {spoken(name, value)} in row {row}, expected {low / 1e5:.4g} to {high / 1e5:.4g} bar gauge; "
            f"{advice}",
        )
        yield from _alive(name, "pressure", seen[name], limits)
    yield Finding.of(
        "pressures_differ",
        not np.array_equal(columns[PRESSURES[0]], columns[PRESSURES[1]]),
        "the two pressures differ",
        "pressure_1_pa and pressure_2_pa are equal in every row, which no two sensors are; one channel was logged "
        "twice or mapped twice; correct the mapping",
    )
    # Without pressure throughout, the unit is too small, or the supply was off.
    name = max(PRESSURES, key=lambda column: seen[column].highest)
    peak = f"the highest pressure in the whole recording is {spoken(name, seen[name].highest)} ({name})"
    yield Finding.of(
        "unit_plausible",
        seen[name].highest >= limits.least_peak_pressure_pa,
        peak,
        f"{peak}, expected at least {limits.least_peak_pressure_pa / 1e5:.4g} bar; check the unit (MPa read as bar, "
        "kPa as Pa?) and that the supply was on, or lower least_peak_pressure_pa for pneumatics",
    )


def _alive(name: str, kind: str, seen: _Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Check that a sensor changes with the motion and does not stick while the piston travels."""
    unit, wrong = ("Pa", "bar read as Pa?") if kind == "pressure" else ("N", "MN or kN read as N?")
    what = "is constant" if seen.span == 0.0 else f"changes by {seen.span:.3g} {unit} only"
    alive = Finding.of(
        f"{kind}_alive",
        seen.span >= LEAST_SPANS[kind],
        f"{name} changes by {spoken(name, seen.span)}",
        f"{name} {what} (at {seen.highest:.4g} {unit}) while the cylinder moves; the sensor is stuck or not "
        f"connected, or the unit is wrong ({wrong})",
    )
    yield alive
    if alive.outcome == "ok":
        remedy = (
            "; the sensor is stuck or at the end of its range, or its values are rounded: then state its range and "
            "bits as its sensor in the mapping"
        )
        yield seen.stuck(name, f"{kind}_stuck", unit, limits.stroke_m, remedy)


def _of_load(load_n: Array, seen: _Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Check that a load cell changes. Unlike a pressure, a load may stay constant unless the cell's noise ceases."""
    if seen.span == 0.0:
        text = f"load_force_n is constant (at {seen.highest:.4g} N); the load cell is idle, stuck or not connected"
        yield Finding("load_alive", "noted", text)
        return
    yield Finding("load_alive", "ok", f"load_force_n changes by {spoken(LOAD_FORCE, seen.span)}")
    elsewhere = len(load_n) - (seen.stuck_to - seen.stuck_from)
    noisy = bool(np.count_nonzero(np.diff(load_n)) > NOISY_SHARE * elsewhere)
    remedy = ", and changes from row to row elsewhere; the load cell or its amplifier was stuck; cut the log there"
    yield seen.stuck(LOAD_FORCE, "load_stuck", "N", limits.stroke_m, remedy, may_be=not noisy)

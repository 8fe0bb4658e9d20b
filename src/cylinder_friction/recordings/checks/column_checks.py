"""Checks of one column by itself: its range, whether its sensor lives, whether it stuck while the piston travelled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.recordings.checks.finding import Finding, spoken

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from cylinder_friction.recordings.checks.limits import CheckLimits

    Array = NDArray[np.float64]

HELD_S = 0.1
"""A position that does not change for this long is at rest, or held by a logger that got no new sample."""

HELD_JUMP = 10.0
"""A held position that goes on with a step this many times the usual ones was not at rest."""

PLACES = 8192
"""Steps at most from which the usual one is told."""


@dataclass(frozen=True)
class Survey:
    """What one pass over a column tells.

    Attributes:
        bad: How many values are not finite; where there are any, the rest is void.
        first_bad: Index of the first of them.
        lowest, highest: Extremes.
        lowest_row, highest_row: Index of the first row at each.
        stuck_from, stuck_to: The constant stretch over which the piston goes furthest: its first row, and the row
            after its last.
        stuck_travel_m: How far the piston goes in it [m].
    """

    bad: int
    first_bad: int
    lowest: float
    highest: float
    lowest_row: int
    highest_row: int
    stuck_from: int
    stuck_to: int
    stuck_at: float
    stuck_travel_m: float

    @property
    def span(self) -> float:
        return self.highest - self.lowest


def survey(values: Array, position_m: Array) -> Survey:
    """Return what one pass over ``values`` tells, shape ``(n,)``, beside the position in the same rows [m]."""
    bad, first_bad, lowest_row, highest_row, stuck_from, stuck_to, travel_m = _survey(values, position_m)
    return Survey(
        int(bad),
        int(first_bad),
        float(values[lowest_row]),
        float(values[highest_row]),
        int(lowest_row),
        int(highest_row),
        int(stuck_from),
        int(stuck_to),
        float(values[stuck_from]),
        float(travel_m),
    )


@numba.njit(cache=True)
def _survey(values: Array, position: Array) -> tuple[int, int, int, int, int, int, float]:
    bad, first_bad, lowest_row, highest_row = 0, -1, 0, 0
    start, least, most = 0, position[0], position[0]
    stuck_from, stuck_to, travel = 0, 0, -1.0
    lowest, highest, last = values[0], values[0], values[0]
    for row in range(values.shape[0]):
        value = values[row]
        if not np.isfinite(value):
            if bad == 0:
                first_bad = row
            bad += 1
        if value < lowest:
            lowest, lowest_row = value, row
        elif value > highest:
            highest, highest_row = value, row
        if value != last:
            if most - least > travel:
                stuck_from, stuck_to, travel = start, row, most - least
            start, least, most, last = row, position[row], position[row], value
        elif position[row] < least:
            least = position[row]
        elif position[row] > most:
            most = position[row]
    if most - least > travel:
        stuck_from, stuck_to, travel = start, values.shape[0], most - least
    return bad, first_bad, lowest_row, highest_row, stuck_from, stuck_to, travel


def finite(columns: dict[str, Array], seen: dict[str, Survey]) -> Finding:
    """Judges whether every value of every column is a finite number."""
    for name, survey in seen.items():
        if survey.bad:
            text = (
                f"{name} is {columns[name][survey.first_bad]} in row {survey.first_bad + 1} "
                f"({survey.bad} such rows in all); expected finite numbers; repair or cut the log"
            )
            return Finding("finite", "refused", text)
    return Finding("finite", "ok", "every value is a finite number")


def position_range(seen: Survey, limits: CheckLimits) -> Finding:
    """Judges whether the position stays within the stroke."""
    slack_m = limits.position_slack * limits.stroke_m
    runs = f"it runs from {seen.lowest:.4g} to {seen.highest:.4g} m"
    if seen.lowest >= -slack_m and seen.highest <= limits.stroke_m + slack_m:
        return Finding("position_range", "ok", f"position_m lies within the stroke of {limits.stroke_m:.4g} m; {runs}")
    below = -seen.lowest > seen.highest - limits.stroke_m
    row, value = (seen.lowest_row, seen.lowest) if below else (seen.highest_row, seen.highest)
    text = (
        f"position_m is {value:.4g} m in row {row + 1} ({runs}), expected 0 to {limits.stroke_m:.4g} m, the stroke; "
        "check unit (mm read as m?), sign and zero of the sensor"
    )
    return Finding("position_range", "refused", text)


def motion(seen: Survey, limits: CheckLimits) -> Finding:
    """Judges whether anything moves."""
    least_m = limits.least_travel * limits.stroke_m
    if seen.span >= least_m:
        return Finding("motion", "ok", f"position_m moves by {seen.span:.3g} m")
    text = (
        f"position_m moves by {seen.span:.3g} m only, expected at least {least_m:.3g} m; nothing moves, the sensor is "
        "stuck, or its unit is wrong (m read as mm?)"
    )
    return Finding("motion", "refused", text)


def position_stuck(position_m: Array, sample_time_s: float, limits: CheckLimits) -> Finding:
    """Judges a position that stands still and then goes on from elsewhere: it moved meanwhile and nobody saw it."""
    places = np.arange(0, len(position_m) - 1, max(1, len(position_m) // PLACES))
    usual_m = float(np.quantile(np.abs(position_m[places + 1] - position_m[places]), 0.99))
    jump_m = max(limits.least_travel * limits.stroke_m, HELD_JUMP * usual_m)
    count, start, end = _held(position_m, max(3, round(HELD_S / sample_time_s)), jump_m)
    if count == 0:
        return Finding("position_stuck", "ok", "position_m never stays constant and then jumps")
    text = (
        f"position_m stays at exactly {position_m[start]:.6g} m from row {start + 1} to row {end} and goes on at "
        f"{position_m[end]:.6g} m ({count} such stretches in all); the sensor or the logger held its value while the "
        "piston moved; cut the log there"
    )
    return Finding("position_stuck", "refused", text)


@numba.njit(cache=True)
def _held(position: Array, rows: int, jump: float) -> tuple[int, int, int]:
    """Return how many constant stretches of at least ``rows`` rows end in a jump, and the first: start, end."""
    count, first_start, first_end, start = 0, 0, 0, 0
    for row in range(1, position.shape[0]):
        if position[row] != position[row - 1]:
            if row - start >= rows and abs(position[row] - position[row - 1]) > jump:
                if count == 0:
                    first_start, first_end = start, row
                count += 1
            start = row
    return count, first_start, first_end


def pressure(name: str, seen: Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Judges one pressure: its range, whether its sensor lives, and whether it stuck."""
    lowest, highest = limits.lowest_pressure_pa, limits.highest_pressure_pa
    if seen.lowest < lowest or seen.highest > highest:
        below = lowest - seen.lowest > seen.highest - highest
        row, value = (seen.lowest_row, seen.lowest) if below else (seen.highest_row, seen.highest)
        text = (
            f"{name} is {spoken(name, value)} in row {row + 1}, expected {lowest / 1e5:.4g} to {highest / 1e5:.4g} bar "
            "gauge; check unit (Pa or kPa read as bar?) and sign"
        )
        yield Finding("pressure_range", "refused", text)
    else:
        runs = f"{name} runs from {spoken(name, seen.lowest)} to {spoken(name, seen.highest)}"
        yield Finding("pressure_range", "ok", runs)
    yield from _alive(name, "pressure", seen, limits.least_pressure_span_pa, limits)


def drive_force(name: str, seen: Survey, limits: CheckLimits) -> Iterator[Finding]:
    """Judges a drive force as a pressure is judged; nobody knows its range."""
    yield from _alive(name, "force", seen, limits.least_force_span_n, limits)


def _alive(name: str, kind: str, seen: Survey, least: float, limits: CheckLimits) -> Iterator[Finding]:
    unit = "Pa" if kind == "pressure" else "N"
    if seen.span < least:
        what = "is constant" if seen.span == 0.0 else f"changes by {seen.span:.3g} {unit} only"
        wrong = "bar read as Pa?" if kind == "pressure" else "MN or kN read as N?"
        text = (
            f"{name} {what} (at {seen.highest:.4g} {unit}) while the cylinder moves; the sensor is stuck or not "
            f"connected, or the unit is wrong ({wrong})"
        )
        yield Finding(f"{kind}_alive", "refused", text)
        return
    yield Finding(f"{kind}_alive", "ok", f"{name} changes by {spoken(name, seen.span)}")
    if seen.stuck_travel_m <= limits.stuck_travel * limits.stroke_m:
        text = f"{name} stays exactly constant over {seen.stuck_travel_m:.3g} m of travel at most"
        yield Finding(f"{kind}_stuck", "ok", text)
        return
    yield Finding(
        f"{kind}_stuck",
        "refused",
        f"{name} stays at exactly {seen.stuck_at:.6g} {unit} from row {seen.stuck_from + 1} to row {seen.stuck_to} "
        f"while the piston travels {seen.stuck_travel_m:.3g} m; the sensor is stuck or at the end of its range",
    )

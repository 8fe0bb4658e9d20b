"""What a logged table must be before it counts as a recording: nothing unusable passes as good."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PRESSURES = ("pressure_1_pa", "pressure_2_pa")


@dataclass(frozen=True)
class CheckLimits:
    """What is plausible for a cylinder.

    Attributes:
        stroke_m: Length of travel [m].
        minimum_duration_s: A shorter recording is refused [s].
        rate_tolerance: How far one step of time may be from the median step, as a share of it.
        lowest_pressure_pa: Gauge; vacuum and a sensor's offset [Pa].
        highest_pressure_pa: Beyond any hydraulic cylinder [Pa].
        least_pressure_span_pa: A live sensor on a moving cylinder shows more than this [Pa].
        position_slack: How far beyond the stroke position may read, as a share of it.
        least_travel: Less motion than this share of the stroke is none.
        stuck_travel: A pressure that stays exactly constant over this share of the stroke is stuck.
    """

    stroke_m: float
    minimum_duration_s: float = 5.0
    rate_tolerance: float = 0.2
    lowest_pressure_pa: float = -2e5
    highest_pressure_pa: float = 7e7
    least_pressure_span_pa: float = 1e3
    position_slack: float = 0.05
    least_travel: float = 0.01
    stuck_travel: float = 0.25


def check_recording(metadata: RecordingMetadata, table: pd.DataFrame, limits: CheckLimits) -> Recording:
    """Returns the recording, its sample time taken from its time column.

    Args:
        metadata: Who and when; its sample time is replaced.
        table: Columns in SI units, at least ``REQUIRED_COLUMNS``.
        limits: What is plausible.

    Raises:
        RecordingError: The first problem found: a value is not finite, time does not run at one constant rate, the
            recording is too short, a pressure or the position lies outside what the cylinder can do (mostly a
            wrong unit or sign), a pressure is stuck, or nothing moves. Rows count from 1 below the header.
    """
    _finite(table)
    time_s = table["time_s"].to_numpy(dtype=np.float64)
    sample_time_s = constant_sample_time(time_s, limits.rate_tolerance)
    duration_s = len(time_s) * sample_time_s
    if duration_s < limits.minimum_duration_s:
        raise RecordingError(
            f"lasts {duration_s:.3g} s ({len(time_s)} rows), expected at least {limits.minimum_duration_s:.3g} s; "
            "log longer or lower ingest.minimum_duration_s"
        )
    position_m = table["position_m"].to_numpy(dtype=np.float64)
    _position(position_m, limits)
    for column in PRESSURES:
        _pressure(column, table[column].to_numpy(dtype=np.float64), position_m, limits)
    return Recording(replace(metadata, sample_time_s=sample_time_s), table)


def constant_sample_time(time_s: Array, tolerance: float) -> float:
    """Returns the time between two rows [s]; a rate within 1e-4 of a whole number of hertz is that number.

    Raises:
        RecordingError: Fewer than three rows, time that stands or runs backwards, or a step that is off by more
            than ``tolerance`` of the median step (a gap, a lost sample).
    """
    if len(time_s) < 3:
        raise RecordingError(f"has {len(time_s)} rows, expected at least 3")
    steps = np.diff(time_s)
    backwards = np.flatnonzero(steps <= 0.0)
    if len(backwards):
        row = int(backwards[0]) + 1
        raise RecordingError(
            f"time_s does not increase: {time_s[row]:.9g} s in row {row + 1} follows {time_s[row - 1]:.9g} s "
            f"({len(backwards)} such rows in all); expected strictly increasing time; sort or cut the log"
        )
    median = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - median) > tolerance * median)
    if len(uneven):
        row = int(uneven[0]) + 1
        raise RecordingError(
            f"time_s is not at a constant rate: {steps[row - 1]:.6g} s before row {row + 1}, elsewhere {median:.6g} s "
            f"({len(uneven)} such rows in all); a sample is lost or the log was paused; cut it there"
        )
    rate_hz = (len(time_s) - 1) / float(time_s[-1] - time_s[0])
    whole_hz = round(rate_hz)
    return 1.0 / whole_hz if abs(rate_hz - whole_hz) <= 1e-4 * rate_hz else 1.0 / rate_hz


def _finite(table: pd.DataFrame) -> None:
    for column in table.columns:
        bad = np.flatnonzero(~np.isfinite(table[column].to_numpy(dtype=np.float64)))
        if len(bad):
            raise RecordingError(
                f"{column} is {table[column].iloc[bad[0]]} in row {bad[0] + 1} ({len(bad)} such rows in all); "
                "expected finite numbers; repair or cut the log"
            )


def _position(position_m: Array, limits: CheckLimits) -> None:
    stroke_m, slack_m = limits.stroke_m, limits.position_slack * limits.stroke_m
    lowest, highest = float(position_m.min()), float(position_m.max())
    if lowest < -slack_m or highest > stroke_m + slack_m:
        row = int(np.argmax(np.maximum(-position_m, position_m - stroke_m)))
        raise RecordingError(
            f"position_m is {position_m[row]:.4g} m in row {row + 1} (it runs from {lowest:.4g} to {highest:.4g} m), "
            f"expected 0 to {stroke_m:.4g} m, the stroke; check unit (mm read as m?), sign and zero of the sensor"
        )
    least_m = limits.least_travel * stroke_m
    if highest - lowest < least_m:
        raise RecordingError(
            f"position_m moves by {highest - lowest:.3g} m only, expected at least {least_m:.3g} m; nothing moves, the "
            "sensor is stuck, or its unit is wrong (m read as mm?)"
        )


def _pressure(column: str, pressure_pa: Array, position_m: Array, limits: CheckLimits) -> None:
    lowest, highest = float(pressure_pa.min()), float(pressure_pa.max())
    if lowest < limits.lowest_pressure_pa or highest > limits.highest_pressure_pa:
        row = int(
            np.argmax(np.maximum(limits.lowest_pressure_pa - pressure_pa, pressure_pa - limits.highest_pressure_pa))
        )
        raise RecordingError(
            f"{column} is {pressure_pa[row] / 1e5:.4g} bar in row {row + 1}, expected "
            f"{limits.lowest_pressure_pa / 1e5:.4g} to {limits.highest_pressure_pa / 1e5:.4g} bar gauge; "
            "check unit (Pa or kPa read as bar?) and sign"
        )
    if highest - lowest < limits.least_pressure_span_pa:
        what = "is constant" if highest == lowest else f"changes by {highest - lowest:.3g} Pa only"
        raise RecordingError(
            f"{column} {what} (at {highest:.4g} Pa) while the cylinder moves; the sensor is stuck or not connected, "
            "or the unit is wrong (bar read as Pa?)"
        )
    start, end, travel_m = _longest_stuck_travel(pressure_pa, position_m)
    if travel_m > limits.stuck_travel * limits.stroke_m:
        raise RecordingError(
            f"{column} stays at exactly {pressure_pa[start]:.6g} Pa from row {start + 1} to row {end} while the "
            f"piston travels {travel_m:.3g} m; the sensor is stuck or at the end of its range"
        )


def _longest_stuck_travel(pressure_pa: Array, position_m: Array) -> tuple[int, int, float]:
    """Returns first row, end row and travel [m] of the constant stretch over which the piston goes furthest."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(pressure_pa) != 0.0) + 1])
    travel = np.maximum.reduceat(position_m, starts) - np.minimum.reduceat(position_m, starts)
    longest = int(np.argmax(travel))
    end = int(starts[longest + 1]) if longest + 1 < len(starts) else len(pressure_pa)
    return int(starts[longest]), end, float(travel[longest])

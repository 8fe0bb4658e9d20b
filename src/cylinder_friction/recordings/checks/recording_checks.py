"""What an evenly sampled table must be before it counts as a recording: nothing unusable passes as good."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.checks import column_checks
from cylinder_friction.recordings.checks.finding import Finding, spoken
from cylinder_friction.recordings.checks.plausibility import judge_friction
from cylinder_friction.recordings.columns import DRIVE_FORCE, PRESSURES, REQUIRED_COLUMNS, missing_columns
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd
    from numpy.typing import NDArray

    from cylinder_friction.recordings.checks.column_checks import Survey
    from cylinder_friction.recordings.checks.limits import CheckLimits

    Array = NDArray[np.float64]

RATE_TOLERANCE = 1e-3
"""A logger's clock may be off by this share of its rate."""


def check_recording(
    metadata: RecordingMetadata, table: pd.DataFrame, limits: CheckLimits, sample_time_s: float
) -> Recording:
    """Return the recording; what the checks only noted stands among its repairs.

    Args:
        metadata: Who and when; its sample time is replaced.
        table: Evenly sampled columns in SI units, at least ``REQUIRED_COLUMNS``, or a drive force for the pressures.
        limits: What is plausible.
        sample_time_s: Constant time between two rows [s].

    Raises:
        RecordingError: The first finding that is a refusal, see ``inspect_recording``.
    """
    noted = []
    for finding in _findings(table, limits, sample_time_s):
        if finding.outcome == "refused":
            raise RecordingError(finding.text)
        if finding.outcome == "noted":
            noted.append(finding.text)
    return Recording(replace(metadata, sample_time_s=sample_time_s, repairs=(*metadata.repairs, *noted)), table)


def inspect_recording(table: pd.DataFrame, limits: CheckLimits, sample_time_s: float) -> list[Finding]:
    """Return what every check finds, refusals and all; a table with holes in it is looked at no further.

    The names of the checks, in their order: ``columns``, ``length``, ``finite``, ``rate``, ``position_range``,
    ``motion``, ``position_stuck``; for each pressure ``pressure_range``, ``pressure_alive``, ``pressure_stuck``, for
    both ``pressures_differ`` and ``unit_plausible``, or in their place ``force_alive`` and ``force_stuck``;
    ``load_alive``; ``direction`` and ``friction_size``. The last two need signals that passed and known areas.

    Args:
        table: As for ``check_recording``. Rows count from 1.
        limits: What is plausible.
        sample_time_s: Constant time between two rows [s].
    """
    return list(_findings(table, limits, sample_time_s))


def _findings(table: pd.DataFrame, limits: CheckLimits, sample_time_s: float) -> Iterator[Finding]:
    missing = missing_columns(table.columns)
    if missing:
        yield Finding(
            "columns",
            "refused",
            f"column {missing[0]!r} is missing; got columns {list(table.columns)}, expected at least "
            f"{list(REQUIRED_COLUMNS)} (or time_s, position_m and {DRIVE_FORCE}); map it to a channel",
        )
        return
    if len(table) < 3:
        yield Finding("length", "refused", f"has {len(table)} rows, expected at least 3")
        return
    columns = {str(name): table[name].to_numpy(dtype=np.float64) for name in table.columns}
    seen = {name: column_checks.survey(values, columns["position_m"]) for name, values in columns.items()}
    finite = column_checks.finite(columns, seen)
    yield finite
    if finite.outcome == "refused":
        return
    yield _length(len(table), sample_time_s, limits)
    yield _rate(sample_time_s, limits)
    sound = True
    for finding in _of_signals(columns, seen, limits, sample_time_s):
        sound = sound and finding.outcome != "refused"
        yield finding
    if sound and (DRIVE_FORCE in columns or limits.areas_m2 is not None):
        yield from judge_friction(table, sample_time_s, limits.stroke_m, limits.areas_m2, limits.load)


def _of_signals(
    columns: dict[str, Array], seen: dict[str, Survey], limits: CheckLimits, sample_time_s: float
) -> Iterator[Finding]:
    yield column_checks.position_range(seen["position_m"], limits)
    yield column_checks.motion(seen["position_m"], limits)
    yield column_checks.position_stuck(columns["position_m"], sample_time_s, limits)
    if DRIVE_FORCE in columns:
        yield from column_checks.drive_force(DRIVE_FORCE, seen[DRIVE_FORCE], limits)
    else:
        for name in PRESSURES:
            yield from column_checks.pressure(name, seen[name], limits)
        yield _pressures_differ(columns)
        yield _unit_plausible(seen, limits)
    if limits.load == "measured" and "load_force_n" in columns:
        yield _load_alive(seen["load_force_n"])


def _length(rows: int, sample_time_s: float, limits: CheckLimits) -> Finding:
    duration_s = rows * sample_time_s
    text = f"lasts {duration_s:.3g} s ({rows} rows)"
    if duration_s >= limits.minimum_duration_s:
        return Finding("length", "ok", text)
    text += (
        f", expected at least {limits.minimum_duration_s:.3g} s; log longer or lower ingest.checks.minimum_duration_s"
    )
    return Finding("length", "refused", text)


def _rate(sample_time_s: float, limits: CheckLimits) -> Finding:
    rate_hz = 1.0 / sample_time_s
    if rate_hz >= limits.minimum_rate_hz * (1.0 - RATE_TOLERANCE):
        return Finding("rate", "ok", f"is sampled at {rate_hz:.4g} Hz")
    text = (
        f"is sampled at {rate_hz:.4g} Hz, expected at least {limits.minimum_rate_hz:.4g} Hz; the filters would smear "
        "starts, stops and reversals over each other; log faster, or correct the unit of time_s (ms read as s?)"
    )
    return Finding("rate", "refused", text)


def _pressures_differ(columns: dict[str, Array]) -> Finding:
    """Judges two pressures that are the same in every row: one channel logged twice."""
    if np.array_equal(columns[PRESSURES[0]], columns[PRESSURES[1]]):
        text = (
            "pressure_1_pa and pressure_2_pa are equal in every row, which no two sensors are; one channel was logged "
            "twice or mapped twice; correct the mapping"
        )
        return Finding("pressures_differ", "refused", text)
    return Finding("pressures_differ", "ok", "the two pressures differ")


def _unit_plausible(seen: dict[str, Survey], limits: CheckLimits) -> Finding:
    """Judges a recording that never has any pressure: its unit is too small, or nobody switched on the supply."""
    name = max(PRESSURES, key=lambda column: seen[column].highest)
    peak = f"the highest pressure in the whole recording is {spoken(name, seen[name].highest)} ({name})"
    if seen[name].highest >= limits.least_peak_pressure_pa:
        return Finding("unit_plausible", "ok", peak)
    text = (
        f"{peak}, expected at least {limits.least_peak_pressure_pa / 1e5:.4g} bar; check the unit (MPa read as bar, "
        "kPa as Pa?) and that the supply was on, or lower least_peak_pressure_pa for pneumatics"
    )
    return Finding("unit_plausible", "refused", text)


def _load_alive(seen: Survey) -> Finding:
    if seen.span > 0.0:
        return Finding("load_alive", "ok", f"load_force_n changes by {spoken('load_force_n', seen.span)}")
    text = f"load_force_n is constant (at {seen.highest:.4g} N); the load cell is idle, stuck or not connected"
    return Finding("load_alive", "noted", text)

"""The table of sessions: one Parquet file per cylinder with a row per session, made from the results of `estimate`."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction import Recording
from cylinder_friction.estimation.results import friction_of, kept_recordings
from cylinder_friction.files.whole_files import json_hash
from cylinder_friction_monitoring.trends.assessment import IndicatorTrend
from cylinder_friction_monitoring.trends.moments import corrected
from cylinder_friction_monitoring.trends.session_row import COVARIATES, INDICATORS, Indicator, SessionRow

MadeRow = Callable[[Sequence[Recording]], SessionRow]
TEXT = ("cylinder", "session", "start", "start_source", "left_out")
TESTED = ("compensated", "upward", "downward")
"""Further columns of each tested indicator: its value at the reference covariates, and the two CUSUM statistics."""
_DETAIL = "detail"  # Column with the row and the hashes of its sources as JSON


@dataclass(frozen=True)
class KeptRow:
    """A session's row, as kept between two runs."""

    row: SessionRow  # The row, with the start that its log states
    key: str  # SHA-256 of its recordings, code and settings
    placed: str = ""  # Its start as a night placed it, by its log or the fleet file
    late: bool = False  # Whether it came too late to be assessed


def key_of(recordings: Sequence[Mapping[str, Any]], made_by: str) -> str:
    """Hash what a session's row is made from: its recordings, and the code and settings in ``made_by``."""
    about = [{**each, "gone": "", "outdated": "", "source_file": ""} for each in recordings]
    return json_hash([made_by, about])


def updated_rows(
    results: Path, kept: Mapping[str, KeptRow], made_row: MadeRow, made_by: str
) -> tuple[dict[str, KeptRow], dict[str, str]]:
    """Make the rows of new sessions in a folder of ``estimate_logs``, and keep those of the run before.

    If ``made_by`` (code and settings) has changed, all rows are made again. Return the rows by session, and the reasons
    why other sessions have no row.
    """
    rows, failed = dict[str, KeptRow](), dict[str, str]()
    for session, recordings in sorted(kept_recordings(results).items()):
        key = key_of(recordings, made_by)
        if session in kept and kept[session].key == key:
            rows[session] = kept[session]
            continue
        try:
            read = [friction_of(results, each["name"]) for each in recordings]
            rows[session] = KeptRow(made_row(read), key)
        except (ValueError, OSError) as error:
            failed[session] = f"no indicators: {error}"
    return rows, failed


def with_starts(rows: Iterable[KeptRow], starts: Mapping[str, str]) -> list[SessionRow]:
    """Sort rows by their start; ``starts`` corrects it for sessions and patterns of sessions."""
    placed = list[SessionRow]()
    for each in rows:
        row = each.row
        if stated := stated_start(row.session, starts):
            start = corrected(row.start, stated, f"starts: {row.session}")
            row = replace(row, start=start, start_source="fleet.yaml")
        placed.append(row)
    return sorted(placed, key=lambda row: (row.start, row.session))


def stated_start(session: str, starts: Mapping[str, str]) -> str:
    """Look up what the fleet file states of a session's start; the first name or pattern that fits counts."""
    return next((stated for name, stated in starts.items() if name == session or fnmatchcase(session, name)), "")


def write_rows(
    path: Path,
    rows: Sequence[SessionRow],
    kept: Mapping[str, KeptRow],
    left_out: Mapping[str, str],
    trends: Mapping[str, IndicatorTrend],
) -> None:
    """Write a cylinder's table of sessions; equal content gives equal bytes."""
    columns: dict[str, list[Any]] = {name: [] for name in (*TEXT, *numbers(), _DETAIL)}
    tested = {
        name: dict(zip(each.sessions, zip(each.compensated, each.upward, each.downward, strict=True), strict=True))
        for name, each in trends.items()
    }
    for row in rows:
        own = kept[row.session]
        values: dict[str, Any] = {name: getattr(row, name) for name in (*TEXT[:4], "duration_s")}
        values |= {"left_out": left_out.get(row.session, ""), **{name: row.covariates.get(name) for name in COVARIATES}}
        for name in INDICATORS:
            indicator = row.indicators.get(name, Indicator(None))
            of_trend = tested.get(name, {}).get(row.session, (None,) * len(TESTED))
            values |= {name: indicator.value, f"{name}_uncertainty": indicator.uncertainty}
            values |= {f"{name}_{part}": value for part, value in zip(TESTED, of_trend, strict=True)}
        detail = {**vars(own), "row": own.row.to_dict(), "placed": row.start}
        values[_DETAIL] = json.dumps(detail, sort_keys=True, allow_nan=False)
        for name, value in values.items():
            columns[name].append(value)
    types = {name: pa.string() if name in (*TEXT, _DETAIL) else pa.float64() for name in columns}
    path.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table({name: pa.array(values, types[name]) for name, values in columns.items()})
    pq.write_table(table, path, compression="zstd")


def read_rows(path: Path) -> dict[str, KeptRow]:
    """Read the sessions that the run before kept for a cylinder, by name."""
    kept = [json.loads(text) for text in pq.read_table(path, columns=[_DETAIL], use_threads=False)[0].to_pylist()]
    rows = [(SessionRow.from_dict(each["row"]), each) for each in kept]
    return {
        row.session: KeptRow(row, each["key"], each.get("placed", ""), each.get("late", False)) for row, each in rows
    }


def numbers() -> list[str]:
    """List the numeric columns of the table."""
    parts = ("", "_uncertainty", *(f"_{part}" for part in TESTED))
    return ["duration_s", *(f"{name}{part}" for name in INDICATORS for part in parts), *COVARIATES]

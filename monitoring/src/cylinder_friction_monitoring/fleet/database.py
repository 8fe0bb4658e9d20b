"""Copy a fleet's results into tables of SQLite or PostgreSQL, cylinder by cylinder."""

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pyarrow.parquet as pq

from cylinder_friction.files.whole_files import read_json
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet.files import session_file, state_file
from cylinder_friction_monitoring.fleet.sessions import TEXT, numbers
from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine

SQLITE_FILE = "health.sqlite"
_BASELINE = ("level", "scatter", "autocorrelation", "threshold", "false_alarms_per_year", "smallest")
_CHANGE = ("change", "change_low", "change_high", "percent", "percent_low", "percent_high", "per_year")
_TYPES = dict.fromkeys(("needs", "sessions", "left_out"), "integer")
_TYPES |= dict.fromkeys((*_BASELINE, *_CHANGE), "double precision")
_COLUMNS = {
    "health_cylinder": "cylinder answer ne107 words needs sessions left_out last_session last_start acknowledged look "
    "state",
    "health_change": "cylinder indicator change change_low change_high percent percent_low percent_high per_year since "
    "alarm_session limit_reached",
    "health_baseline": "cylinder indicator sessions level scatter autocorrelation threshold false_alarms_per_year "
    "smallest first last",
    "health_entry": "cylinder time name kind words",
}
TABLES: Mapping[str, Mapping[str, str]] = {
    "health_session": dict.fromkeys(TEXT, "text") | dict.fromkeys(numbers(), "double precision"),
    **{table: {name: _TYPES.get(name, "text") for name in names.split()} for table, names in _COLUMNS.items()},
}
"""Columns and types of each table. Times are ISO 8601 in UTC; numbers are in the units of their names."""


def update_database(
    address: str, folder: Path, lines: Sequence[CylinderLine], entries: Mapping[str, Sequence[Entry]]
) -> int:
    """Bring the tables up to the folder of results in one transaction. Return how many cylinders changed.

    Without an ``address`` (``postgresql://...``) the tables are in an SQLite file in the folder. Cylinders that are not
    among ``lines`` are removed. ``MonitoringError`` is raised if the database cannot be reached or written.
    """
    mark = "?"
    errors: tuple[type[Exception], ...] = (sqlite3.Error,)
    connection: Any
    host = urlsplit(address)
    where = f"{host.hostname}{host.path}" if address else str(folder / SQLITE_FILE)  # without the password
    try:
        if address:
            try:
                import psycopg2  # type: ignore[import-untyped]
            except ModuleNotFoundError:
                raise MonitoringError(
                    "the tables in PostgreSQL need psycopg2, which is not installed; pip install "
                    '"cylinder-friction-monitoring[postgres]"'
                ) from None
            mark, errors = "%s", (psycopg2.Error,)
            connection = psycopg2.connect(address)
        else:
            connection = sqlite3.connect(folder / SQLITE_FILE, timeout=30.0)
        with closing(connection), connection:
            return _update(connection, mark, folder, lines, entries)
    except errors as error:
        problem = " ".join(str(error).split())
        raise MonitoringError(
            f"the tables in {where} are not up to date: {problem}; the page and the files are written, and the next "
            "run brings the tables up to them"
        ) from error


def _update(
    connection: Any, mark: str, folder: Path, lines: Sequence[CylinderLine], entries: Mapping[str, Sequence[Entry]]
) -> int:
    cursor = connection.cursor()
    for table, columns in TABLES.items():
        cursor.execute(f"CREATE TABLE IF NOT EXISTS {table} ({', '.join(f'{n} {t}' for n, t in columns.items())})")
    cursor.execute("CREATE INDEX IF NOT EXISTS health_session_of ON health_session (cylinder, start)")
    cursor.execute("SELECT * FROM health_cylinder")
    held = {row[0]: row for row in cursor.fetchall()}
    wanted = {each.cylinder: _cylinder(each) for each in lines}
    stale = [name for name in held.keys() | wanted.keys() if held.get(name) != wanted.get(name)]
    for name in sorted(stale):
        for table in TABLES:
            cursor.execute(f"DELETE FROM {table} WHERE cylinder = {mark}", (name,))  # noqa: S608 - names of our own
        if name not in wanted:
            continue
        about = read_json(folder / state_file(name))["assessment"]
        sessions = pq.read_table(folder / session_file(name), columns=list(TABLES["health_session"]), use_threads=False)
        _insert(cursor, mark, "health_cylinder", [wanted[name]])
        _insert(cursor, mark, "health_change", [_change(name, each) for each in about["changes"]])
        bases = [(key, each) for key, each in about["trends"].items() if each]
        _insert(cursor, mark, "health_baseline", [_of("health_baseline", name, key, each) for key, each in bases])
        _insert(cursor, mark, "health_session", zip(*(column.to_pylist() for column in sessions.columns), strict=True))
        own = [(each.cylinder, each.time, each.name, each.kind, each.stated) for each in entries.get(name, ())]
        _insert(cursor, mark, "health_entry", own)
    return len(stale)


def _insert(cursor: Any, mark: str, table: str, rows: Iterable[Sequence[Any]]) -> None:
    marks = ", ".join([mark] * len(TABLES[table]))
    cursor.executemany(f"INSERT INTO {table} VALUES ({marks})", list(rows))  # noqa: S608 - names of our own


def _cylinder(line: CylinderLine) -> tuple[Any, ...]:
    return tuple(line.rank if name == "needs" else getattr(line, name) for name in TABLES["health_cylinder"])


def _change(name: str, change: Mapping[str, Any]) -> tuple[Any, ...]:
    low, high = change["interval"]
    percent_low, percent_high = change["percent_interval"] or (None, None)
    ends = {"change_low": low, "change_high": high, "percent_low": percent_low, "percent_high": percent_high}
    return _of("health_change", name, change["indicator"], {**change, **ends})


def _of(table: str, cylinder: str, indicator: str, values: Mapping[str, Any]) -> tuple[Any, ...]:
    known = {**values, "cylinder": cylinder, "indicator": indicator}
    return tuple(known[name] for name in TABLES[table])

"""One call for every format."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from cylinder_friction.recordings.formats.clocks import oldest_first, with_dates
from cylinder_friction.recordings.formats.format import guarded
from cylinder_friction.recordings.formats.isolated import read_isolated
from cylinder_friction.recordings.formats.layout import AUTOMATIC, CsvOptions
from cylinder_friction.recordings.formats.logged_table import LoggedTable, LongTable
from cylinder_friction.recordings.formats.registry import format_of
from cylinder_friction.recordings.formats.source import FileSource, Head, open_source, read_head
from cylinder_friction.recordings.recording import RecordingError

MOST_WHOLE = 2 * 10**9
"""A file of a format that is not read in parts is read up to this size [bytes]."""


def read_logged_file(
    path: Path,
    file_format: str = "auto",
    csv: CsvOptions = AUTOMATIC,
    wanted: Collection[str] | None = None,
    *,
    database: Path | None = None,
    source: FileSource | None = None,
) -> list[LoggedTable]:
    """Return what a logger's file holds, one table for channels that share their rows.

    Args:
        file_format: One of ``registry.SETTINGS``, or ``auto`` to go by the content.
        csv: How text is to be read; by default everything is found out.
        wanted: Names of the channels to load; the others are only named, as ``unread``. None loads all.
        database: Of a bus (DBC), with which the frames in a measurement file are decoded.
        source: The file, if it is open.

    Raises:
        RecordingError: The file cannot be opened or read, is damaged, or holds no channels with rows.
        ValueError: The format is not known.
    """
    begin = read_head(path) if source is None else Head(source.head, zipped=False)
    found = format_of(path, file_format, begin.content)
    found.refuse_missing_library()
    if database is not None and not (found.databases and database.is_file()):
        raise RecordingError(
            f"database {database}: "
            + ("no such file" if found.databases else f"is for an MDF file of bus frames, not for {found.what}")
        )
    if found.crashes:
        tables = read_isolated(path, found, wanted, database)
    else:
        source = source or open_source(path, begin)
        with guarded(found.what):
            tables = found.read(source, wanted, csv) if found.options else found.read(source, wanted)
    if not any(len(table.channels) or table.unread for table in tables):
        raise RecordingError("holds no channel with a row; expected a table of numbers")
    return [oldest_first(with_dates(table)) for table in tables]


def open_logged_file(
    path: Path,
    rows: int | None,
    file_format: str = "auto",
    csv: CsvOptions = AUTOMATIC,
    wanted: Collection[str] | None = None,
    *,
    database: Path | None = None,
) -> LongTable | list[LoggedTable]:
    """Return what ``read_logged_file`` does, or one table of more rows than these, to be read in parts of so many.

    Text and Parquet are read part by part; of another format a large file is refused. Without ``rows`` every file is
    read whole. Other arguments and errors are those of ``read_logged_file``.
    """
    if rows is None:
        return read_logged_file(path, file_format, csv, wanted, database=database)
    begin, size = read_head(path), path.stat().st_size
    found = format_of(path, file_format, begin.content)
    if found.read_long is None and size > MOST_WHOLE:
        raise RecordingError(
            f"has {size / 1e9:.2g} GB, and {found.name} files are read whole, up to {MOST_WHOLE / 1e9:.2g} GB; export "
            "it as Parquet or CSV, which are read in parts, or split it"
        )
    source = None if found.read_long is None else open_source(path, begin)
    if source is not None and found.read_long is not None and source.size > rows:  # no row is shorter than a byte
        with guarded(found.what):
            table = found.read_long(source, wanted, rows, *((csv,) if found.options else ()))
        if table is not None:
            return replace(table, chunks=partial(_guarded, table.chunks, found.what))
    tables = read_logged_file(path, found.configured, csv, wanted, database=database, source=source)
    return _sliced(tables[0], rows) if len(tables) == 1 and len(tables[0].channels) > rows else tables


def _sliced(table: LoggedTable, rows: int) -> LongTable:
    def part(first: int, count: int, notes: tuple[str, ...] = ()) -> LoggedTable:
        return replace(table, channels=table.channels.iloc[first : first + count], notes=notes)

    count = len(table.channels)
    return LongTable(
        -(-count // rows),
        lambda: (part(first, rows, () if first else table.notes) for first in range(0, count, rows)),
    )


def _guarded(tables: Callable[[], Iterator[LoggedTable]], what: str) -> Iterator[LoggedTable]:
    read = tables()
    while True:
        with guarded(what):
            table = next(read, None)
        if table is None:
            return
        yield with_dates(table)

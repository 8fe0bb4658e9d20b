"""One call for every format."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from cylinder_friction.recordings.formats.delimited import long_delimited, read_delimited
from cylinder_friction.recordings.formats.detect import FORMATS, HDF5_SIGNATURE, advice, format_of
from cylinder_friction.recordings.formats.isolated import read_isolated
from cylinder_friction.recordings.formats.libraries import guarded
from cylinder_friction.recordings.formats.logged_table import PLACES, ROWS_A_PLACE, LoggedTable, LongTable
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.formats.parquet import long_parquet, read_parquet
from cylinder_friction.recordings.formats.source import open_source, read_head
from cylinder_friction.recordings.recording import RecordingError

_AUTOMATIC = CsvOptions()

MOST_WHOLE = 2 * 10**9
"""A binary file other than Parquet is read up to this size [bytes]."""
LEAST_BYTES_A_ROW = 1
"""No row is shorter, so that a smaller file need not be looked at twice."""


def read_logged_file(
    path: Path,
    file_format: str = "auto",
    csv: CsvOptions = _AUTOMATIC,
    wanted: Collection[str] | None = None,
) -> list[LoggedTable]:
    """Return what a logger's file holds, one table for channels that share their rows.

    Args:
        file_format: One of ``FORMATS``, or ``auto`` to go by the content.
        csv: How text is to be read; by default everything is found out.
        wanted: Names of the channels to load; the others are only named, as ``unread``. None loads all.

    Raises:
        RecordingError: The file cannot be opened or read, is damaged, or holds no channels with rows.
        ValueError: The format is not known.
    """
    kind = _kind(path, file_format)
    if kind == "csv":
        source = open_source(path)
        with guarded("a text table"):
            tables = read_delimited(source, csv, wanted)
    elif kind == "parquet":  # hundreds of hours come this way, and Arrow stands damage
        source = open_source(path)
        with guarded("a Parquet file"):
            tables = read_parquet(source, wanted)
    else:
        tables = read_isolated(path, kind, wanted)
    if not any(len(table.channels) or table.unread for table in tables):
        raise RecordingError("holds no channel with a row; expected a table of numbers")
    return tables


def open_logged_file(
    path: Path,
    rows: int,
    file_format: str = "auto",
    csv: CsvOptions = _AUTOMATIC,
    wanted: Collection[str] | None = None,
) -> LongTable | list[LoggedTable]:
    """Return what ``read_logged_file`` does, or one table of more rows than these, to be read in parts of so many.

    Text and Parquet are read part by part; of another format a large file is refused. Other arguments and errors are
    those of ``read_logged_file``.
    """
    kind, size = _kind(path, file_format), path.stat().st_size
    if kind in ("csv", "parquet"):
        source, what = open_source(path), "a text table" if kind == "csv" else "a Parquet file"
        if source.size > rows * LEAST_BYTES_A_ROW:
            with guarded(what):
                table = long_delimited(source, csv, wanted, rows) if kind == "csv" else None
                table = table or (long_parquet(source, wanted, rows) if kind == "parquet" else None)
            if table is not None:
                guard = partial(_guarded, what=what)
                return replace(table, chunks=partial(guard, table.chunks), spread=partial(guard, table.spread))
    elif size > MOST_WHOLE:
        raise RecordingError(
            f"has {size / 1e9:.2g} GB, and {kind} files are read whole, up to {MOST_WHOLE / 1e9:.2g} GB; export it as "
            "Parquet or CSV, which are read in parts, or split it"
        )
    tables = read_logged_file(path, file_format, csv, wanted)
    return _sliced(tables[0], rows) if len(tables) == 1 and len(tables[0].channels) > rows else tables


def _sliced(table: LoggedTable, rows: int) -> LongTable:
    def part(first: int, count: int, notes: tuple[str, ...] = ()) -> LoggedTable:
        return replace(table, channels=table.channels.iloc[first : first + count], notes=notes)

    count = len(table.channels)
    return LongTable(
        -(-count // rows),
        lambda: (part(first, rows, () if first else table.notes) for first in range(0, count, rows)),
        lambda: (part(first, ROWS_A_PLACE) for first in range(0, count, max(1, count // PLACES))),
    )


def _guarded(tables: Callable[[], Iterator[LoggedTable]], what: str) -> Iterator[LoggedTable]:
    read = tables()
    while True:
        with guarded(what):
            table = next(read, None)
        if table is None:
            return
        yield table


def _kind(path: Path, file_format: str) -> str:
    """Return the format of a file, of MATLAB's two which; refuse what is none."""
    if file_format not in ("auto", *FORMATS):
        raise ValueError(f"format {file_format!r} is not known; expected auto or one of {', '.join(FORMATS)}")
    head = read_head(path)
    try:
        kind = format_of(head) if file_format == "auto" else file_format
    except RecordingError as error:
        raise RecordingError(f"{error}{advice(path.suffix)}") from None
    if kind == "matlab" and (head[512:].startswith(HDF5_SIGNATURE) or head.startswith(b"MATLAB 7.3")):
        return "matlab73"
    return kind

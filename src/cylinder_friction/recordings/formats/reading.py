"""One call for every format: the content of a file shows which of them it has."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from cylinder_friction.recordings.formats import delimited, excel, hdf5, matlab, mdf, parquet, tdms
from cylinder_friction.recordings.formats.clocks import oldest_first, with_dates
from cylinder_friction.recordings.formats.format import Format, guarded
from cylinder_friction.recordings.formats.isolated import read_isolated
from cylinder_friction.recordings.formats.layout import AUTOMATIC, CsvOptions
from cylinder_friction.recordings.formats.logged_table import LoggedTable, LongTable
from cylinder_friction.recordings.formats.source import is_text, open_source
from cylinder_friction.recordings.recording import RecordingError

FORMATS = {
    each.name: each
    for each in (
        delimited.FORMAT,
        matlab.FORMAT,
        mdf.FORMAT,
        tdms.FORMAT,
        hdf5.FORMAT,
        matlab.FORMAT_73,  # HDF5 too, behind a block with MATLAB's name
        parquet.FORMAT,
        excel.FORMAT,
    )
}
"""Every format by its name."""
SETTINGS = tuple(dict.fromkeys(each.configured for each in FORMATS.values()))
"""What ``format`` may be in a configuration, beside ``auto``."""
MOST_WHOLE = 2 * 10**9
"""A file of a format that is not read in parts is read up to this size [bytes]."""

_OTHERS = {
    b"PK": "a ZIP file: unpack it; of a spreadsheet save the table as .xlsx or CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel or Word file: save the table as .xlsx or CSV",
    b"|CF,": "an imc FAMOS recording: export it as text (ASCII, CSV)",
    b"TDSh": "the index of a TDMS file: take the .tdms file itself",
    b"SQLite format 3": "an SQLite database: export the table as CSV",
    b"{": "JSON: export the table as CSV",
    b"<": "XML or a web page: export the table as CSV",
}
_OWN_FILES = {
    ".svdx": "; if it is a TwinCAT Scope's, export it as CSV with a time column for each sample time",
    ".dat": "; if it is of iba, extract it as ASCII or TDMS; if of imc, export it as text (ASCII, CSV)",
    ".raw": "; if it is of imc, export it as text (ASCII, CSV)",
    ".bin": "; if it is catman's, export it as text (ASCII)",
    ".blf": "; if it is a trace of a bus, decode it with the bus's database and save the signals as MDF 4",
}
"""Endings of what measurement programs write for themselves, and what they export that is read here."""


def format_of(head: bytes, setting: str = "auto", suffix: str = "") -> Format:
    """Return the format of a file by its first bytes and by what the configuration calls it.

    Raises:
        RecordingError: The file is of none of these formats; ``suffix``, its ending, shows what to export in its place.
        ValueError: The setting is not known.
    """
    if setting not in ("auto", *SETTINGS):
        raise ValueError(f"format {setting!r} is not known; expected auto or one of {', '.join(SETTINGS)}")
    possible = [each for each in FORMATS.values() if setting in ("auto", each.configured)]
    found = [each for each in possible if head.startswith(each.starts)] or [
        each for each in possible if each.fits and each.fits(head)
    ]
    if found or setting != "auto":
        return (found or possible)[0]
    other = next((f"is {name}" for start, name in _OTHERS.items() if head.startswith(start)), "")
    if not other and is_text(head):
        return delimited.FORMAT
    problem = other or f"is neither text nor a known binary log: it begins with {head[:8]!r}"
    raise RecordingError(f"{problem}; expected one of {', '.join(SETTINGS)}{_OWN_FILES.get(suffix.lower(), '')}")


def read_logged_file(
    path: Path,
    file_format: str = "auto",
    csv: CsvOptions = AUTOMATIC,
    wanted: Collection[str] | None = None,
    *,
    database: Path | None = None,
) -> list[LoggedTable]:
    """Return what a logger's file holds, one table for channels that share their rows.

    Args:
        file_format: One of ``SETTINGS``, or ``auto`` to go by the content.
        csv: How text is to be read; by default everything is found out.
        wanted: Names of the channels to load; the others are only named, as ``unread``. None loads all.
        database: Of a bus (DBC), with which the frames in a measurement file are decoded.

    Raises:
        RecordingError: The file cannot be opened or read, is damaged, or holds no channels with rows.
        ValueError: The format is not known.
    """
    tables = open_logged_file(path, None, file_format, csv, wanted, database=database)
    assert not isinstance(tables, LongTable)
    return tables


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
    source = open_source(path)
    found = format_of(source.head, file_format, path.suffix)
    found.refuse_missing_library()
    if database is not None and not found.databases:
        raise RecordingError(f"database {database}: is for an MDF file of bus frames, not for {found.what}")
    options = (csv,) if found.options else ()
    if found.crashes:
        if rows is not None and source.size > MOST_WHOLE:
            raise RecordingError(
                f"has {source.size / 1e9:.2g} GB, and {found.name} files are read whole, up to {MOST_WHOLE / 1e9:.2g} "
                "GB; export it as Parquet or CSV, which are read in parts, or split it"
            )
        tables = read_isolated(path, found, wanted, database)
    else:
        with guarded(found.what):
            if rows is not None and found.read_long is not None and source.size > rows:  # no row is without a byte
                long = found.read_long(source, wanted, rows, *options)
                if long is not None:
                    return replace(long, chunks=partial(_guarded, long.chunks, found.what))
            tables = found.read(source, wanted, *options)
    if not any(len(table.channels) or table.unread for table in tables):
        raise RecordingError("holds no channel with a row; expected a table of numbers")
    tables = [oldest_first(with_dates(table)) for table in tables]
    long_one = rows is not None and len(tables) == 1 and len(tables[0].channels) > rows
    return _sliced(tables[0], rows) if rows is not None and long_one else tables


def _sliced(table: LoggedTable, rows: int) -> LongTable:
    def part(first: int) -> LoggedTable:
        notes = () if first else table.notes
        return replace(table, channels=table.channels.iloc[first : first + rows], notes=notes)

    count = len(table.channels)
    return LongTable(-(-count // rows), lambda: map(part, range(0, count, rows)))


def _guarded(tables: Callable[[], Iterator[LoggedTable]], what: str) -> Iterator[LoggedTable]:
    read = tables()
    while True:
        with guarded(what):
            table = next(read, None)
        if table is None:
            return
        yield with_dates(table)

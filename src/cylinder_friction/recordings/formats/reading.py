"""Read logger files of every format through one function, which detects the format by content."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from cylinder_friction.recordings.formats import delimited, excel, hdf5, matlab, mdf, parquet, tdms
from cylinder_friction.recordings.formats.cells import oldest_first, with_dates
from cylinder_friction.recordings.formats.format import (
    AUTOMATIC,
    CsvOptions,
    Format,
    LoggedTable,
    guarded,
    is_text,
    open_source,
)
from cylinder_friction.recordings.formats.isolated import read_isolated
from cylinder_friction.recordings.recording import RecordingError

_MODULES = (delimited, matlab, mdf, tdms, hdf5, parquet, excel)
FORMATS: dict[str, Format] = {each.FORMAT.name: each.FORMAT for each in _MODULES}  # Every format by its name
MOST_WHOLE = 2 * 10**9  # Largest file of a format that cannot be read in parts [bytes]

_OTHERS = {
    b"PK": "a ZIP file: unpack it; of a spreadsheet save the table as .xlsx or CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel or Word file: save the table as .xlsx or CSV",
    b"|CF,": "an imc FAMOS recording: export it as text (ASCII, CSV)",
    b"TDSh": "the index of a TDMS file: take the .tdms file itself",
    b"SQLite format 3": "an SQLite database: export the table as CSV",
    b"date ": "a trace of CAN frames (ASC): export its signals as CSV or MDF",
    b";$FILEVERSION": "a trace of CAN frames (TRC): export its signals as CSV or MDF",
    b"{": "JSON: export the table as CSV",
    b"<": "XML or a web page: export the table as CSV",
}


def format_of(head: bytes) -> Format:
    """Determine the format of a file by its first bytes."""
    for each in FORMATS.values():
        if head.startswith(each.starts) or (each.fits and each.fits(head)):
            return each
    other = next((f"is {name}" for start, name in _OTHERS.items() if head.startswith(start)), "")
    if not other and is_text(head):
        return delimited.FORMAT
    problem = other or f"is neither text nor a known binary log: it begins with {head[:8]!r}"
    raise RecordingError(f"{problem}; expected one of {', '.join(FORMATS)}; export it so from its own program")


def read_logged_file(
    path: Path,
    csv: CsvOptions = AUTOMATIC,
    wanted: Collection[str] | None = None,
    *,
    database: Path | None = None,
    rows: int | None = None,
) -> list[LoggedTable]:
    """Read a logger's file: one table for the channels that share their rows.

    Args:
        csv: Options for text; by default everything is detected.
        wanted: Names of the channels to load; the others are only listed in ``unread``. None loads all. If a mapping
            states their units, the units by name: numbers with a stated unit are no dates.
        database: DBC file of the bus, to decode the frames in a measurement file.
        rows: Approximate rows per part of a longer single table: the first part is returned, ``more`` reads the others.
            Text and Parquet are read part by part; large files of other formats are refused. None reads all at once.
    """
    source = open_source(path)
    found = format_of(source.head)
    found.refuse_missing_library()
    if database is not None and "database" not in found.takes:
        raise RecordingError(f"database {database}: is for an MDF file of bus frames, not for {found.what}")
    given = {"csv": csv, "rows": rows, "database": database and database.absolute()}  # read elsewhere
    read = partial(found.read, wanted=wanted, **{name: given[name] for name in found.takes})
    if not found.crashes:
        with guarded(found.what):
            tables = read(source)
    elif rows is not None and source.size > MOST_WHOLE:
        raise RecordingError(
            f"has {source.size / 1e9:.2g} GB, and {found.name} files are read whole, up to {MOST_WHOLE / 1e9:.2g} "
            "GB; export it as Parquet or CSV, which are read in parts, or split it"
        )
    else:
        tables = read_isolated(path, found, read)
    if not any(len(table.channels) or table.unread for table in tables):
        raise RecordingError("holds no channel with a row; expected a table of numbers")
    stated = wanted if isinstance(wanted, Mapping) else {}
    if tables[0].more is not None:
        return [replace(with_dates(tables[0], stated), more=partial(_guarded, tables[0].more, found.what, stated))]
    tables = [oldest_first(with_dates(table, stated)) for table in tables]
    length = len(tables[0].channels)
    number = 1 if rows is None or len(tables) > 1 else max(1, round(length / rows))
    if number == 1:
        return tables
    step = -(-length // number)
    channels = (tables[0].channels.iloc[first : first + step] for first in range(0, length, step))
    parts = [replace(tables[0], channels=own) for own in channels]
    return [replace(parts[0], more=partial(iter, parts[1:]), parts=number)]


def _guarded(
    tables: Callable[[], Iterator[LoggedTable]], what: str, stated: Mapping[str, str]
) -> Iterator[LoggedTable]:
    read = tables()
    while True:
        with guarded(what):
            table = next(read, None)
        if table is None:
            return
        yield with_dates(table, stated)

"""MDF 3 and 4 (CANape, INCA, vector loggers) through asammdf."""

import io
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.format import Format, Library
from cylinder_friction.recordings.formats.logged_table import LoggedTable, named_columns, numeric
from cylinder_friction.recordings.formats.source import FileSource
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import Start

_LOCAL_TIME = 1  # Bit of a header's time flags (ASAM MDF 4.1)
_PLAIN_BUS_EVENT = 4  # Bit of a channel group's flags (ASAM MDF 4.1)


def read_mdf(source: FileSource, wanted: Collection[str] | None, database: str | None = None) -> list[LoggedTable]:
    """Return one table a channel group, its master (time) first; conversions are applied, text stays text.

    A sample that the file marks as invalid is NaN. Groups of raw bus frames are decoded with the bus's ``database``, a
    DBC file, and left out without one; a file of nothing else is then refused, and so is one that claims what it cannot
    hold.
    """
    with opened_mdf(source) as file:
        for group in file.groups:
            _refuse_outside_record(group)
        signals = [index for index, group in enumerate(file.groups) if not _holds_bus_frames(group)]
        if database is not None:
            return _decoded(file, database, wanted)
        if file.groups and not signals:
            raise RecordingError(
                "holds frames of a bus (CAN, LIN), which are no signals yet; give the bus's database (--dbc "
                "FILE, or database: in the mapping)"
            )
        tables = [_group(file, index, wanted) for index in signals]
        start = _start(file)
    if not any(len(table.channels.columns) or table.unread for table in tables):
        raise RecordingError("holds no channel groups; expected at least one with samples")
    return [replace(table, start=start) for table in tables]


@contextmanager
def opened_mdf(source: FileSource) -> Iterator[Any]:
    """Open a measurement file with asammdf; the file itself stays as it is."""
    import asammdf

    open_mdf: Any = asammdf.MDF  # its types lack some arguments
    # It finishes an unfinished file in place, so it gets a copy of that.
    unfinished = source.head.startswith(b"UnFinMF")
    with (
        io.BytesIO(source.all_bytes) if unfinished else source.opened() as opened,
        open_mdf(opened, process_bus_logging=False) as file,
    ):
        yield file


def _decoded(file: Any, database: str, wanted: Collection[str] | None) -> list[LoggedTable]:
    from asammdf.blocks.utils import load_can_database

    start = _start(file)
    # Of other suffixes some would be read as YAML that may hold code.
    described = load_can_database(database) if database.lower().endswith(".dbc") else None
    if described is None:
        raise RecordingError(f"database {database}: cannot be read as one of a CAN bus; expected a .dbc file")
    with file.extract_bus_logging({"CAN": [(described, 0)]}) as signals:
        tables = [_group(signals, index, wanted) for index in range(len(signals.groups))]
    if not tables:
        raise RecordingError(f"none of its bus frames is described in {database}; state the one of this bus")
    return [replace(table, start=start) for table in tables]


def _start(file: Any) -> Start | None:
    """Return when the measurement started: MDF 4 states UTC or local time, MDF 3 mostly local time."""
    header = file.header
    if not getattr(header, "abs_time", 0):
        return None
    local = file.version < "4" or header.time_flags & _LOCAL_TIME
    return Start(np.datetime64(int(header.abs_time), "ns"), utc=not local, source=f"header of MDF {file.version}")


def _holds_bus_frames(group: Any) -> bool:
    """Return whether a channel group holds raw frames; signals decoded from them are no "plain bus event" any more."""
    return bool(getattr(group.channel_group, "flags", 0) & _PLAIN_BUS_EVENT)


def _group(file: Any, index: int, wanted: Collection[str] | None) -> LoggedTable:
    group = file.groups[index]
    master = file.masters_db.get(index)
    order = sorted(range(len(group.channels)), key=lambda number: number != master)
    columns: list[tuple[str, NDArray[Any]]] = []
    units: dict[str, str] = {}
    unread: list[str] = []
    for number in order:
        name = group.channels[number].name.strip()
        if wanted is not None and name not in wanted:
            unread.append(name)
            continue
        signal = file.get(group=index, index=number, raw=False, ignore_invalidation_bits=True)
        values = _values(signal)
        if values is None:
            unread.append(name)
            continue
        wide = [(name, values)] if values.ndim == 1 else [(f"{name}_{k}", row) for k, row in enumerate(values.T, 1)]
        columns += wide
        if unit := str(signal.unit or "").strip():
            units |= {path: unit for path, _ in wide}
    samples = group.channel_group.cycles_nr
    shortest = min((len(column) for _, column in columns), default=samples)
    notes = (f"the file is cut off: {shortest} of {samples} samples are there",) if shortest < samples else ()
    about = group.channel_group
    title = str(getattr(about, "acq_name", "") or getattr(about, "comment", "") or "").strip() or f"group {index + 1}"
    return LoggedTable(named_columns(columns), units, title, tuple(unread), notes)


def _refuse_outside_record(group: Any) -> None:
    """Refuse channels that lie outside their record: asammdf would give back what lies behind it, or crash."""
    about = group.channel_group
    record = about.samples_byte_nr + getattr(about, "invalidation_bytes_nr", 0)
    for channel in group.channels:
        in_bytes = hasattr(channel, "byte_offset")
        start = 8 * channel.byte_offset + channel.bit_offset if in_bytes else channel.start_offset
        end = (start + channel.bit_count + 7) // 8
        if end > max(record, 8) and channel.bit_count:
            raise RecordingError(
                f"channel {channel.name!r} lies at byte {end} of a record of {record} bytes; it is damaged; "
                "copy it again"
            )


def _values(signal: Any) -> NDArray[Any] | None:
    """Return a signal's samples, or None if they are no single number, text or row of numbers each."""
    samples: NDArray[Any] = signal.samples
    if samples.dtype.kind in "SU" and samples.ndim == 1:
        texts = [cell.decode("utf-8", errors="replace") if isinstance(cell, bytes) else str(cell) for cell in samples]
        values: NDArray[Any] = np.array([text.strip("\0 ") for text in texts], dtype=object)
    elif samples.dtype.kind in "biuf" and samples.ndim <= 2:
        values = np.ascontiguousarray(numeric(samples))
    else:
        return None
    invalid = getattr(signal, "invalidation_bits", None)
    if invalid is not None and np.any(invalid):
        values = values.astype(object if values.dtype == object else np.float64)
        values[np.asarray(invalid, dtype=bool)] = np.nan
    return values


FORMAT = Format(
    "mdf",
    "an MDF file",
    read_mdf,
    starts=(b"MDF     ", b"UnFinMF "),
    needs=Library("asammdf", "MDF4", "mdf"),
    crashes="the MDF library",
    databases=True,
)

"""Read MDF 3 and 4 (CANape, INCA, Vector loggers) with asammdf."""

import io
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.cells import names_to_read
from cylinder_friction.recordings.formats.channels import numeric
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable, named_columns
from cylinder_friction.recordings.recording import RecordingError, Start

_LOCAL_TIME = 1  # Bit in a header's time flags (ASAM MDF 4.1)
_PLAIN_BUS_EVENT = 4  # Bit in a channel group's flags (ASAM MDF 4.1) that marks raw frames


def read_mdf(source: FileSource, wanted: Collection[str] | None, database: Path | None = None) -> list[LoggedTable]:
    """Read a table per channel group, its master first; frames of a bus are decoded with ``database``, its DBC file."""
    import asammdf

    open_mdf: Any = asammdf.MDF  # its types lack some arguments
    # asammdf finishes an unfinished file in place, so it gets a copy.
    unfinished = source.head.startswith(b"UnFinMF")
    with (
        io.BytesIO(source.all_bytes) if unfinished else source.opened() as opened,
        open_mdf(opened, process_bus_logging=False) as file,
    ):
        start = _start(file)
        if database is not None:
            tables = _decoded(file, database, wanted)
        else:
            plain = [getattr(group.channel_group, "flags", 0) & _PLAIN_BUS_EVENT for group in file.groups]
            if plain and all(plain):
                raise RecordingError(
                    "holds frames of a bus (CAN, LIN), which are no signals yet; give the bus's database (--dbc "
                    "FILE, or database: in the mapping)"
                )
            tables = [_group(file, index, wanted) for index, frames in enumerate(plain) if not frames]
    return [replace(table, start=start) for table in tables]


def _decoded(file: Any, database: Path, wanted: Collection[str] | None) -> list[LoggedTable]:
    from asammdf.blocks.utils import load_can_database

    if not database.is_file():
        raise RecordingError(f"database {database}: no such file")
    described = load_can_database(str(database)) if database.suffix.lower() == ".dbc" else None
    if described is None:
        raise RecordingError(f"database {database}: cannot be read as one of a CAN bus; expected a .dbc file")
    with file.extract_bus_logging({"CAN": [(described, 0)]}) as signals:
        tables = [_group(signals, index, wanted) for index in range(len(signals.groups))]
    if not tables:
        raise RecordingError(f"none of its bus frames is described in {database}; state the one of this bus")
    return tables


def _start(file: Any) -> Start | None:
    """Read the start of the measurement: MDF 4 states UTC or local time, MDF 3 mostly local time."""
    header = file.header
    if not getattr(header, "abs_time", 0):
        return None
    local = file.version < "4" or header.time_flags & _LOCAL_TIME
    return Start(np.datetime64(int(header.abs_time), "ns"), utc=not local, source=f"header of MDF {file.version}")


def _group(file: Any, index: int, wanted: Collection[str] | None) -> LoggedTable:
    group, master = file.groups[index], file.masters_db.get(index)
    columns: list[tuple[str, NDArray[Any]]] = []
    units: dict[str, str] = {}
    unread: list[str] = []
    names = [channel.name.strip() for channel in group.channels]
    read = names_to_read(names, wanted)
    for number in sorted(range(len(names)), key=lambda number: number != master):
        name = names[number]
        signal = file.get(group=index, index=number, raw=False, ignore_invalidation_bits=True) if name in read else None
        if signal is None or signal.samples.dtype.kind not in "biuf" or signal.samples.ndim > 1:
            unread.append(name)
            continue
        columns.append((name, _values(signal)))
        units |= {name: unit} if (unit := str(signal.unit or "").strip()) else {}
    about = group.channel_group
    shortest = min((len(column) for _, column in columns), default=about.cycles_nr)
    missing = shortest < about.cycles_nr
    notes = (f"the file is cut off: {shortest} of {about.cycles_nr} samples are there",) if missing else ()
    title = str(getattr(about, "acq_name", "") or getattr(about, "comment", "") or "").strip() or f"group {index + 1}"
    clock = "" if master is None else names[master]
    return LoggedTable(named_columns(columns), units, title, tuple(unread), notes, clock)


def _values(signal: Any) -> NDArray[Any]:
    values = np.ascontiguousarray(numeric(signal.samples))
    invalid = getattr(signal, "invalidation_bits", None)
    if invalid is not None and np.any(invalid):
        values = values.astype(np.float64)
        values[np.asarray(invalid, dtype=bool)] = np.nan
    return values


FORMAT = Format(
    "mdf",
    "an MDF file",
    read_mdf,
    starts=(b"MDF     ", b"UnFinMF "),
    library="asammdf",
    crashes="the MDF library",
    takes=("database",),
)

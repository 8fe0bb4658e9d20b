"""Parquet, as data loggers in the cloud and pandas write it."""

from collections.abc import Collection, Iterator
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.recordings.formats.cells import column_values, states_zone
from cylinder_friction.recordings.formats.clocks import beside_clocks, joined
from cylinder_friction.recordings.formats.format import Format
from cylinder_friction.recordings.formats.logged_table import Column, LoggedTable, LongTable, named_columns
from cylinder_friction.recordings.formats.source import FileSource
from cylinder_friction.recordings.recording import RecordingError


def read_parquet(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return the file's one table; only the wanted columns are read, in one thread.

    The index that pandas stores is a channel if it has a name or holds time stamps (then named ``index``); row numbers
    are left out. Text is read as in a text table: dates, times of day, numbers. Units come from a field's metadata, key
    ``unit`` or ``units``.
    """
    with _opened(source) as file:
        wanted = _wanted_here(file, wanted)
        table = file.read(columns=_read_names(file, wanted), use_threads=False, use_pandas_metadata=False)
        if file.metadata.num_rows == 0:
            raise RecordingError("holds no rows; expected one row per sample")
        return [_table(file, table, wanted)]


def long_parquet(source: FileSource, wanted: Collection[str] | None, rows: int) -> LongTable | None:
    """Return a file of more rows than these, to be read in parts of so many; None if it has not so many."""
    with _opened(source) as file:
        count = file.metadata.num_rows
    if count <= rows:
        return None

    def chunks() -> Iterator[LoggedTable]:
        with _opened(source) as file:
            here = _wanted_here(file, wanted)
            names = _read_names(file, here)
            for batch in file.iter_batches(rows, columns=names, use_threads=False, use_pandas_metadata=False):
                yield _table(file, pa.Table.from_batches([batch]), here)

    return LongTable(-(-count // rows), chunks)


def _opened(source: FileSource) -> Any:
    """Return the file, which is read page by page and not a row group at once."""
    return pq.ParquetFile(source.handle(), buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)


def _wanted_here(file: Any, wanted: Collection[str] | None) -> Collection[str] | None:
    """Return the channels to read; nothing, not even time, if the file has none of the wanted ones."""
    there = wanted is None or any(_name(field) in wanted for field in file.schema_arrow)
    return wanted if there else ()


def _is_read(field: Any, wanted: Collection[str] | None) -> bool:
    """Return whether a field is a channel that is wanted, or may be time: then it must not contradict the clock."""
    if pa.types.is_nested(field.type) or _is_row_number(field):
        return False
    return wanted is None or _name(field) in wanted or bool(wanted and beside_clocks([_name(field)]))


def _read_names(file: Any, wanted: Collection[str] | None) -> list[str]:
    return list(dict.fromkeys(field.name for field in file.schema_arrow if _is_read(field, wanted)))


def _table(file: Any, table: Any, wanted: Collection[str] | None) -> LoggedTable:
    fields = [field for field in file.schema_arrow if not _is_row_number(field)]
    units = {_name(each): unit for each in fields if not pa.types.is_nested(each.type) and (unit := _unit(each))}
    columns, clocks, notes, utc = list[Column](), list[str](), list[str](), False
    for field, column in zip(table.schema, table.columns, strict=True):
        name = _name(field)
        if pa.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        column = column.cast(pa.string()) if pa.types.is_large_string(column.type) else column
        cells = column_values(column, ".", name)
        columns.append((name, cells.values))
        clocks += [name] if cells.clock else []
        units |= {name: cells.unit} if cells.unit else {}
        notes += [cells.note] if cells.note else []
        utc |= states_zone(column)
    unread = tuple(_name(each) for each in fields if not _is_read(each, wanted))
    found = joined(columns, clocks, wanted) if len(unread) < len(fields) else []
    return LoggedTable(named_columns(found), units, unread=unread, notes=tuple(notes), utc=utc)


def _is_row_number(field: Any) -> bool:
    return bool(field.name.startswith("__index_level_") and pa.types.is_integer(field.type))


def _name(field: Any) -> str:
    return "index" if field.name.startswith("__index_level_") else str(field.name).strip()


def _unit(field: Any) -> str:
    metadata = field.metadata or {}
    unit = metadata.get(b"unit") or metadata.get(b"units") or b""
    return str(unit.decode(errors="replace")).strip()


# Hundreds of hours come this way, and Arrow withstands damage: it is read in the caller's process.
FORMAT = Format("parquet", "a Parquet file", read_parquet, starts=(b"PAR1",), read_long=long_parquet)

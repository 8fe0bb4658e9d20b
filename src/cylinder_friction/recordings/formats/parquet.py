"""Read Parquet files, as written by cloud data loggers and pandas."""

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.recordings.formats.cells import beside_clocks, columns_of
from cylinder_friction.recordings.formats.channels import unit_among
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable, named_columns
from cylinder_friction.recordings.recording import RecordingError


def read_parquet(source: FileSource, wanted: Collection[str] | None, rows: int | None = None) -> list[LoggedTable]:
    """Read the wanted columns of the file's table in one thread; read more than ``rows`` rows in parts.

    An index that pandas stored is a channel if it has a name or contains time stamps (then named ``index``). Row
    numbers are left out. Text is parsed as in a text table: dates, times of day, numbers. A field's metadata states its
    unit under the key ``unit`` or ``units``.
    """
    with _opened(source) as file:
        count = file.metadata.num_rows
        if wanted is not None and not any(_name(field) in wanted for field in file.schema_arrow):
            wanted = ()  # not even time
        if count == 0:
            raise RecordingError("holds no rows; expected one row per sample")
        number = 1 if rows is None else max(1, round(count / rows))
        if number == 1:
            table = file.read(columns=_read_names(file, wanted), use_threads=False, use_pandas_metadata=False)
            return [_table(file, table, wanted)]
    parts = _parts(source, wanted, -(-count // number))
    return [replace(next(parts), more=lambda: parts, parts=number)]


def _parts(source: FileSource, wanted: Collection[str] | None, rows: int) -> Iterator[LoggedTable]:
    with _opened(source) as file:
        names = _read_names(file, wanted)
        for batch in file.iter_batches(rows, columns=names, use_threads=False, use_pandas_metadata=False):
            yield _table(file, pa.Table.from_batches([batch]), wanted)


def _opened(source: FileSource) -> Any:
    """Open the file so that it is read page by page instead of by whole row groups."""
    return pq.ParquetFile(source.handle(), buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)


def _is_read(field: Any, wanted: Collection[str] | None) -> bool:
    """Check whether a field is a wanted channel, or may be time, which must not contradict the clock."""
    if pa.types.is_nested(field.type) or _is_row_number(field):
        return False
    return wanted is None or _name(field) in wanted or bool(wanted and beside_clocks([_name(field)]))


def _read_names(file: Any, wanted: Collection[str] | None) -> list[str]:
    return list(dict.fromkeys(field.name for field in file.schema_arrow if _is_read(field, wanted)))


def _table(file: Any, table: Any, wanted: Collection[str] | None) -> LoggedTable:
    fields = [field for field in file.schema_arrow if not _is_row_number(field)]
    units = {_name(each): unit for each in fields if not pa.types.is_nested(each.type) and (unit := _unit(each))}
    named = []
    for field, column in zip(table.schema, table.columns, strict=True):
        column = column.cast(column.type.value_type) if pa.types.is_dictionary(column.type) else column
        named.append((_name(field), column.cast(pa.string()) if pa.types.is_large_string(column.type) else column))
    found = columns_of(named, ".", wanted)
    unread = tuple(_name(each) for each in fields if not _is_read(each, wanted))
    columns = named_columns(found.columns if len(unread) < len(fields) else [])
    return LoggedTable(columns, units | found.units, unread=unread, notes=tuple(found.notes), utc=found.utc)


def _is_row_number(field: Any) -> bool:
    return bool(field.name.startswith("__index_level_") and pa.types.is_integer(field.type))


def _name(field: Any) -> str:
    return "index" if field.name.startswith("__index_level_") else str(field.name).strip()


def _unit(field: Any) -> str:
    return unit_among({key.decode(): text for key, text in (field.metadata or {}).items()})


# Parquet is read in the caller's process for speed, and because Arrow does not crash over damaged files.
FORMAT = Format("parquet", "a Parquet file", read_parquet, ("rows",), starts=(b"PAR1",))

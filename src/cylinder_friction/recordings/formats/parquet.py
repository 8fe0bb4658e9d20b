"""Parquet, as data loggers in the cloud and pandas write it."""

from collections.abc import Collection
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.recordings.formats.columns import plain_values, text_objects
from cylinder_friction.recordings.formats.logged_table import LoggedTable, named_columns
from cylinder_friction.recordings.formats.source import FileSource
from cylinder_friction.recordings.recording import RecordingError


def read_parquet(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return the file's one table; only the wanted columns are read, in one thread.

    The index that pandas stores is a channel if it has a name or holds time stamps (then named ``index``); row numbers
    are left out. Units come from a field's metadata, key ``unit`` or ``units``.
    """
    with pq.ParquetFile(source.handle(), pre_buffer=False, page_checksum_verification=True) as file:
        fields = list(file.schema_arrow)
        simple = [field for field in fields if not pa.types.is_nested(field.type) and not _is_row_number(field)]
        loaded = [field for field in simple if wanted is None or _name(field) in wanted]
        others = [field for field in fields if not any(field is one for one in loaded) and not _is_row_number(field)]
        read = dict.fromkeys(field.name for field in loaded)
        table = file.read(columns=list(read), use_threads=False, use_pandas_metadata=False)
        rows = file.metadata.num_rows
    if rows == 0:
        raise RecordingError("holds no rows; expected one row per sample")
    units = {_name(field): unit for field in simple if (unit := _unit(field))}
    columns = [(_name(field), _values(column)) for field, column in zip(table.schema, table.columns, strict=True)]
    return [LoggedTable(named_columns(columns if loaded else []), units, unread=tuple(map(_name, others)))]


def _is_row_number(field: Any) -> bool:
    return bool(field.name.startswith("__index_level_") and pa.types.is_integer(field.type))


def _name(field: Any) -> str:
    return "index" if field.name.startswith("__index_level_") else str(field.name).strip()


def _unit(field: Any) -> str:
    metadata = field.metadata or {}
    unit = metadata.get(b"unit") or metadata.get(b"units") or b""
    return str(unit.decode(errors="replace")).strip()


def _values(column: Any) -> Any:
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    values = plain_values(column)
    return text_objects(column.cast(pa.string())) if values is None else values

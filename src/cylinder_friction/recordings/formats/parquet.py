"""Read Parquet files, as written by cloud data loggers and pandas."""

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.recordings.formats.cells import columns_of, names_to_read
from cylinder_friction.recordings.formats.channels import unit_among
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable, named_columns
from cylinder_friction.recordings.recording import RecordingError

INDEX = "__index_level_"  # Beginning of the name of an index without a name that pandas stored


def read_parquet(source: FileSource, wanted: Collection[str] | None, rows: int | None = None) -> list[LoggedTable]:
    """Read the wanted columns, in parts of ``rows`` rows; an index with a name or time stamps is a channel."""
    parts = _parts(source, wanted, rows)
    first = next(parts)
    return [first if first.parts == 1 else replace(first, more=lambda: parts)]


def _parts(source: FileSource, wanted: Collection[str] | None, rows: int | None) -> Iterator[LoggedTable]:
    # Without a buffer of whole row groups, memory holds only some pages.
    opened = pq.ParquetFile(source.handle(), buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)
    with opened as file:
        if (count := file.metadata.num_rows) == 0:
            raise RecordingError("holds no rows; expected one row per sample")
        number = 1 if rows is None else max(1, round(count / rows))
        schema = file.schema_arrow
        fields = [each for each in schema if not (each.name.startswith(INDEX) and pa.types.is_integer(each.type))]
        plain = {field.name: _name(field) for field in fields if not pa.types.is_nested(field.type)}
        read = names_to_read(plain.values(), wanted)
        unread = tuple(_name(field) for field in fields if plain.get(field.name) not in read)
        stated = {_name(each): {key.decode(): text for key, text in (each.metadata or {}).items()} for each in fields}
        units = {name: unit for name in plain.values() if (unit := unit_among(stated[name]))}
        columns = [name for name in plain if plain[name] in read]
        given: dict[str, Any] = {"columns": columns, "use_threads": False, "use_pandas_metadata": False}
        for batch in file.iter_batches(-(-count // number), **given):
            table = pa.Table.from_batches([batch])
            named = zip(table.column_names, table.columns, strict=True)
            found = columns_of([(plain[name], column) for name, column in named], ".", wanted)
            notes, frame = tuple(found.notes), named_columns(found.columns)
            yield LoggedTable(frame, units | found.units, unread=unread, notes=notes, utc=found.utc, parts=number)


def _name(field: Any) -> str:
    return "index" if field.name.startswith(INDEX) else str(field.name).strip()


# Parquet is read in the caller's process for speed, and because Arrow does not crash over damaged files.
FORMAT = Format("parquet", "a Parquet file", read_parquet, ("rows",), starts=(b"PAR1",))

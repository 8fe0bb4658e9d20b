"""Columns of samples from CSV, Arrow and Parquet, and estimates as Arrow; whatever is sent, it is not trusted."""

import csv
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv as arrow_csv
from pyarrow import parquet

from cylinder_friction.deployment.scoring import RECORDING_COLUMN, SHOWN, Column, shown
from cylinder_friction.service.scoring.errors import Columns, Expected, RequestError, refuse_names

_HEADER, _COMPRESSION = 2, 3
"""Fields of Message and of RecordBatch in Arrow's Message.fbs."""
_UNREADABLE = (pa.ArrowException, ValueError, LookupError, EOFError, OSError, struct.error)
_TYPES = (pa.types.is_integer, pa.types.is_floating, pa.types.is_string, pa.types.is_large_string, pa.types.is_boolean)


def from_csv(body: bytes, expected: Expected) -> Columns:
    """Return the columns of CSV with a header.

    A column without a name, as pandas writes its index, is left out if it counts the rows from 0.
    """
    expected.refuse_rows(body.count(b"\n") - 2)  # a header, and maybe an empty line in the end
    try:
        header = body.decode("utf-8-sig").lstrip("\r\n").split("\n", 1)[0].rstrip("\r")
        names = next(csv.reader([header]), [])
    except (UnicodeDecodeError, csv.Error):
        raise RequestError(400, "the body is not CSV in UTF-8") from None
    refuse_names(names)
    kinds = {name: pa.float64() if name in expected.inputs else pa.string() for name in names}
    try:
        table = arrow_csv.read_csv(
            pa.py_buffer(body),
            arrow_csv.ReadOptions(use_threads=False, block_size=max(len(body), 1)),
            convert_options=arrow_csv.ConvertOptions(column_types=kinds, null_values=[]),
        )
    except pa.ArrowException as error:
        raise RequestError(422, f"the body is not CSV with numbers in {list(expected.inputs)}: {error}") from None
    columns = _columns(table, expected)
    if columns.pop("", counted := [str(row) for row in range(table.num_rows)]) != counted:
        raise RequestError(422, "a column without a name holds more than row numbers from 0; name it or leave it out")
    return columns


def from_arrow(body: bytes, expected: Expected) -> Columns:
    """Return the columns of an uncompressed Arrow stream."""
    try:
        reader = pa.ipc.MessageReader.open_stream(pa.py_buffer(body))
        for message in reader:
            if message.type == "record batch" and _is_compressed(message.metadata.to_pybytes()):
                raise RequestError(422, "the Arrow stream is compressed; expected buffers as they are")
        with pa.ipc.open_stream(pa.py_buffer(body)) as stream:
            _refuse_columns(stream.schema)
            batches, count = [], 0
            for batch in stream:
                expected.refuse_rows(count := count + batch.num_rows)
                batch.validate(full=True)
                batches.append(batch)
            table = pa.Table.from_batches(batches, stream.schema)
    except MemoryError:
        raise
    except _UNREADABLE as error:
        raise RequestError(400, f"the body is not an Arrow stream: {error}") from None
    return _columns(table, expected)


def _is_compressed(metadata: bytes) -> bool:
    """Return whether a message is a record batch with compressed buffers; raises ``struct.error`` for garbage."""

    def table_field(table: int, field: int) -> int:
        (back,) = struct.unpack_from("<i", metadata, table)
        vtable = table - back
        (length,) = struct.unpack_from("<H", metadata, vtable)
        return struct.unpack_from("<H", metadata, vtable + 4 + 2 * field)[0] if length > 4 + 2 * field else 0

    (root,) = struct.unpack_from("<I", metadata)
    at = root + table_field(root, _HEADER)
    batch = at + struct.unpack_from("<I", metadata, at)[0]
    return table_field(batch, _COMPRESSION) != 0


def from_parquet(body: bytes, expected: Expected) -> Columns:
    """Return the columns of a Parquet file.

    Its pages can hold far more than they are long, and only a limit on the process' memory stops them: asking the file
    how they are compressed ends the process where the file is corrupted.
    """
    try:
        schema = parquet.read_schema(pa.py_buffer(body))
        _refuse_columns(schema)
        recording = {RECORDING_COLUMN} & {*schema.names}  # a long name need not be repeated
        with parquet.ParquetFile(pa.py_buffer(body), read_dictionary=[*recording]) as file:
            expected.refuse_rows(file.metadata.num_rows)
            table = file.read(use_threads=False)
            table.validate(full=True)
    except MemoryError:
        raise
    except _UNREADABLE as error:
        raise RequestError(400, f"the body is not a Parquet file: {error}") from None
    return _columns(table, expected)


def _refuse_columns(schema: pa.Schema) -> None:
    """Refuse columns that are there twice, or neither numbers nor text, and pandas' rows with gaps (422)."""
    refuse_names(schema.names)
    for field in schema:
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        if not any(fits(kind) for fits in _TYPES):
            what = str(field.type)[:SHOWN]
            raise RequestError(422, f"column {shown(field.name)} holds {what}; expected double, or text in 'recording'")
    try:
        indices = [*(schema.pandas_metadata or {}).get("index_columns", [])]
    except (ValueError, TypeError, AttributeError):
        raise RequestError(422, "the metadata of pandas in the schema cannot be read; leave them out") from None
    for index in indices:  # those that are columns are seen as such
        if isinstance(index, dict) and (index.get("start"), index.get("step")) != (0, 1):
            raise RequestError(422, "the index leaves out rows; expected row numbers from 0 without gaps; reset it")


def _columns(table: pa.Table, expected: Expected) -> Columns:
    expected.refuse_rows(table.num_rows)
    return {name: _values(table[name]) for name in table.column_names}


def _values(column: pa.ChunkedArray) -> Column:
    """Return numbers as an array, in which what is missing is NaN, and everything else as a list."""
    if pa.types.is_dictionary(column.type):
        found: list[Any] = []
        for chunk in column.chunks:
            different = dict(enumerate(chunk.dictionary.to_pylist()))
            found += [different.get(index) for index in chunk.indices.to_pylist()]
        return found
    if pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
        return np.asarray(column.to_numpy())
    return list(column.to_pylist())


def to_arrow(columns: Mapping[str, NDArray[Any]]) -> bytes:
    """Return columns of estimates as an Arrow stream."""
    table = pa.table(dict(columns))
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())

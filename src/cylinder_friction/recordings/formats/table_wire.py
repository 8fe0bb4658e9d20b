"""Tables over a pipe between two processes: JSON for what describes them, raw bytes for numbers. Nothing is pickled."""

from __future__ import annotations

import json
import struct
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cylinder_friction.recordings.formats.logged_table import LoggedTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_LENGTH = struct.Struct("<Q")


def write_message(stream: IO[bytes], message: Any) -> None:
    """Write JSON behind its length [bytes, uint64 little-endian]."""
    text = json.dumps(message, default=str).encode("ascii")
    stream.write(_LENGTH.pack(len(text)) + text)
    stream.flush()


def read_message(stream: IO[bytes]) -> Any:
    """Return what ``write_message`` wrote; raises ``EOFError`` where the other process is gone."""
    (length,) = _LENGTH.unpack(_bytes(stream, _LENGTH.size))
    return json.loads(_bytes(stream, length))


def write_tables(stream: IO[bytes], tables: Sequence[LoggedTable]) -> None:
    """Write what describes every table, then its columns one behind the other.

    Numbers and time stamps go as they lie in memory; a column of text, which may hold numbers and NaN too, as JSON.
    """
    write_message(stream, [_described(table) for table in tables])
    for table in tables:
        for number in range(table.channels.shape[1]):
            column = table.channels.iloc[:, number]
            if _is_plain(column):
                stream.write(np.ascontiguousarray(column.to_numpy()).view(np.uint8).data)
            else:
                write_message(stream, column.tolist())
    stream.flush()


def read_tables(stream: IO[bytes]) -> list[LoggedTable]:
    """Return what ``write_tables`` wrote, every column read into the memory where it stays."""
    return [_table(stream, described) for described in read_message(stream)]


def _described(table: LoggedTable) -> dict[str, Any]:
    columns = [table.channels.iloc[:, number] for number in range(table.channels.shape[1])]
    return {
        "rows": len(table.channels),
        "columns": list(table.channels.columns),
        "types": [column.to_numpy().dtype.str if _is_plain(column) else None for column in columns],
        "units": dict(table.units),
        "name": table.name,
        "unread": list(table.unread),
        "notes": list(table.notes),
    }


def _is_plain(column: pd.Series) -> bool:
    return isinstance(column.dtype, np.dtype) and column.dtype.kind in "biufM"


def _table(stream: IO[bytes], described: dict[str, Any]) -> LoggedTable:
    columns = {number: _column(stream, described["rows"], dtype) for number, dtype in enumerate(described["types"])}
    channels = pd.DataFrame(columns, index=pd.RangeIndex(described["rows"]), copy=False)
    channels.columns = pd.Index(described["columns"], dtype=object)
    return LoggedTable(
        channels, described["units"], described["name"], tuple(described["unread"]), tuple(described["notes"])
    )


def _column(stream: IO[bytes], rows: int, dtype: str | None) -> NDArray[Any]:
    if dtype is None:
        cells = np.empty(rows, dtype=object)
        cells[:] = read_message(stream)
        return cells
    values = np.empty(rows, dtype=dtype)
    _fill(stream, values.view(np.uint8).data)
    return values


def _bytes(stream: IO[bytes], count: int) -> bytearray:
    content = bytearray(count)
    _fill(stream, memoryview(content))
    return content


def _fill(stream: Any, room: memoryview) -> None:
    while room:
        count = stream.readinto(room)
        if not count:
            raise EOFError("the other process is gone")
        room = room[count:]

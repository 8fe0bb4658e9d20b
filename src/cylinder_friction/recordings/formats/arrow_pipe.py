"""Messages and tables over a pipe between two processes: lines of JSON, and Arrow IPC for numbers. No pickle."""

import json
from collections.abc import Sequence
from typing import IO, Any

import numpy as np
import pandas as pd
import pyarrow as pa

from cylinder_friction.recordings.formats.logged_table import LoggedTable


def write_message(stream: IO[bytes], message: Any) -> None:
    """Write a line of JSON in ASCII."""
    stream.write(json.dumps(message, default=str).encode("ascii") + b"\n")
    stream.flush()


def read_message(stream: IO[bytes]) -> Any:
    """Return what ``write_message`` wrote. Raises ``EOFError`` if the other process has ended."""
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError("the other process is gone")
    return json.loads(line)


def write_tables(stream: IO[bytes], tables: Sequence[LoggedTable]) -> None:
    """Write each table as an Arrow stream of its numbers and time stamps.

    What describes it, and columns of text, which may hold numbers and NaN too, are JSON in the stream's metadata.
    """
    write_message(stream, len(tables))
    for table in tables:
        columns = {str(number): table.channels.iloc[:, number] for number in range(table.channels.shape[1])}
        plain = {
            number: pa.array(column.to_numpy())
            for number, column in columns.items()
            if isinstance(column.dtype, np.dtype) and column.dtype.kind in "biufM"
        }
        described = {
            "rows": len(table.channels),
            "names": list(table.channels.columns),
            "text": {number: column.tolist() for number, column in columns.items() if number not in plain},
            "about": {"units": dict(table.units), "name": table.name, "unread": table.unread, "notes": table.notes},
        }
        batch = pa.record_batch(list(plain.values()), names=list(plain))
        batch = batch.replace_schema_metadata({"table": json.dumps(described, default=str)})
        with pa.ipc.new_stream(stream, batch.schema) as writer:
            writer.write_batch(batch)
    stream.flush()


def read_tables(stream: IO[bytes]) -> list[LoggedTable]:
    """Return what ``write_tables`` wrote. Raises ``EOFError`` if the other process has ended."""
    try:
        return [_table(pa.ipc.open_stream(stream).read_all()) for _ in range(read_message(stream))]
    except pa.ArrowInvalid as error:
        raise EOFError(f"the other process is gone: {error}") from None


def _table(table: Any) -> LoggedTable:
    described = json.loads(table.schema.metadata[b"table"])
    # Copied, for Arrow's memory is read-only.
    columns = {int(number): np.array(table[number].to_numpy()) for number in table.column_names}
    columns |= {int(number): np.array(cells, dtype=object) for number, cells in described["text"].items()}
    channels = pd.DataFrame(dict(sorted(columns.items())), index=pd.RangeIndex(described["rows"]), copy=False)
    channels.columns = pd.Index(described["names"], dtype=object)
    about = described["about"]
    return LoggedTable(channels, about["units"], about["name"], tuple(about["unread"]), tuple(about["notes"]))

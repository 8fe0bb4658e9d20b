"""Read binary files in a process of their own: a damaged file can crash or hang the C library that reads it.

Libhdf5 follows addresses that it finds in the file, so that one flipped byte can end the process or keep it in a loop;
asammdf follows lists of blocks and record sizes stated in the file; over MATLAB files of version 5, SciPy crashes,
hangs and fills the memory too. TDMS (npTDMS) and Parquet (Arrow) did none of it over more than 20 000 files each with a
few bytes changed at random. TDMS is read here all the same; Parquet, for its speed, and text in the caller's process.

The two processes exchange lines of JSON, and Arrow IPC for numbers. No pickle.
"""

import atexit
import faulthandler
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
import pandas as pd
import pyarrow as pa

from cylinder_friction.recordings.formats.format import Format, guarded
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.formats.registry import FORMATS
from cylinder_friction.recordings.formats.source import open_source
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import Start

if sys.platform != "win32":
    import resource

LIMIT_S = 60.0  # so long may reading take [s], and longer where the file is large
LIMIT_PER_BYTE_S = 1.0 / 2e6
LIMIT_BYTES = 4 << 30  # so much memory may it take, and more for each byte of the file
LIMIT_BYTES_PER_BYTE = 50

_START = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from cylinder_friction.recordings.formats.isolated import serve
serve()
"""


class IsolatedReader:
    """Owns the process, and sends it one request at a time, from any thread."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def read(self, path: Path, of: Format, wanted: Collection[str] | None, database: Path | None) -> list[LoggedTable]:
        """Return a file's tables, read in a process that is started for the first file and kept for the next ones.

        Raises:
            RecordingError: The file is damaged; reading it crashed the library or took too long.
            RuntimeError: The process does not start.
        """
        size = path.stat().st_size
        limit_s = LIMIT_S + LIMIT_PER_BYTE_S * size
        request = {
            "path": str(path.absolute()),
            "format": of.name,
            "wanted": None if wanted is None else list(wanted),
            "database": None if database is None else str(database.absolute()),
            "limit_s": limit_s,
            "limit_bytes": LIMIT_BYTES + LIMIT_BYTES_PER_BYTE * size,
        }
        with self._lock:
            process = self._running()
            start = time.monotonic()
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                write_message(process.stdin, request)
                refusal = read_message(process.stdout)
                tables = [] if refusal is not None else read_tables(process.stdout)
            except (EOFError, OSError):
                took_s = time.monotonic() - start
                process.wait()
                how = f"signal {-process.returncode}" if process.returncode < 0 else f"exit code {process.returncode}"
                what = f"crashed {of.crashes} ({how}); the file"
                if took_s >= limit_s:
                    what = f"took longer than {limit_s:.0f} s; it"
                raise RecordingError(f"reading it {what} is damaged; copy it again, or export it anew") from None
            except BaseException:
                # A reply half read would be taken for the next one.
                self.close()
                raise
        if refusal is not None:
            raise RecordingError(refusal)
        return tables

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._process = _started()
        return self._process

    def close(self) -> None:
        """End the process; it holds nothing that would be lost."""
        process, self._process = self._process, None
        if process is not None:
            _end(process)

    def forget(self) -> None:
        """Forget the process after a fork: it belongs to the parent, and this process has copies of its pipes."""
        process, self._process = self._process, None
        self._lock = threading.Lock()
        if process is not None:
            process.returncode = 0
            _end(process)


def _started() -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", "-c", _START, json.dumps(sys.path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603
    assert process.stdout is not None
    try:
        read_message(process.stdout)
    except BaseException as error:
        _end(process)
        if isinstance(error, EOFError):
            raise RuntimeError("the process that reads binary files does not start; why stands above") from None
        raise
    return process


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process (one with a return code is left alone) and close its pipes."""
    process.kill()
    with suppress(OSError), process:  # what was not sent to a dead process is flushed here, in vain
        pass


def serve() -> None:
    """Read the files requested on the standard input, until the process at its other end closes it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(OSError):
        # Where damage makes a library ask for all memory, Linux is to end this process and no other.
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    replies = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    with Path(os.devnull).open("w", encoding="utf-8") as unseen, replies:
        write_message(replies, "ready")
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        with suppress(EOFError, BrokenPipeError):
            while True:
                request = read_message(sys.stdin.buffer)
                _limit_memory(request["limit_bytes"])
                # A thread of C ends the process in time, also from within a library that never returns to Python.
                faulthandler.dump_traceback_later(request["limit_s"], exit=True, file=unseen)
                tables, refusal = _read(request)
                faulthandler.cancel_dump_traceback_later()
                write_message(replies, refusal)
                if refusal is None:
                    write_tables(replies, tables)


def _limit_memory(limit_bytes: int) -> None:
    """Let larger allocations fail. The libraries report that as they report damage. Does nothing on Windows."""
    if sys.platform != "win32":
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit_bytes = limit_bytes if most == resource.RLIM_INFINITY else min(limit_bytes, most)
        resource.setrlimit(resource.RLIMIT_DATA, (limit_bytes, most))


def _read(request: dict[str, Any]) -> tuple[list[LoggedTable], str | None]:
    """Return the tables, or why there are none."""
    of = FORMATS[request["format"]]
    try:
        with guarded(of.what):
            more = [request["database"]] if of.databases else []
            return of.read(open_source(Path(request["path"])), request["wanted"], *more), None
    except RecordingError as error:
        return [], str(error)


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
            "start": table.start and [str(table.start.at), table.start.utc, table.start.source],
            "utc": table.utc,
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
    about, start = described["about"], described["start"]
    return LoggedTable(
        channels,
        about["units"],
        about["name"],
        tuple(about["unread"]),
        tuple(about["notes"]),
        start and Start(np.datetime64(start[0]), *start[1:]),
        described["utc"],
    )


READER = IsolatedReader()
atexit.register(READER.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=READER.forget)

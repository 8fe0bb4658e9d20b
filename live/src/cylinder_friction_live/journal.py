"""The journal, in SQLite, for a restart: the state of each session, and all estimates that are not in Parquet yet."""

import json
import logging
import sqlite3
import struct
import threading
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import FLAG_BYTES, ROW_BYTES, EstimateBlock, SampleBlock

SAME_TIME = 0.5
"""Share of the sample time by which the sender's clock may jitter between blocks that are joined in one chunk."""
_FORGOTTEN_AT_ONCE = 1000
PAGE_BYTES = 32768
"""Page size [bytes] that fits a second of a session; four pages of SQLite's 4096 bytes took twice the time."""
_LOG_PAGES = 256
_VERSION = 4
_UNREADABLE_ROWS = 10_000
"""Most successive rows of a damaged journal that cannot be read, before its next table is tried."""
HISTORY_FOLDER = "history"
_TABLES = f"""
CREATE TABLE IF NOT EXISTS session (
    id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, content TEXT NOT NULL, state BLOB NOT NULL
);
CREATE TABLE IF NOT EXISTS chunk (
    id INTEGER PRIMARY KEY, name TEXT NOT NULL, first_index INTEGER NOT NULL, rows INTEGER NOT NULL,
    content TEXT NOT NULL, samples BLOB NOT NULL, estimates BLOB NOT NULL
);
CREATE INDEX IF NOT EXISTS chunk_of_session ON chunk (name, id);
PRAGMA user_version = {_VERSION};
"""


# One statement for many rows, as a thread that writes row by row waits for the event loop at each row
_KEEP_SESSIONS = """
INSERT INTO session (name, content, state)
SELECT json_extract(value, '$[0]'), json_extract(value, '$[1]'),
    substr(?2, json_extract(value, '$[2]'), json_extract(value, '$[3]'))
FROM json_each(?1) WHERE true
ON CONFLICT (name) DO UPDATE SET content = excluded.content, state = excluded.state
"""
_KEEP_CHUNKS = """
INSERT INTO chunk (name, first_index, rows, content, samples, estimates)
SELECT json_extract(value, '$[0]'), json_extract(value, '$[1]'), json_extract(value, '$[2]'),
    json_extract(value, '$[3]'), substr(?2, json_extract(value, '$[4]'), json_extract(value, '$[5]')),
    substr(?2, json_extract(value, '$[6]'), json_extract(value, '$[7]'))
FROM json_each(?1)
"""
_ChunkRow = tuple[str, int, int, dict[str, Any], bytes, bytes]
_log = logging.getLogger(__name__)


class JournalError(ValueError):
    """The file is no journal of this version; the message states what to do."""


class DamagedSessionError(ValueError):
    """What the journal holds of a session cannot be read, or is not what was written."""


@dataclass(slots=True)
class SavedSession:
    """A session as it was last written to the journal."""

    name: str
    next_index: int  # All samples before it are kept
    counts: dict[str, int]
    model: str  # SHA-256 of the model
    state: bytes  # The model's whole state for this session

    def checksum(self) -> int:
        """Sum up all of it, to notice damage."""
        return crc32(self.state, crc32(repr((self.name, self.next_index, self.counts, self.model)).encode()))


@dataclass(slots=True)
class Chunk:
    """Successive samples of a session with their estimates."""

    name: str
    index: int  # Index of the first sample
    time_s: float
    sample_time_s: float
    inputs: tuple[str, ...]
    samples: Array  # Shape ``(rows, inputs)``
    estimates: EstimateBlock | None  # None: the samples came too late, after their gap, and were not stepped

    @property
    def model(self) -> str | None:
        """The model that made the estimates; None without estimates."""
        return None if self.estimates is None else self.estimates.model


@dataclass(frozen=True, slots=True)
class LastRow:
    """The newest estimate of a session."""

    index: int
    time_s: float  # Time of its sample, in the sender's clock
    newtons: list[float]  # Friction, lower and upper bound [N]
    flags: int


@dataclass(slots=True)
class PendingChunk:
    """A chunk that is not in the journal yet, as the bytes of its blocks, which are joined when it is written."""

    name: str
    index: int  # Index of the first sample
    time_s: float
    sample_time_s: float
    inputs: tuple[str, ...]
    model: str | None  # SHA-256 of the model; None without estimates
    rows: int = 0
    last_time_s: float = 0.0  # Time of the newest sample, in the sender's clock
    samples: list[bytes] = field(default_factory=list)
    newtons: list[bytes] = field(default_factory=list)
    flags: list[bytes] = field(default_factory=list)

    def add(self, block: SampleBlock, estimates: EstimateBlock | None) -> bool:
        """Append a block if it follows the last one in index and in the sender's time; return whether it does."""
        rows, step_s = self.rows, self.sample_time_s
        if block.index != self.index + rows or abs(block.time_s - self.time_s - rows * step_s) >= SAME_TIME * step_s:
            return False
        if (estimates is None) != (self.model is None):
            return False
        self.rows, self.last_time_s = rows + block.rows, block.time_s + (block.rows - 1) * step_s
        self.samples.append(block.content)
        if estimates is not None:
            self.newtons.append(estimates.newton_bytes)
            self.flags.append(estimates.flag_bytes)
        return True

    def last(self) -> LastRow:
        """Read the newest estimate."""
        newtons, flags = struct.unpack("<3d", self.newtons[-1][-ROW_BYTES:]), self.flags[-1][-FLAG_BYTES:]
        return LastRow(self.index + self.rows - 1, self.last_time_s, list(newtons), int.from_bytes(flags, "little"))

    def newest_samples(self, rows: int) -> Array:
        """Read samples of the newest block: its last ``rows``."""
        return np.frombuffer(self.samples[-1], "<f8").reshape(-1, len(self.inputs))[-rows:]

    def row(self) -> _ChunkRow:
        """Make the journal's row of it."""
        about = ("time_s", "sample_time_s", "inputs", "model")
        content = {name: getattr(self, name) for name in about}
        samples, estimates = b"".join(self.samples), b"".join(self.newtons + self.flags)
        content["checksum"] = crc32(estimates, crc32(samples))
        return self.name, self.index, self.rows, content, samples, estimates

    def chunk(self) -> Chunk:
        """Make the chunk that the journal will hold."""
        return _chunk_of(self.row())


def _chunk_of(row: _ChunkRow) -> Chunk:
    name, index, rows, of, samples, kept = row
    if crc32(kept, crc32(samples)) != of["checksum"]:
        raise ValueError("its checksum differs")
    flags_at, estimates = ROW_BYTES * rows, None
    if of["model"] is not None:
        estimates = EstimateBlock(0, index, of["time_s"], kept[:flags_at], kept[flags_at:], of["model"])
    rows_of_samples = np.frombuffer(samples, "<f8").reshape(rows, -1)
    return Chunk(name, index, of["time_s"], of["sample_time_s"], tuple(of["inputs"]), rows_of_samples, estimates)


class Journal:
    """Sessions and their latest estimates in one file; each write is complete or absent after a kill.

    One thread reads while another writes; writing threads wait for each other.

    Args:
        path: The file; made if there is none.

    Raises:
        JournalError: The file is of another version, or cannot be opened or written.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._turn, self.history = threading.Lock(), path.with_name(HISTORY_FOLDER)
        try:
            self._open(path)
        except sqlite3.OperationalError as error:
            raise JournalError(
                f"{path}: the journal cannot be opened or written ({error}); free its disk, move away what is no "
                "journal, or give another --folder"
            ) from error
        except sqlite3.DatabaseError as error:
            self._writing.close()
            aside = path.with_name(time.strftime(f"{path.stem}-damaged-%Y%m%dT%H%M%S{path.suffix}"))
            for end in ("-wal", "-shm", ""):
                if (part := path.with_name(path.name + end)).exists():
                    part.rename(aside.with_name(aside.name + end))
            self._open(path)
            _log.error(
                "%s is damaged (%s): what can be read was copied; the damaged file is now %s", path, error, aside
            )
            self._copy_readable(aside)

    def _open(self, path: Path) -> None:
        self._writing = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        tables = self._writing.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]
        version = self._writing.execute("PRAGMA user_version").fetchone()[0]
        if tables and version != _VERSION:
            self._writing.close()
            raise JournalError(
                f"{path}: a journal of version {version}, expected {_VERSION}; let the program that wrote it "
                "move it into the history (start and stop it once), or move the file away"
            )
        (found,) = self._writing.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise sqlite3.DatabaseError(found)
        self._writing.executescript(
            f"PRAGMA page_size={PAGE_BYTES}; PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL; "
            f"PRAGMA wal_autocheckpoint={_LOG_PAGES}; {_TABLES}"
        )
        self._reading = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        self._files = {each: each.stat().st_ino for each in (path, path.with_name(f"{path.name}-wal"))}

    def _copy_readable(self, damaged: Path) -> None:
        """Copy every row that can be read from a damaged journal."""
        with closing(sqlite3.connect(damaged)) as old, self._writing:
            old.execute("PRAGMA writable_schema=ON")  # otherwise SQLite reads nothing of a file that was cut
            self._writing.execute("BEGIN")
            self._writing.executemany("INSERT OR IGNORE INTO session VALUES (?, ?, ?, ?)", _readable(old, "session"))
            self._writing.executemany(
                "INSERT OR IGNORE INTO chunk VALUES (?, ?, ?, ?, ?, ?, ?)", _readable(old, "chunk")
            )

    def close(self) -> None:
        """Close the file."""
        self._reading.close()
        self._writing.close()

    def session(self, name: str) -> SavedSession | None:
        """Read a session as it was last written, or None.

        Raises:
            DamagedSessionError: What was written of it cannot be read, or has changed since.
        """
        try:
            row = self._reading.execute("SELECT content, state FROM session WHERE name = ?", (name,)).fetchone()
            if row is None:
                return None
            content = json.loads(row[0])
            checksum = content.pop("checksum")
            saved = SavedSession(name, **content, state=row[1])
            if saved.checksum() != checksum:
                raise ValueError("its checksum differs")
        except (sqlite3.Error, ValueError, KeyError, TypeError, AttributeError) as error:
            raise DamagedSessionError(f"what the journal holds of it is damaged ({error})") from error
        return saved

    def next_index(self, name: str) -> int | None:
        """Find the index behind a session's newest chunk; None if it has none."""
        query = "SELECT MAX(first_index + rows) FROM chunk WHERE name = ?"
        return self._reading.execute(query, (name,)).fetchone()[0]

    def keep(self, sessions: Sequence[SavedSession], chunks: Sequence[PendingChunk]) -> None:
        """Write states and the estimates that led to them, all or nothing.

        Raises:
            OSError: The file was removed or replaced, so that nobody could read what SQLite would write now.
        """
        for path, number in self._files.items():
            if not path.exists() or path.stat().st_ino != number:
                raise OSError(f"{path} was removed or replaced while the service ran; start it again")
        states, rows = _packed(map(_session_row, sessions)), _packed(each.row() for each in chunks)
        with self._turn:
            self._writing.execute("BEGIN IMMEDIATE")
            with self._writing:  # commits, or rolls back
                self._writing.execute(_KEEP_SESSIONS, states)
                self._writing.execute(_KEEP_CHUNKS, rows)

    def last_chunk(self) -> int:
        """Find the number of the newest chunk; 0 if there is none."""
        return int(self._reading.execute("SELECT COALESCE(MAX(id), 0) FROM chunk").fetchone()[0])

    def chunks(self, name: str, up_to: int, from_index: int = 0) -> Iterator[Chunk]:
        """Yield a session's chunks up to a number, oldest first, from the chunk that holds or follows an index on."""
        rows = self._reading.execute(
            "SELECT first_index, rows, content, samples, estimates FROM chunk "
            "WHERE name = ? AND id <= ? AND first_index + rows > ? ORDER BY id",
            (name, up_to, from_index),
        )
        for index, count, content, samples, estimates in rows:
            try:
                chunk = _chunk_of((name, index, count, json.loads(content), samples, estimates))
            except (ValueError, KeyError, TypeError) as error:
                _log.error("session %r: samples %d to %d are damaged (%s)", name, index, index + count - 1, error)
            else:
                yield chunk

    def forget(self, up_to: int, but: Collection[str] = ()) -> None:
        """Remove chunks up to a number that are in the history now, except those of sessions in ``but``.

        A few are removed at a time, so that others can write in between. What cannot be removed now can be later.
        """
        (first,) = self._reading.execute("SELECT COALESCE(MIN(id), 1) FROM chunk").fetchone()
        try:
            for begin in range(first, up_to + 1, _FORGOTTEN_AT_ONCE):
                end = min(up_to + 1, begin + _FORGOTTEN_AT_ONCE)
                with self._turn:
                    self._writing.execute(
                        "DELETE FROM chunk WHERE id >= ? AND id < ? AND name NOT IN (SELECT value FROM json_each(?))",
                        (begin, end, json.dumps(list(but))),
                    )
        except sqlite3.Error as error:
            _log.error("the journal keeps what lies in the history too: %s", error)

    def with_chunks(self, up_to: int) -> list[str]:
        """List the names of the sessions that have chunks up to a number."""
        rows = self._reading.execute("SELECT DISTINCT name FROM chunk WHERE id <= ? ORDER BY name", (up_to,))
        return [name for (name,) in rows]


def _session_row(session: SavedSession) -> tuple[str, dict[str, Any], bytes]:
    content = {"next_index": session.next_index, "counts": session.counts, "model": session.model}
    content["checksum"] = session.checksum()
    return session.name, content, session.state


def _readable(damaged: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a table by number, without those that cannot be read."""
    number = unreadable = 0
    while unreadable < _UNREADABLE_ROWS:
        try:
            rows = damaged.execute(f"SELECT * FROM {table} WHERE id >= ? ORDER BY id", (number,))  # noqa: S608
            for row in rows:
                number, unreadable = max(number, row[0]) + 1, 0
                yield row
            return
        except sqlite3.DatabaseError:
            number += 1
            unreadable += 1


def _packed(rows: Iterable[Sequence[Any]]) -> tuple[str, bytes]:
    """Pack rows as JSON with the place and length of each bytes value, from 1, and the bytes joined."""
    packed, contents, place = [], list[bytes](), 1
    for row in rows:
        fields: list[Any] = []
        for value in row:
            if isinstance(value, bytes):
                fields += (place, len(value))
                contents.append(value)
                place += len(value)
            else:
                fields.append(value)
        packed.append(fields)
    return json.dumps(packed), b"".join(contents)

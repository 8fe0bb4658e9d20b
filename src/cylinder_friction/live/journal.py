"""What a restart needs, in SQLite: each session's state, and every estimate since it was last moved into Parquet."""

import json
import sqlite3
import threading
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.live.frames import EstimateBlock
from cylinder_friction.live.models import SavedState, Switch

_SAME_TIME = 0.5
"""Share of the sample time by which the sender's clock may jitter between chunks that are kept as one."""
_FORGOTTEN_AT_ONCE = 1000
_PAGE_BYTES = 32768
"""A second of a session lies in one page then; spread over four of SQLite's 4096 bytes, it cost twice the time."""
_LOG_PAGES = 256
_VERSION = 2
_TABLES = f"""
CREATE TABLE IF NOT EXISTS session (name TEXT PRIMARY KEY, content TEXT NOT NULL, state BLOB NOT NULL, shadow BLOB)
    WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS chunk (
    id INTEGER PRIMARY KEY, name TEXT NOT NULL, first_index INTEGER NOT NULL, rows INTEGER NOT NULL,
    content TEXT NOT NULL, samples BLOB NOT NULL, estimates BLOB NOT NULL, shadow BLOB
);
CREATE INDEX IF NOT EXISTS chunk_of_session ON chunk (name, id);
PRAGMA user_version = {_VERSION};
"""


class JournalError(ValueError):
    """A file that is no journal of this version; the message states what to do."""


@dataclass(frozen=True)
class SavedSession:
    """A session as it was when it was last kept."""

    name: str
    next_index: int  # All samples before it are kept
    counts: dict[str, int]
    current: SavedState
    shadow: SavedState | None = None
    switch: Switch | None = None


@dataclass(slots=True)
class Chunk:
    """Successive samples of a session with their estimates."""

    name: str
    index: int  # Of the first
    time_s: float
    sample_time_s: float
    inputs: tuple[str, ...]
    samples: Array  # Shape ``(rows, inputs)``
    estimates: EstimateBlock | None  # None: they came after their gap had been given up, and were not stepped
    shadow: EstimateBlock | None = None  # Of a second model, where they are recorded

    @property
    def made_by(self) -> tuple[str | None, str | None]:
        """Model and second model."""
        of, beside = self.estimates, self.shadow
        return None if of is None else of.model, None if beside is None else beside.model


def merged(chunks: Sequence[Chunk]) -> list[Chunk]:
    """Return chunks with those of one session that follow each other, in index and in the sender's time, as one."""
    runs: list[list[Chunk]] = []
    for chunk in chunks:
        if runs and _follows(runs[-1][-1], chunk):
            runs[-1].append(chunk)
        else:
            runs.append([chunk])
    return [run[0] if len(run) == 1 else _one(run) for run in runs]


def _follows(last: Chunk, chunk: Chunk) -> bool:
    rows = len(last.samples)
    late_s = chunk.time_s - last.time_s - rows * last.sample_time_s
    same_time = abs(late_s) < _SAME_TIME * last.sample_time_s
    same = (chunk.name, chunk.made_by) == (last.name, last.made_by)
    return same and same_time and chunk.index == last.index + rows


def _one(run: Sequence[Chunk]) -> Chunk:
    samples = np.concatenate([each.samples for each in run])
    estimates, shadow = _joined([each.estimates for each in run]), _joined([each.shadow for each in run])
    return replace(run[0], samples=samples, estimates=estimates, shadow=shadow)


def _joined(parts: Sequence[EstimateBlock | None]) -> EstimateBlock | None:
    """Return the estimates of one model as one; None where the first part has none."""
    given = [part for part in parts if part is not None]
    if not given:
        return None
    flags = np.concatenate([each.flags for each in given])
    return replace(given[0], newtons=np.concatenate([each.newtons for each in given]), flags=flags)


class Journal:
    """Sessions and their latest estimates in one file; all of what is kept together, or nothing, when a kill comes.

    One thread reads while another keeps; those that write wait for each other.

    Args:
        path: Its file; made where there is none.

    Raises:
        JournalError: The file is of another version.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._writing, self._turn = (
            sqlite3.connect(path, check_same_thread=False, isolation_level=None),
            threading.Lock(),
        )
        tables = self._writing.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]
        version = self._writing.execute("PRAGMA user_version").fetchone()[0]
        if tables and version != _VERSION:
            self._writing.close()
            raise JournalError(
                f"{path}: a journal of version {version}, expected {_VERSION}; let the program that wrote it "
                "move it into the history (start and stop it once), or move the file away"
            )
        self._writing.executescript(
            f"PRAGMA page_size={_PAGE_BYTES}; PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL; "
            f"PRAGMA wal_autocheckpoint={_LOG_PAGES}; {_TABLES}"
        )
        self._reading = sqlite3.connect(path, check_same_thread=False, isolation_level=None)

    def close(self) -> None:
        """Close the file."""
        self._reading.close()
        self._writing.close()

    def session(self, name: str) -> SavedSession | None:
        """Return a session as it was last kept, or None."""
        row = self._reading.execute("SELECT content, state, shadow FROM session WHERE name = ?", (name,)).fetchone()
        if row is None:
            return None
        content, state, shadow = json.loads(row[0]), row[1], row[2]
        switch = content["switch"] and Switch.from_dict(content["switch"])
        beside = None if shadow is None else SavedState(content["shadow"], shadow)
        current = SavedState(content["model"], state)
        return SavedSession(name, content["next_index"], content["counts"], current, beside, switch)

    def names(self) -> list[str]:
        """Return the names of all sessions that were ever kept."""
        return [name for (name,) in self._reading.execute("SELECT name FROM session ORDER BY name")]

    def keep(self, sessions: Sequence[SavedSession], chunks: Sequence[Chunk]) -> None:
        """Keep states and the estimates that led to them, all or nothing."""
        rows = [_session_row(each) for each in sessions], [_chunk_row(each) for each in merged(chunks)]
        with self._turn:
            self._writing.execute("BEGIN IMMEDIATE")
            with self._writing:  # commits, or rolls back
                self._writing.executemany("INSERT OR REPLACE INTO session VALUES (?, ?, ?, ?)", rows[0])
                self._writing.executemany(
                    "INSERT INTO chunk (name, first_index, rows, content, samples, estimates, shadow) "
                    "VALUES (?, ?, ?, ?, ?, ?, ?)",
                    rows[1],
                )

    def last_chunk(self) -> int:
        """Return the number of the newest chunk; 0 where there is none."""
        return int(self._reading.execute("SELECT COALESCE(MAX(id), 0) FROM chunk").fetchone()[0])

    def chunks(self, name: str, up_to: int, from_index: int = 0) -> Iterator[Chunk]:
        """Yield a session's chunks, oldest first, up to a number, from the one that holds or follows an index."""
        rows = self._reading.execute(
            "SELECT first_index, rows, content, samples, estimates, shadow FROM chunk "
            "WHERE name = ? AND id <= ? AND first_index + rows > ? ORDER BY id",
            (name, up_to, from_index),
        )
        for index, count, content, samples, estimates, shadow in rows:
            of = json.loads(content)
            place = index, of["time_s"]
            yield Chunk(
                name, *place, of["sample_time_s"], tuple(of["inputs"]),
                np.frombuffer(samples, "<f8").reshape(count, -1),
                None if of["model"] is None else _from_bytes(*place, of["model"], estimates, count),
                None if shadow is None else _from_bytes(*place, of["shadow"], shadow, count),
            )  # fmt: skip

    def forget(self, up_to: int, but: Collection[str] = ()) -> None:
        """Drop chunks up to a number, but of no session in ``but``: they lie elsewhere now.

        Some at a time, so that others can write in between.
        """
        (first,) = self._reading.execute("SELECT COALESCE(MIN(id), 1) FROM chunk").fetchone()
        for begin in range(first, up_to + 1, _FORGOTTEN_AT_ONCE):
            end = min(up_to + 1, begin + _FORGOTTEN_AT_ONCE)
            with self._turn:
                self._writing.execute(
                    "DELETE FROM chunk WHERE id >= ? AND id < ? AND name NOT IN (SELECT value FROM json_each(?))",
                    (begin, end, json.dumps(list(but))),
                )

    def with_chunks(self, up_to: int) -> list[str]:
        """Return the names of the sessions that have chunks up to a number."""
        rows = self._reading.execute("SELECT DISTINCT name FROM chunk WHERE id <= ? ORDER BY name", (up_to,))
        return [name for (name,) in rows]


def _as_bytes(estimates: EstimateBlock | None) -> bytes | None:
    return None if estimates is None else estimates.newtons.tobytes() + estimates.flags.tobytes()


def _from_bytes(index: int, time_s: float, model: str, content: bytes, rows: int) -> EstimateBlock:
    newtons = np.frombuffer(content, "<f8", 3 * rows).reshape(rows, 3)
    return EstimateBlock(0, index, time_s, newtons, np.frombuffer(content, "<u4", rows, 24 * rows), model)


def _session_row(session: SavedSession) -> tuple[str, str, bytes, bytes | None]:
    content = {
        "next_index": session.next_index,
        "counts": session.counts,
        "model": session.current.model,
        "shadow": session.shadow and session.shadow.model,
        "switch": session.switch and session.switch.as_dict(),
    }
    shadow = None if session.shadow is None else session.shadow.state
    return session.name, json.dumps(content), session.current.state, shadow


def _chunk_row(chunk: Chunk) -> tuple[str, int, int, str, bytes, bytes, bytes | None]:
    model, shadow_model = chunk.made_by
    content = {
        "time_s": chunk.time_s, "sample_time_s": chunk.sample_time_s, "inputs": chunk.inputs, "model": model,
        "shadow": shadow_model,
    }  # fmt: skip
    return (
        chunk.name, chunk.index, len(chunk.samples), json.dumps(content), chunk.samples.tobytes(),
        _as_bytes(chunk.estimates) or b"", _as_bytes(chunk.shadow),
    )  # fmt: skip

"""What a restart needs, in SQLite: each session's state, and every estimate since it was last moved into Parquet."""

import json
import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array

_SAME_TIME = 0.5
"""Share of the sample time by which the sender's clock may jitter between chunks that are kept as one."""
_TABLES = """
CREATE TABLE IF NOT EXISTS session (
    name TEXT PRIMARY KEY, model TEXT NOT NULL, next_index INTEGER NOT NULL, state BLOB NOT NULL, counts TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS chunk (
    id INTEGER PRIMARY KEY, name TEXT NOT NULL, first_index INTEGER NOT NULL, time_s REAL NOT NULL,
    sample_time_s REAL NOT NULL, inputs TEXT NOT NULL, rows INTEGER NOT NULL, samples BLOB NOT NULL,
    newtons BLOB NOT NULL, flags BLOB NOT NULL
);
"""


@dataclass(frozen=True)
class SavedSession:
    """A session as it was when it was last kept."""

    name: str
    model: str  # SHA-256 of the model whose state it is
    next_index: int  # All samples before it are kept
    state: bytes
    counts: dict[str, int]


@dataclass(frozen=True)
class Chunk:
    """Successive samples of a session with their estimates."""

    name: str
    index: int  # Of the first
    time_s: float
    sample_time_s: float
    inputs: tuple[str, ...]
    samples: Array  # Shape ``(rows, inputs)``
    newtons: Array  # Friction, lower, upper [N], shape ``(rows, 3)``
    flags: NDArray[np.uint32]


def merged(chunks: Sequence[Chunk]) -> list[Chunk]:
    """Return chunks of one session with those that follow each other, in index and in the sender's time, as one."""
    runs: list[list[Chunk]] = []
    for chunk in chunks:
        last = runs[-1][-1] if runs else None
        rows = 0 if last is None else len(last.flags)
        if last is not None and (
            chunk.index == last.index + rows
            and abs(chunk.time_s - last.time_s - rows * last.sample_time_s) < _SAME_TIME * last.sample_time_s
        ):
            runs[-1].append(chunk)
        else:
            runs.append([chunk])
    return [run[0] if len(run) == 1 else _one(run) for run in runs]


def _one(run: Sequence[Chunk]) -> Chunk:
    return replace(
        run[0],
        samples=np.concatenate([each.samples for each in run]),
        newtons=np.concatenate([each.newtons for each in run]),
        flags=np.concatenate([each.flags for each in run]),
    )


class Journal:
    """Sessions and their latest estimates in one file; all of what is kept together, or nothing, when a kill comes.

    Args:
        path: Its file; made where there is none.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._database = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        self._database.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL;" + _TABLES)

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def session(self, name: str) -> SavedSession | None:
        """Return a session as it was last kept, or None."""
        row = self._database.execute(
            "SELECT name, model, next_index, state, counts FROM session WHERE name = ?", (name,)
        ).fetchone()
        if row is None:
            return None
        known, model, next_index, state, counts = row
        return SavedSession(known, model, next_index, state, json.loads(counts))

    def names(self) -> list[str]:
        """Return the names of all sessions that were ever kept."""
        return [name for (name,) in self._database.execute("SELECT name FROM session ORDER BY name")]

    def keep(self, sessions: Sequence[SavedSession], chunks: Sequence[Chunk]) -> None:
        """Keep states and the estimates that led to them, all or nothing."""
        with self._transaction():
            self._database.executemany(
                "INSERT OR REPLACE INTO session VALUES (?, ?, ?, ?, ?)",
                [(each.name, each.model, each.next_index, each.state, json.dumps(each.counts)) for each in sessions],
            )
            self._database.executemany(
                "INSERT INTO chunk (name, first_index, time_s, sample_time_s, inputs, rows, samples, newtons, flags) "
                "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                [
                    (
                        each.name, each.index, each.time_s, each.sample_time_s, json.dumps(each.inputs),
                        len(each.flags), each.samples.tobytes(), each.newtons.tobytes(), each.flags.tobytes(),
                    )
                    for each in chunks
                ],
            )  # fmt: skip

    def last_chunk(self) -> int:
        """Return the number of the newest chunk; 0 where there is none."""
        return int(self._database.execute("SELECT COALESCE(MAX(id), 0) FROM chunk").fetchone()[0])

    def chunks(self, name: str, up_to: int, from_index: int = 0) -> Iterator[Chunk]:
        """Yield a session's chunks, oldest first, up to a number, from the one that holds or follows an index."""
        rows = self._database.execute(
            "SELECT name, first_index, time_s, sample_time_s, inputs, rows, samples, newtons, flags FROM chunk "
            "WHERE name = ? AND id <= ? AND first_index + rows > ? ORDER BY id",
            (name, up_to, from_index),
        )
        for who, index, time_s, sample_time_s, inputs, count, samples, newtons, flags in rows:
            yield Chunk(
                who, index, time_s, sample_time_s, tuple(json.loads(inputs)),
                np.frombuffer(samples, "<f8").reshape(count, -1), np.frombuffer(newtons, "<f8").reshape(count, 3),
                np.frombuffer(flags, "<u4"),
            )  # fmt: skip

    def forget(self, name: str, up_to: int) -> None:
        """Drop a session's chunks up to a number: they lie elsewhere now."""
        self._database.execute("DELETE FROM chunk WHERE name = ? AND id <= ?", (name, up_to))

    def with_chunks(self, up_to: int) -> list[str]:
        """Return the names of the sessions that have chunks up to a number."""
        rows = self._database.execute("SELECT DISTINCT name FROM chunk WHERE id <= ? ORDER BY name", (up_to,))
        return [name for (name,) in rows]

    def _transaction(self) -> sqlite3.Connection:
        self._database.execute("BEGIN IMMEDIATE")
        return self._database  # as a context it commits, or rolls back

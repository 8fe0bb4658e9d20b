"""Sessions whose samples come together: a message of theirs is stepped and answered as a whole.

Most messages hold one block for each of the same sessions, and continue all of them without a gap. Such a message takes
one call into C, which also writes the answer. Both are kept as they are. The sessions get their parts when somebody
looks at one of them, at the latest when it is written to the journal. ``LiveService.receive`` takes all other messages.
"""

from collections.abc import Collection, Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import (
    FLAG_BYTES,
    LARGEST_INDEX,
    LATEST_S,
    ROW_BYTES,
    SAMPLES,
    EstimateBlock,
    SampleBlock,
)
from cylinder_friction_live.journal import SAME_TIME
from cylinder_friction_live.service import LiveService, LiveSession, Owner

_HANDLE = slice(4, 8)
"""Place of the first handle in a message."""


@lru_cache(64)
def _layouts(columns: int, rows: int) -> tuple[np.dtype[np.void], np.dtype[np.void]]:
    """Describe a block of samples and a block of estimates. ``place``: kind, columns, rows and handle; index."""
    head: list[Any] = [("place", "<u8", 2), ("time_s", "<f8")]
    estimates = [("newtons", f"V{ROW_BYTES * rows}"), ("flags", f"V{FLAG_BYTES * rows}")]
    padding = [("padding", f"V{FLAG_BYTES}")] if rows % 2 else []
    return np.dtype([*head, ("samples", f"V{8 * columns * rows}")]), np.dtype([*head, *estimates, *padding])


class SessionGroups:
    """The groups of one connection's sessions.

    Args:
        service: The service with the sessions.
        owner: The connection.
        in_text: Names of sessions whose estimates the connection sends as text; their messages are for ``receive``.
    """

    def __init__(self, service: LiveService, owner: Owner, in_text: Collection[str]) -> None:
        self._service, self._owner, self._in_text = service, owner, in_text
        self._groups: dict[bytes, _Group] = {}  # By the first handle
        self._heads: dict[bytes, int] = {}  # Hash of the headers in the last message for ``receive``, by first handle

    def step(self, message: bytes) -> tuple[int, bytes | None]:
        """Step through a message that continues all sessions of a group; do nothing with any other.

        Returns the number of samples, and the estimates as frames; None if the message is for ``LiveService.receive``.
        """
        group = self._groups.get(message[_HANDLE])
        return (0, None) if group is None else group.step(message, self._owner, self._in_text)

    def note(self, message: bytes, blocks: Sequence[SampleBlock]) -> None:
        """Make a group of the sessions of a message that ``receive`` took, if two such messages had the same."""
        first, heads = message[_HANDLE], hash(tuple([(block.handle, block.rows) for block in blocks]))
        if self._heads.get(first) != heads:
            self._heads[first] = heads
            self._groups.pop(first, None)
        elif first not in self._groups and _alike(blocks):
            if sum(len(each) for each in self._groups.values()) > self._service.limits.sessions:
                self._groups.clear()
                self._heads.clear()
            self._groups[first] = _Group(self._service, blocks)


def _alike(blocks: Sequence[SampleBlock]) -> bool:
    """Check that blocks have as many rows each, and a session each."""
    return len({block.rows for block in blocks}) == 1 and len({block.handle for block in blocks}) == len(blocks)


class _Group:
    """Sessions that come together in this order, and their messages that are not settled yet."""

    def __init__(self, service: LiveService, blocks: Sequence[SampleBlock]) -> None:
        self._columns, self._rows = blocks[0].columns, blocks[0].rows
        self._service, self._step_s = service, service.engine.sample_time_s
        self._handles = [block.handle for block in blocks]
        heads = [SAMPLES | self._columns << 8 | self._rows << 16 | handle << 32 for handle in self._handles]
        self._place = np.array([heads, heads], np.uint64).T  # As in the next message; the second column is the index
        self._samples_layout, estimates_layout = _layouts(self._columns, self._rows)
        self._answer = np.empty(len(blocks), estimates_layout)
        self._messages: list[bytes] = []
        self._answers: list[bytes] = []

    def __len__(self) -> int:
        return len(self._handles)

    def step(self, message: bytes, owner: Owner, in_text: Collection[str]) -> tuple[int, bytes | None]:
        """Step through a message if it continues all sessions."""
        if len(message) != len(self) * self._samples_layout.itemsize:
            return 0, None
        blocks = np.frombuffer(message, self._samples_layout)
        if not self._messages and not self._begin(blocks["time_s"], owner, in_text):
            return 0, None
        late_s = blocks["time_s"] - self._chunk_s - self._chunk_rows * self._step_s
        if not (np.abs(late_s) < SAME_TIME * self._step_s).all() or (blocks["place"] != self._place).any():
            return 0, None
        self._last_index += self._rows
        self._last_s += self._rows * self._step_s
        if self._last_index > LARGEST_INDEX or not self._last_s < LATEST_S:
            self.settle()
            return 0, None
        if not self._messages:
            for session in self._sessions:
                session.unsettled = self
        answer = self._service.engine.run_frames(self._slots, self._rows, message, self._answer)
        self._messages.append(message)
        self._answers.append(answer)
        self._seen_s = self._service.now_s
        self._place[:, 1] += np.uint64(self._rows)
        self._chunk_rows += self._rows
        self._service.note_together(self._sessions, self._rows, self._answer["flags"].tobytes())
        if self._service.takers:
            for session, estimates in zip(self._sessions, self._estimates(blocks), strict=True):
                for take in self._service.takers:
                    take(session, estimates)
        return len(self) * self._rows, answer

    def _begin(self, times_s: Array, owner: Owner, in_text: Collection[str]) -> bool:
        """Look up where the sessions are; return whether all are this owner's and hold no samples back."""
        self._sessions: list[LiveSession] = []
        for handle in self._handles:
            session = self._service.session_with(handle)
            if session is None or session.owner is not owner or session.name in in_text or not session.order.goes_on:
                return False
            self._sessions.append(session)
        self._slots = np.array([each.slot for each in self._sessions], np.uint32)
        self._place[:, 1] = [each.next_index for each in self._sessions]
        chunks = [each.growing_chunk for each in self._sessions]
        begun = list(zip(chunks, times_s.tolist(), strict=True))
        self._chunk_s = np.array([time_s if chunk is None else chunk.time_s for chunk, time_s in begun])
        self._chunk_rows = np.array([0 if chunk is None else chunk.rows for chunk in chunks])
        due_s = self._chunk_s + self._chunk_rows * self._step_s
        self._last_index, self._last_s = int(self._place[:, 1].max()), float(due_s.max()) + self._step_s
        return bool(due_s.min() >= self._step_s)  # the time of no later message is negative then

    def settle(self) -> None:
        """Give the sessions their samples and estimates."""
        messages, answers, self._messages, self._answers = self._messages, self._answers, [], []
        if not messages:
            return
        blocks = np.frombuffer(b"".join(messages), self._samples_layout).reshape(len(messages), -1)
        estimates = np.frombuffer(b"".join(answers), self._answer.dtype).reshape(len(messages), -1)
        last_s = blocks["time_s"][-1] + (self._rows - 1) * self._step_s
        columns = [blocks["place"][0, :, 1].tolist(), blocks["time_s"][0].tolist(), last_s.tolist()]
        parts = _by_session(blocks["samples"]), _by_session(estimates["newtons"]), _by_session(estimates["flags"])
        rows = zip(self._sessions, *columns, *parts, strict=True)
        for session, index, time_s, newest_s, samples, newtons, flags in rows:
            block = SampleBlock(session.handle, index, time_s, samples, self._columns)
            given = EstimateBlock(session.handle, index, time_s, newtons, flags, session.model)
            session.settled(block, given, newest_s, self._seen_s)

    def _estimates(self, blocks: NDArray[np.void]) -> Iterator[EstimateBlock]:
        """Make the estimates of the newest message, one block per session."""
        model, contents = self._service.engine.model, (self._answer["newtons"], self._answer["flags"])
        places = zip(self._handles, blocks["place"][:, 1].tolist(), blocks["time_s"].tolist(), *contents, strict=True)
        for handle, index, time_s, newtons, flags in places:
            yield EstimateBlock(handle, index, time_s, newtons.tobytes(), flags.tobytes(), model)


def _by_session(contents: NDArray[np.void]) -> list[bytes]:
    """Join the contents of each session's blocks, shape ``(messages, sessions)``."""
    return [each.tobytes() for each in np.ascontiguousarray(contents.T)]

"""Sessions whose samples come together: a message of theirs is stepped and answered as a whole.

Most messages hold one block for each of the same sessions, and continue all of them without a gap. Such a message takes
one call into C, which also writes the answer. Both are kept as they are. The sessions get their parts when somebody
looks at one of them, at the latest when it is written to the journal. ``LiveService.receive`` takes all other messages.
"""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import LARGEST_INDEX, LATEST_S, SAMPLES, EstimateBlock, SampleBlock, layouts, unpack
from cylinder_friction_live.journal import SAME_TIME
from cylinder_friction_live.service import LiveService, Owner

_HANDLE = slice(4, 8)
"""Place of the first handle in a message."""


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

    def step(self, message: bytes) -> tuple[int, bytes | None]:
        """Step through a message that continues all sessions of a group; do nothing with any other.

        Returns the number of samples, and the estimates as frames; None if the message is for ``LiveService.receive``.
        """
        group = self._groups.get(message[_HANDLE])
        return (0, None) if group is None else group.step(message, self._owner, self._in_text)

    def note(self, message: bytes, blocks: Sequence[SampleBlock]) -> None:
        """Make a group of the sessions of a message that ``receive`` took, for messages like it."""
        different = {block.handle for block in blocks}
        if len(different) == len(blocks) and len({block.rows for block in blocks}) == 1:
            if sum(len(each) for each in self._groups.values()) > self._service.limits.sessions:
                self._groups.clear()
            self._groups[message[_HANDLE]] = _Group(self._service, blocks)


class _Group:
    """Sessions that come together in this order, and their messages that are not settled yet."""

    def __init__(self, service: LiveService, blocks: Sequence[SampleBlock]) -> None:
        self._columns, self._rows = blocks[0].columns, blocks[0].rows
        self._service, self._step_s = service, service.engine.sample_time_s
        self._handles = [block.handle for block in blocks]
        heads = [SAMPLES | self._columns << 8 | self._rows << 16 | handle << 32 for handle in self._handles]
        self._place = np.array([heads, heads], np.uint64).T  # As in the next message; the second column is the index
        self._samples_layout, estimates_layout = layouts(self._columns, self._rows)
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
        in_time = np.abs(late_s).max() < SAME_TIME * self._step_s
        if not in_time or blocks["place"].tobytes() != self._place.tobytes():
            return 0, None
        if not self._messages:
            for session in self._sessions:
                session.unsettled = self._settle
        service, rows = self._service, len(self) * self._rows
        answer = service.engine.run_frames(self._slots, self._rows, message, self._answer)
        self._messages.append(message)
        self._answers.append(answer)
        self._seen_s = service.now_s
        self._place[:, 1] += self._rows
        self._chunk_rows += self._rows
        service.unkept_rows += rows
        service.flags.note(self._answer["flags"].tobytes())
        if service.takers:
            for session, block in zip(self._sessions, unpack(answer), strict=True):
                assert isinstance(block, EstimateBlock)
                block.model = session.model
                for take in service.takers:
                    take(session, block)
        return rows, answer

    def _begin(self, times_s: Array, owner: Owner, in_text: Collection[str]) -> bool:
        """Look up the sessions; return whether all are this owner's and ready for their next samples."""
        sessions = [self._service.by_handle.get(handle) for handle in self._handles]
        self._sessions = [each for each in sessions if each is not None and each.owner is owner]
        if len(self._sessions) < len(self) or any(each.name in in_text for each in self._sessions):
            return False
        if any(each.order.held_rows or each.order.next_index is None for each in self._sessions):
            return False
        self._slots = np.array([each.slot for each in self._sessions], np.uint32)
        self._place[:, 1] = [each.next_index for each in self._sessions]
        chunks = [each.pending[-1] if each.pending else None for each in self._sessions]
        growing = [None if chunk is None or chunk.model is None else chunk for chunk in chunks]
        begun = zip(growing, times_s.tolist(), strict=True)
        self._chunk_s = np.array([time_s if chunk is None else chunk.time_s for chunk, time_s in begun])
        self._chunk_rows = np.array([0 if chunk is None else chunk.rows for chunk in growing])
        due_s = self._chunk_s + self._chunk_rows * self._step_s
        # Far from the limits of ``receive``, so that nothing that follows in time can reach them
        usual = self._step_s <= due_s.min() and due_s.max() < LATEST_S / 2
        return bool(usual and self._place[:, 1].max() < LARGEST_INDEX // 2)

    def _settle(self) -> None:
        """Give the sessions their samples and estimates."""
        messages, answers, self._messages, self._answers = self._messages, self._answers, [], []
        blocks = np.frombuffer(b"".join(messages), self._samples_layout).reshape(len(messages), -1)
        estimates = np.frombuffer(b"".join(answers), self._answer.dtype).reshape(len(messages), -1)
        last_s = blocks["time_s"][-1] + (self._rows - 1) * self._step_s
        columns = [blocks["place"][0, :, 1].tolist(), blocks["time_s"][0].tolist(), last_s.tolist()]
        parts = [_by_session(each) for each in (blocks["samples"], estimates["newtons"], estimates["flags"])]
        for session in self._sessions:
            session.unsettled = None
        rows = zip(self._sessions, *columns, *parts, strict=True)
        for session, index, time_s, newest_s, samples, newtons, flags in rows:
            block = SampleBlock(session.handle, index, time_s, samples, self._columns)
            session.order.receive(block, self._seen_s)
            session.add(block, EstimateBlock(session.handle, index, time_s, newtons, flags, session.model))
            session.pending[-1].last_time_s = newest_s


def _by_session(contents: NDArray[np.void]) -> list[bytes]:
    """Join the contents of each session's blocks, shape ``(messages, sessions)``."""
    return [each.tobytes() for each in np.ascontiguousarray(contents.T)]

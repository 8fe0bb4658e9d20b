"""Sessions, the engine and the journal put together; knows no network."""

import math
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from cylinder_friction.live.engine import Engine, Job
from cylinder_friction.live.frames import EstimateBlock, SampleBlock
from cylinder_friction.live.journal import Chunk, Journal, SavedSession, merged
from cylinder_friction.live.session import Counts, Piece, SessionOrder
from cylinder_friction.live.settings import LiveLimits, SessionRules

_NAME = re.compile(r"[\w.:/ -]{1,80}")
CLOCK_TOLERANCE = 2e-3
"""How much the stated sample time may differ from the model's; beyond it the model would be wrong."""


class LiveError(ValueError):
    """A request that cannot be met; the message states what was got and what is expected."""


@dataclass
class LiveSession:
    """One open session."""

    name: str
    handle: int
    slot: int
    order: SessionOrder
    chunks: list[Chunk] = field(default_factory=list)  # Not kept yet
    kept_index: int = 0  # All samples before it are kept
    last_seen_s: float = 0.0  # On the monotonic clock

    @property
    def next_index(self) -> int:
        """Index of the sample that is stepped next."""
        return self.order.next_index or 0


class LiveService:
    """Friction of many cylinders: samples go in by session and index, estimates come out in order.

    Args:
        engine: Of the one model that all sessions run.
        journal: Where states and estimates are kept.
        on_estimates: Called with a session and the estimates of successive samples, as soon as they are there.
    """

    def __init__(
        self,
        engine: Engine,
        journal: Journal,
        on_estimates: Callable[[LiveSession, EstimateBlock], None] | None = None,
        rules: SessionRules | None = None,
        limits: LiveLimits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.engine, self.journal, self.on_estimates = engine, journal, on_estimates
        self.rules, self.limits, self._clock = rules or SessionRules(), limits or LiveLimits(), clock
        self.sessions: dict[str, LiveSession] = {}
        self._by_handle: dict[int, LiveSession] = {}
        self._next_handle = 1
        self.unkept_rows = 0

    def open(self, name: str, inputs: Sequence[str], sample_time_s: float) -> LiveSession:
        """Return the session of that name, where it stood when it was last kept, or a new one.

        Raises:
            LiveError: The name is not one, there are too many sessions, or columns or sample time are not the model's.
        """
        self._refuse_other_samples(name, inputs, sample_time_s)
        if name in self.sessions:
            return self.sessions[name]
        if len(self.sessions) >= self.limits.sessions:
            raise LiveError(f"session {name!r}: {len(self.sessions)} sessions are open, all that are taken; try later")
        saved = self.journal.session(name)
        slot = self.engine.add()
        order = SessionOrder(self.engine.sample_time_s, len(self.engine.inputs), self.rules)
        if saved is not None:
            order.next_index, order.counts = saved.next_index, Counts.from_dict(saved.counts)
            if saved.model == self.engine.model:
                self.engine.restore(slot, saved.state)
            else:
                order.counts.resets += 1
        session = LiveSession(name, self._next_handle, slot, order, last_seen_s=self._clock())
        session.kept_index = session.next_index
        self.sessions[name] = self._by_handle[session.handle] = session
        self._next_handle += 1
        return session

    def given_from(self, session: LiveSession, index: int) -> list[EstimateBlock]:
        """Return the estimates from ``index`` on that have been given already, as far back as the journal goes."""
        chunks = [*self.journal.chunks(session.name, self.journal.last_chunk(), index), *session.chunks]
        blocks = []
        for chunk in chunks:
            known = max(0, index - chunk.index)
            if known < len(chunk.flags):
                time_s = chunk.time_s + known * chunk.sample_time_s
                newtons, flags = chunk.newtons[known:], chunk.flags[known:]
                blocks.append(EstimateBlock(session.handle, chunk.index + known, time_s, newtons, flags))
        return blocks

    def session_of(self, block: SampleBlock) -> LiveSession:
        """Return the session of a block.

        Raises:
            LiveError: No session has its handle, or its columns are not the model's.
        """
        session = self._by_handle.get(block.handle)
        if session is None:
            raise LiveError(f"handle {block.handle}: no open session has it; open the session first")
        if block.samples.shape[1] != len(self.engine.inputs):
            raise LiveError(
                f"session {session.name!r}: got {block.samples.shape[1]} columns; expected {list(self.engine.inputs)}"
            )
        if not math.isfinite(block.time_s):
            raise LiveError(f"session {session.name!r}: got time {block.time_s}; expected seconds since 1970")
        return session

    def receive(self, blocks: Sequence[SampleBlock]) -> None:
        """Step through all that can be stepped now, of all blocks in one call.

        Raises:
            LiveError: As ``session_of``; none of the blocks is used.
        """
        owners = [self.session_of(block) for block in blocks]
        now_s = self._clock()
        pieces: list[tuple[LiveSession, Piece]] = []
        for session, block in zip(owners, blocks, strict=True):
            session.last_seen_s = now_s
            found = session.order.receive(block.index, block.time_s, block.samples, now_s)
            pieces += [(session, piece) for piece in found]
        self._step(pieces)

    def overdue(self) -> None:
        """Step over gaps that have been waited for long enough."""
        now_s = self._clock()
        self._step([(each, piece) for each in self.sessions.values() for piece in each.order.overdue(now_s)])

    def load(self) -> dict[str, int]:
        """Return what the service holds just now, as counts."""
        held = sum(each.order.held_rows for each in self.sessions.values())
        return {"sessions": len(self.sessions), "held_rows": held, "unkept_rows": self.unkept_rows}

    def unkept(self) -> tuple[list[SavedSession], list[Chunk]]:
        """Return what ``Journal.keep`` is to keep; from now on it counts as handed over."""
        saved, chunks = [], []
        for session in self.sessions.values():
            if session.chunks:
                saved.append(
                    SavedSession(
                        session.name, self.engine.model, session.next_index, self.engine.saved(session.slot),
                        dict(vars(session.order.counts)),
                    )
                )  # fmt: skip
                chunks += merged(session.chunks)
                session.chunks = []
        self.unkept_rows = 0
        return saved, chunks

    def kept(self, saved: Sequence[SavedSession]) -> list[LiveSession]:
        """Note what has been kept; return the sessions whose samples can be acknowledged."""
        known = [(self.sessions[each.name], each.next_index) for each in saved if each.name in self.sessions]
        for session, index in known:
            session.kept_index = index
        return [session for session, _ in known]

    def keep(self) -> list[LiveSession]:
        """Keep everything now; return the sessions whose samples can be acknowledged."""
        saved, chunks = self.unkept()
        self.journal.keep(saved, chunks)
        return self.kept(saved)

    def close_idle(self) -> list[str]:
        """Close sessions that have rested for long, all of whose samples are kept; return their names."""
        now_s = self._clock()
        idle = [
            each
            for each in self.sessions.values()
            if now_s - each.last_seen_s > self.limits.idle_s and not each.chunks and each.kept_index == each.next_index
        ]
        for session in idle:
            self.engine.remove(session.slot)
            del self.sessions[session.name], self._by_handle[session.handle]
        return [session.name for session in idle]

    def _step(self, pieces: Sequence[tuple[LiveSession, Piece]]) -> None:
        if not pieces:
            return
        results = self.engine.run([Job(session.slot, piece.samples, piece.reset) for session, piece in pieces])
        for (session, piece), (newtons, flags) in zip(pieces, results, strict=True):
            block = EstimateBlock(session.handle, piece.index, piece.time_s, newtons, flags)
            session.chunks.append(
                Chunk(
                    session.name, piece.index, piece.time_s, self.engine.sample_time_s, self.engine.inputs,
                    piece.samples, newtons, flags,
                )
            )  # fmt: skip
            self.unkept_rows += len(flags)
            if self.on_estimates is not None:
                self.on_estimates(session, block)

    def _refuse_other_samples(self, name: str, inputs: Sequence[str], sample_time_s: float) -> None:
        if not _NAME.fullmatch(name):
            raise LiveError(
                f"session {name[:80]!r}: expected 1 to 80 letters, digits, spaces and _ . : / - as a session's name"
            )
        if tuple(inputs) != self.engine.inputs:
            raise LiveError(f"session {name!r}: got columns {list(inputs)}; the model takes {list(self.engine.inputs)}")
        if not abs(sample_time_s / self.engine.sample_time_s - 1.0) <= CLOCK_TOLERANCE:
            raise LiveError(
                f"session {name!r}: got a sample time of {sample_time_s} s; the model was trained at "
                f"{self.engine.sample_time_s} s; resample, or train a model at that rate"
            )

"""The service without its network: sessions, their model and the journal."""

import logging
import re
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Protocol
from urllib.parse import quote

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.flags import UNKNOWN, unknown_in_words
from cylinder_friction.signals.noise import times_as_noisy
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.frames import LARGEST_INDEX, LATEST_S, EstimateBlock, SampleBlock
from cylinder_friction_live.history import next_index_of
from cylinder_friction_live.journal import Chunk, DamagedSessionError, Journal, LastRow, PendingChunk, SavedSession
from cylinder_friction_live.noise import ROWS_BETWEEN, NoiseWindow
from cylinder_friction_live.session import Counts, SessionOrder
from cylinder_friction_live.settings import LiveLimits, SessionRules
from cylinder_friction_live.totals import FlagTotals

_NAME = re.compile(r"(?=.*\w)[\w.:/ -]{1,80}")
LONGEST_NAME = 200
"""Most bytes of a session's name as a folder's name, in which a letter of another script takes up to twelve."""
LARGEST_JUMP = 1 << 32
"""Most samples that may be missing before one whose index is above half of the largest index."""
CLOCK_TOLERANCE = 2e-3
"""Share by which the stated sample time may differ from the model's."""
_log = logging.getLogger(__name__)


class LiveError(ValueError):
    """A request is refused; the message states what was got and what is expected."""


class BusyError(LiveError):
    """A request is refused for now; the client may try again later."""


class Owner(Protocol):
    """The connection that opened a session last, and gets its estimates."""

    client: str
    user: str

    def put_estimates(self, estimates: Iterable[tuple["LiveSession", EstimateBlock]]) -> None:
        """Queue new estimates of its sessions."""

    def put_acknowledgement(self, session: "LiveSession") -> None:
        """Queue an acknowledgement of samples."""

    def lost(self, session: "LiveSession") -> None:
        """React to the session's change to another owner."""


@dataclass(slots=True)
class LiveSession:
    """One open session."""

    name: str
    handle: int
    engine: Engine
    slot: int  # Place of its state in the engine
    _order: SessionOrder
    noise: NoiseWindow
    unsettled: Callable[[], None] | None = None  # Brings ``_order`` and ``_pending`` up to date
    _pending: list[PendingChunk] = field(default_factory=list)
    handed_over: list[PendingChunk] = field(default_factory=list)  # Chunks that the journal may still refuse
    kept_index: int = 0  # All samples before it are in the journal
    last_kept: LastRow | None = None  # Newest estimate in the journal since the session was opened
    flagged: Counter[str] = field(default_factory=Counter)  # Rows kept since then with each flag of ``UNKNOWN``
    owner: "Owner | None" = None
    begins_anew: str = ""  # Why it began anew; empty if it resumed, or once new estimates are in the journal

    def settle(self) -> None:
        """Take over the samples that were stepped together with those of other sessions."""
        if self.unsettled is not None:
            self.unsettled()

    @property
    def order(self) -> SessionOrder:
        """The order of its samples."""
        self.settle()
        return self._order

    @property
    def pending(self) -> list[PendingChunk]:
        """Chunks that are not handed over yet, in order."""
        self.settle()
        return self._pending

    @property
    def next_index(self) -> int:
        """Index of the sample that is stepped next."""
        return self.order.next_index or 0

    @property
    def is_kept(self) -> bool:
        """Whether the journal holds all of it, so that it can be closed."""
        if self.unsettled is not None or self._pending or self.handed_over:
            return False
        return self.kept_index == self.next_index

    @property
    def model(self) -> str:
        """SHA-256 of the model that makes the estimates."""
        return self.engine.model

    @property
    def latest(self) -> LastRow | None:
        """The newest estimate since the session was opened."""
        chunks = [each for each in (*self.handed_over, *self.pending) if each.newtons]
        return chunks[-1].last() if chunks else self.last_kept

    def add(self, block: SampleBlock, estimates: EstimateBlock | None) -> None:
        """Add samples to what waits for the journal."""
        pending = self.pending
        if not (pending and pending[-1].add(block, estimates)):
            model, step_s = None if estimates is None else self.model, self.engine.sample_time_s
            pending.append(PendingChunk(self.name, block.index, block.time_s, step_s, self.engine.inputs, model))
            pending[-1].add(block, estimates)

    def hand_over(self) -> list[PendingChunk]:
        """Take the chunks that wait for the journal; from now on they count as handed over."""
        self.handed_over, self._pending = self.pending, []
        return self.handed_over

    def take_back(self) -> list[PendingChunk]:
        """Let the chunks that were handed over wait again; return them."""
        chunks, self.handed_over = self.handed_over, []
        self._pending = chunks + self.pending
        return chunks

    def note_kept(self, next_index: int) -> None:
        """Mark the handed-over chunks as kept, count their rows by flags, and measure the noise of their pressures."""
        flags = np.frombuffer(b"".join([flags for each in self.handed_over for flags in each.flags]), "<u4")
        self.flagged["rows"] += len(flags)
        if flags.any():
            for flag in UNKNOWN:
                self.flagged[str(flag.name)] += int(np.count_nonzero(flags & int(flag)))
        for each in self.handed_over:
            if each.newtons:
                self.last_kept = each.last()
                if not self.noise.waits(each.rows):
                    self.noise.take(each.chunk().samples)
        self.kept_index, self.handed_over, self.begins_anew = next_index, [], ""

    @property
    def not_known(self) -> str:
        """Why the estimates are not to be used as they are; empty if they may be."""
        return unknown_in_words(self.flagged["rows"], self.flagged)

    @property
    def too_narrow(self) -> str:
        """Why the bounds are too narrow; empty if nothing shows that they are."""
        times = times_as_noisy(self.noise.noise_pa, self.engine.pressure_noise_pa)
        words = f"pressures are {times:.1f} times as noisy as those that this model knows, and bounds are too narrow"
        return words if times > 1.0 else ""

    def refuse_others(self, owner: Owner) -> None:
        """Raise ``LiveError`` if the session is another client's."""
        if self.owner is not owner:
            raise LiveError(f"session {self.name!r}: another connection has opened it; open it to take it over")

    def saved(self) -> SavedSession:
        """Collect everything that a restart needs."""
        counts = dict(vars(self.order.counts))
        return SavedSession(self.name, self.next_index, counts, self.model, self.engine.saved(self.slot))


Taker = Callable[[LiveSession, EstimateBlock], None]


def _owner(given: tuple[LiveSession, EstimateBlock]) -> Owner | None:
    return given[0].owner


class LiveService:
    """Friction of many cylinders: samples go in by session and index, estimates come out in order.

    Args:
        engine: Engine of the model for all sessions. A session that another model wrote begins anew.
        journal: Storage of states and estimates.
        takers: Functions called with a session and its new estimates.
    """

    def __init__(
        self,
        engine: Engine,
        journal: Journal,
        rules: SessionRules | None = None,
        limits: LiveLimits | None = None,
        takers: Iterable[Taker] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.engine, self.journal, self.flags = engine, journal, FlagTotals()
        self.takers = list(takers)
        self.rules, self.limits, self._clock = rules or SessionRules(), limits or LiveLimits(), clock
        self.sessions: dict[str, LiveSession] = {}
        self.by_handle: dict[int, LiveSession] = {}
        self._holding: dict[int, LiveSession] = {}  # Sessions with samples that wait for earlier ones, by handle
        self._next_handle = 1
        self.unkept_rows, self._kept_s = 0, clock()
        self._closed_outcomes = Counter(vars(Counts()))  # Less the counts of open sessions from before this start
        self.loop_lag_s = 0.0
        """Greatest recent delay of the event loop [s], set by the application."""
        self.keeps_not_because = ""
        """Why the journal could not be written the last time; empty if it could."""
        self.ended_jobs: dict[str, str] = {}
        """Why a background job last ended, by its name, until it runs again."""
        self.not_in_history: dict[str, str] = {}
        """Why the estimates of a session stay in the journal, by its name."""

    def open(self, name: str, inputs: Sequence[str], sample_time_s: float, owner: Owner | None = None) -> LiveSession:
        """Open a session: resume it from the journal, or start a new one.

        Raises:
            LiveError: The name is invalid, or columns or sample time are not the model's.
            BusyError: There are too many sessions, of all or of ``owner``, or the session is new and the service is too
                busy for it.
        """
        self._refuse_other_samples(name, inputs, sample_time_s)
        if name in self.sessions:
            return self.sessions[name]
        self._make_room(name, owner)
        saved, begins_anew = self._saved(name)
        if saved is None and not begins_anew and self.loop_lag_s > self.limits.loop_lag_s:
            raise BusyError(
                f"session {name!r}: new sessions are refused while the service is {self.loop_lag_s:.2f} s late"
            )
        noise = NoiseWindow(self.engine.inputs, self._next_handle * 17 % ROWS_BETWEEN)
        order = SessionOrder(self.engine.sample_time_s, len(self.engine.inputs), self.rules)
        order.last_seen_s = self._clock()
        if saved is not None:
            order.next_index, order.counts = saved.next_index, Counts(**saved.counts)
            self._closed_outcomes.subtract(saved.counts)
        slot = self.engine.add(None if saved is None or begins_anew else saved.state)
        session = LiveSession(name, self._next_handle, self.engine, slot, order, noise)
        session.kept_index = session.next_index
        if begins_anew:
            session.begins_anew = begins_anew
            order.counts.resets += 1
            _log.warning("session %r begins anew at sample %d: %s", name, session.next_index, begins_anew)
        self.sessions[name] = self.by_handle[session.handle] = session
        self._next_handle += 1
        return session

    def given_from(self, session: LiveSession, index: int) -> list[EstimateBlock]:
        """Read the estimates from ``index`` on that were sent already, as far back as the journal goes."""
        blocks = []
        for chunk in self._chunks(session, index):
            known = max(0, index - chunk.index)
            if chunk.estimates is not None and known < len(chunk.samples):
                index = chunk.index + len(chunk.samples)
                blocks.append(replace(chunk.estimates.after(known, chunk.sample_time_s), handle=session.handle))
        return blocks

    def recent(self, session: LiveSession, rows: int) -> list[tuple[EstimateBlock, Array]]:
        """Read the newest estimates and their samples, about this many rows, as far back as the journal goes."""
        chunks = self._chunks(session, max(0, session.next_index - rows))
        return [(each.estimates, each.samples) for each in chunks if each.estimates is not None]

    def _chunks(self, session: LiveSession, index: int) -> list[Chunk]:
        kept = self.journal.chunks(session.name, self.journal.last_chunk(), index)
        return [*kept, *(each.chunk() for each in session.handed_over + session.pending)]

    @property
    def now_s(self) -> float:
        """The clock of ``SessionOrder.last_seen_s`` [s]."""
        return self._clock()

    def session_of(self, block: SampleBlock) -> LiveSession:
        """Find the session of a block.

        Raises:
            LiveError: No session has its handle, its columns are not the model's, or its index or time is too large.
        """
        session = self.by_handle.get(block.handle)
        if session is None:
            raise LiveError(f"handle {block.handle}: no open session has it; open the session first")
        if block.columns != len(self.engine.inputs):
            raise LiveError(
                f"session {session.name!r}: got {block.columns} columns; expected {list(self.engine.inputs)}"
            )
        if block.index > max(LARGEST_INDEX // 2, session.next_index + LARGEST_JUMP):
            raise LiveError(
                f"session {session.name!r}: got index {block.index}, which leaves no room for later samples; expected "
                f"at most {LARGEST_INDEX // 2}; this session's next index is {session.next_index}"
            )
        if not 0.0 <= block.time_s < LATEST_S:
            raise LiveError(
                f"session {session.name!r}: got time {block.time_s}; expected seconds since 1970, before the year 2242"
            )
        return session

    def receive(self, blocks: Sequence[SampleBlock], owner: Owner | None = None) -> None:
        """Step through all samples that can be stepped now, of all blocks in one call.

        Raises:
            LiveError: As for ``session_of``, or a session has another owner than the stated one; no block is used.
        """
        sessions = [self.session_of(block) for block in blocks]
        if owner is not None:
            for session in sessions:
                session.refuse_others(owner)
        now_s = self._clock()
        pieces: list[tuple[LiveSession, SampleBlock]] = []
        for session, block in zip(sessions, blocks, strict=True):
            order = session.order
            for piece in order.receive(block, now_s):
                pieces.append((session, piece))  # noqa: PERF401 - one piece nearly always
            if order.held_rows:
                self._holding[session.handle] = session
            for piece in order.late:
                session.add(piece, None)
                self.unkept_rows += piece.rows
            order.late.clear()
        self._step(pieces)

    def overdue(self) -> None:
        """Step over gaps whose wait is over."""
        now_s = self._clock()
        self._step([(each, piece) for each in self._holding.values() for piece in each.order.overdue(now_s)])
        self._holding = {handle: each for handle, each in self._holding.items() if each.order.held_rows}

    @property
    def kept_age_s(self) -> float:
        """Time since the last write to the journal if estimates wait for one [s]; else 0."""
        return self._clock() - self._kept_s if self.unkept_rows else 0.0

    def outcomes(self) -> Counter[str]:
        """Count samples by outcome since the start, those of closed sessions included."""
        outcomes = self._closed_outcomes.copy()
        for session in self.sessions.values():
            outcomes.update(vars(session.order.counts))
        return outcomes

    def load(self) -> dict[str, int]:
        """Count what the service holds at present."""
        held = sum(each.order.held_rows for each in self._holding.values())
        noisy = sum(each.too_narrow != "" for each in self.sessions.values())
        waits = {"held_rows": held, "unkept_rows": self.unkept_rows}
        return {"sessions": len(self.sessions), "noisy_sessions": noisy, **waits}

    def take_pending(self, sessions: Iterable[LiveSession]) -> tuple[list[SavedSession], list[PendingChunk]]:
        """Collect what ``Journal.keep`` must write of some sessions; from now on it counts as handed over."""
        saved, chunks = [], []
        for session in sessions:
            if session.pending:
                saved.append(session.saved())
                chunks += session.hand_over()
        self.unkept_rows -= sum(each.rows for each in chunks)
        return saved, chunks

    def requeue(self, saved: Sequence[SavedSession], reason: str) -> None:
        """Take back chunks that could not be written, to hand them over again the next time."""
        self.keeps_not_because = reason
        for session in (self.sessions[each.name] for each in saved):
            self.unkept_rows += sum(each.rows for each in session.take_back())

    def kept(self, saved: Sequence[SavedSession]) -> None:
        """Mark written chunks as kept, and acknowledge them."""
        self.keeps_not_because, self._kept_s = "", self._clock()
        known = [(self.sessions[each.name], each) for each in saved if each.name in self.sessions]
        for session, each in known:
            session.note_kept(each.next_index)
            if session.owner is not None:
                session.owner.put_acknowledgement(session)

    def close_idle(self) -> list[str]:
        """Close sessions that are idle and wholly in the journal; return their names."""
        last_s = self._clock() - self.limits.idle_s
        idle = [each for each in self.sessions.values() if each.is_kept and each.order.last_seen_s < last_s]
        for session in idle:
            self._close(session)
        return [session.name for session in idle]

    @property
    def full(self) -> str:
        """Why no session can be opened that is not open; empty if one can."""
        if len(self.sessions) < self.limits.sessions or self._left():
            return ""
        return f"{len(self.sessions)} sessions are open, all that are taken"

    def _make_room(self, name: str, owner: Owner | None) -> None:
        """Refuse a session beyond a limit; beyond that of all sessions, one that no client has gives way."""
        owners = [each.owner for each in self.sessions.values() if each.owner is not None]
        of_user = sum(owner is not None and each.user == owner.user for each in owners)
        for kind, count, most in (
            ("connection", sum(each is owner for each in owners), self.limits.sessions_per_connection),
            ("user", of_user, self.limits.sessions_per_user),
        ):
            if count >= most:
                raise BusyError(f"session {name!r}: this {kind} has {most} sessions, all that one may have; try later")
        if self.full:
            raise BusyError(f"session {name!r}: {self.full}; try later")
        if len(self.sessions) >= self.limits.sessions:
            self._close(min(self._left(), key=lambda each: each.order.last_seen_s))

    def _left(self) -> list[LiveSession]:
        """List the sessions that no client has any more and that the journal holds."""
        return [each for each in self.sessions.values() if each.owner is None and each.is_kept]

    def _close(self, session: LiveSession) -> None:
        self.engine.remove(session.slot)
        self._closed_outcomes.update(vars(session.order.counts))
        del self.sessions[session.name], self.by_handle[session.handle]
        self._holding.pop(session.handle, None)

    def _saved(self, name: str) -> tuple[SavedSession | None, str]:
        """Read a session from the journal, and why it must begin anew; empty if it need not.

        If its row is damaged or gone, it begins behind all samples that were kept: no file of the history is replaced.
        """
        why = ""
        try:
            saved = self.journal.session(name)
        except DamagedSessionError as error:
            saved, why = None, str(error)
        if saved is None:
            ends = self.journal.next_index(name), next_index_of(self.journal.history, name)
            known = [each for each in ends if each is not None]
            if not known:
                return None, why
            return SavedSession(name, max(known), {}, "", b""), why or "the journal no longer holds its state"
        if saved.model != self.engine.model:
            return (
                saved,
                f"the session was kept by model {saved.model[:12]}, and the service runs {self.engine.model[:12]}",
            )
        if len(saved.state) != self.engine.state_bytes:
            return saved, f"its state has {len(saved.state)} bytes; this program expects {self.engine.state_bytes}"
        return saved, ""

    def _step(self, pieces: Sequence[tuple[LiveSession, SampleBlock]]) -> None:
        if not pieces:
            return
        results = self.engine.run([(session.slot, piece) for session, piece in pieces])
        model, given = self.engine.model, list[tuple[LiveSession, EstimateBlock]]()
        for (session, piece), (newtons, bits) in zip(pieces, results, strict=True):
            estimates = EstimateBlock(session.handle, piece.index, piece.time_s, newtons, bits, model)
            session.add(piece, estimates)
            self.unkept_rows += piece.rows
            given.append((session, estimates))
            for take in self.takers:
                take(session, estimates)
        for owner, of_owner in groupby(given, _owner):
            if owner is not None:
                owner.put_estimates(of_owner)
        self.flags.note(b"".join([bits for _, bits in results]))

    def _refuse_other_samples(self, name: str, inputs: Sequence[str], sample_time_s: float) -> None:
        if not _NAME.fullmatch(name) or len(quote(name, safe="")) > LONGEST_NAME:
            raise LiveError(
                f"session {name[:80]!r}: expected 1 to 80 letters, digits, spaces and _ . : / - as a session's name, a "
                f"letter or digit among them, and at most {LONGEST_NAME} bytes as the name of a folder"
            )
        if tuple(inputs) != self.engine.inputs:
            raise LiveError(f"session {name!r}: got columns {list(inputs)}; the model takes {list(self.engine.inputs)}")
        if not abs(sample_time_s / self.engine.sample_time_s - 1.0) <= CLOCK_TOLERANCE:
            raise LiveError(
                f"session {name!r}: got a sample time of {sample_time_s} s; the model was trained at "
                f"{self.engine.sample_time_s} s; resample, or train a model at that rate"
            )

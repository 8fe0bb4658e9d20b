"""Frames that are repeated, swapped, delayed, lost, cut or garbage: no crash, no silent wrong number, all counted."""

import asyncio
import math
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction_live.connection import ClientGoneError, Connection, Peers
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.frames import LATEST_S, EstimateBlock, SampleBlock, pack_samples, unpack
from cylinder_friction_live.journal import Journal
from cylinder_friction_live.service import LiveService
from cylinder_friction_live.session import SessionOrder
from cylinder_friction_live.settings import SessionRules

SESSIONS = 3
RULES = SessionRules(hold_s=0.5, hold_rows=150, short_gap_s=0.25)
FAULTS = ("none", "none", "none", "drop", "repeat", "delay", "truncate", "garbage", "flip", "values", "ahead", "other")
Row = tuple[float, ...]


@dataclass(frozen=True)
class Frame:
    """What a sender meant to send, and what becomes of it on its way."""

    session: int
    rows: int
    fault: str
    seed: int  # Of all that the fault leaves open
    pause_s: float  # Before it


FRAMES = st.lists(
    st.builds(
        Frame,
        st.integers(0, SESSIONS - 1),
        st.integers(1, 30),
        st.sampled_from(FAULTS),
        st.integers(0, 2**32 - 1),
        st.sampled_from((0.0, 0.005, 0.01, 0.1, 0.7)),
    ),
    min_size=20,
    max_size=100,
)


def on_the_wire(sent: Sequence[Frame], handles: Sequence[int], samples: Array) -> list[tuple[float, bytes]]:
    """Return the messages as they arrive, each with the time since the one before."""
    wire: list[tuple[float, float, bytes]] = []  # Place, pause, message
    next_index = [0] * SESSIONS
    for place, frame in enumerate(sent):
        chance = np.random.default_rng(frame.seed)
        index = next_index[frame.session]
        if frame.fault == "ahead":
            index += int(chance.integers(1, 200))
        next_index[frame.session] = index + frame.rows
        rows = samples[np.arange(index, index + frame.rows) % len(samples)].copy()
        if frame.fault == "values":
            odd = chance.integers(0, rows.size, 3)
            rows.flat[odd] = chance.choice([math.nan, math.inf, -math.inf, 1e300, 0.0], 3)
        handle = 10_000 if frame.fault == "other" else handles[frame.session]
        message = pack_samples(SampleBlock(handle, index, 1e9 + 0.005 * index, rows))
        for later, content in _arriving(message, frame.fault, chance):
            wire.append((place + later, frame.pause_s, content))
    return [(pause, message) for _, pause, message in sorted(wire, key=lambda each: each[0])]


def _arriving(message: bytes, fault: str, chance: np.random.Generator) -> list[tuple[float, bytes]]:
    """Return what arrives of a message, each with how many places later."""
    if fault == "drop":
        return []
    if fault == "repeat":
        return [(0.0, message), (float(chance.integers(0, 60)), message)]
    if fault == "delay":
        return [(float(chance.integers(1, 60)) + 0.5, message)]
    if fault == "truncate":
        return [(0.0, message[: chance.integers(0, len(message))])]
    if fault == "garbage":
        return [(0.0, chance.bytes(int(chance.integers(1, 300)))), (0.0, message)]
    if fault == "flip":
        bits = bytearray(message)
        bits[int(chance.integers(0, min(len(bits), 60)))] ^= 1 << int(chance.integers(0, 8))
        return [(0.0, bytes(bits))]
    return [(0.0, message)]


@dataclass
class ExpectedSession:
    """The documented rules, sample by sample, on the estimator's own step."""

    stream: RealTimeStream
    sample_time_s: float
    rules: SessionRules = RULES
    next_index: int | None = None
    waiting: dict[int, tuple[Row, float]] = field(default_factory=dict)
    gaps: list[range] = field(default_factory=list)  # Given up
    came_late: set[int] = field(default_factory=set)
    estimates: dict[int, Row] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)

    def receive(self, index: int, rows: Sequence[Row], now_s: float) -> None:
        """Take a frame's samples."""
        if self.next_index is None:
            self.next_index = index
        for place, row in enumerate(rows, index):
            if place < self.next_index or place in self.waiting:
                late = place not in self.came_late and any(place in gap for gap in self.gaps)
                self.came_late.update([place] if late else ())
                self.counts["late" if late else "duplicate"] += 1
            else:
                self.waiting[place] = row, now_s
        while self.next_index in self.waiting:
            self._step(self.waiting.pop(self.next_index)[0])
            self.counts["stepped"] += 1
        self.overdue(now_s)

    def overdue(self, now_s: float) -> None:
        """Give up gaps that were waited for."""
        while self.waiting and (
            now_s - min(since for _, since in self.waiting.values()) >= self.rules.hold_s
            or len(self.waiting) > self.rules.hold_rows
        ):
            assert self.next_index is not None
            first = min(self.waiting)
            missing = range(self.next_index, first)
            self.gaps.append(missing)
            if len(missing) * self.sample_time_s <= self.rules.short_gap_s:
                self.counts["missing"] += len(missing)
                for _ in missing:
                    self._step((math.nan,) * len(self.stream.inputs))
            else:
                self.counts["skipped"] += len(missing)
                self.stream.reset()
                self.next_index = first
            while self.next_index in self.waiting:
                self._step(self.waiting.pop(self.next_index)[0])
                self.counts["stepped"] += 1

    def _step(self, row: Row) -> None:
        assert self.next_index is not None
        self.estimates[self.next_index] = tuple(self.stream.step(*row))
        self.next_index += 1


class _Wire:
    """What a connection reads: messages at their times; and what it sends."""

    def __init__(self, messages: Sequence[tuple[float, bytes]], before: Callable[[float], None]) -> None:
        self._messages, self._before, self._at = messages, before, 0
        self.sent: list[bytes | str] = []

    async def receive(self) -> bytes | str:
        await asyncio.sleep(0)
        if self._at == len(self._messages):
            self._before(10.0)
            for _ in range(5):
                await asyncio.sleep(0)
            raise ClientGoneError
        pause_s, message = self._messages[self._at]
        self._at += 1
        self._before(pause_s)
        return message

    async def send(self, message: bytes | str) -> None:
        self.sent.append(message)


def follow(wire: Sequence[tuple[float, bytes]], handles: Sequence[int], expected: Sequence[ExpectedSession]) -> int:
    """Let the rules take the messages; return how many they refuse."""
    now_s, refused = 0.0, 0
    for pause_s, message in wire:
        now_s += pause_s
        for each in expected:
            each.overdue(now_s)
        blocks = _blocks(message, handles, len(expected[0].stream.inputs))
        if any(index > max(2**52, (expected[of].next_index or 0) + 2**32) for of, index, _ in blocks or ()):
            blocks = None
        refused += blocks is None
        for session, index, rows in blocks or ():
            expected[session].receive(index, rows, now_s)
    return refused


def estimates_of(sent: Sequence[bytes | str], handles: Sequence[int]) -> list[dict[int, Row]]:
    """Return the estimates among a service's messages, by session and index, each given once."""
    got: list[dict[int, Row]] = [{} for _ in handles]
    for message in sent:
        for block in unpack(message) if isinstance(message, bytes) else ():
            if isinstance(block, EstimateBlock):
                rows = got[handles.index(block.handle)]
                numbers = zip(block.newtons.tolist(), block.flags.tolist(), strict=True)
                for place, (newtons, flags) in enumerate(numbers, block.index):
                    assert place not in rows, "an estimate was given twice"
                    rows[place] = (*newtons, flags)
    return got


def _blocks(message: bytes, handles: Sequence[int], columns: int) -> list[tuple[int, int, list[Row]]] | None:
    """Return session, index and rows of each block as the table of frames has them; None where it is not that."""
    at, found = 0, []
    while at < len(message) or not message:
        if len(message) - at < 24:
            return None
        kind, width, count, handle, index, time_s = struct.unpack_from("<BBHIQd", message, at)
        size = 8 * width * count
        good = kind == 1 and width == columns and count and handle in handles and 0.0 <= time_s < LATEST_S
        if not good or index + count > 2**53 or len(message) - at - 24 < size:
            return None
        numbers = struct.unpack_from(f"<{width * count}d", message, at + 24)
        rows = [numbers[place : place + width] for place in range(0, len(numbers), width)]
        found.append((handles.index(handle), index, rows))
        at += 24 + size
    return found


def test_estimates_and_counts_are_those_of_the_rules(
    engine: Engine, small_hybrid: HybridEstimator, samples: Array, tmp_path_factory: pytest.TempPathFactory
) -> None:
    journal = Journal(tmp_path_factory.mktemp("faults") / "journal.db")

    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
    @given(FRAMES)
    def check(sent: list[Frame]) -> None:
        now_s = [0.0]
        service, peers = LiveService(engine, journal, rules=RULES, clock=lambda: now_s[0]), Peers()
        sessions = [service.open(f"press {place}", engine.inputs, engine.sample_time_s) for place in range(SESSIONS)]
        handles = [each.handle for each in sessions]
        messages = on_the_wire(sent, handles, samples)

        def pass_time(pause_s: float) -> None:
            now_s[0] += pause_s
            service.overdue()

        wire = _Wire(messages, pass_time)

        async def run() -> None:
            connection = Connection(wire, service, peers)
            for each in sessions:
                peers.take_over(each, connection)
            await connection.run()

        asyncio.run(run())
        by_the_rules = [ExpectedSession(small_hybrid.real_time(), engine.sample_time_s) for _ in sessions]
        assert peers.refused.total() == follow(messages, handles, by_the_rules)
        for session, got, expected in zip(sessions, estimates_of(wire.sent, handles), by_the_rules, strict=True):
            expected.overdue(math.inf)
            assert got == expected.estimates
            assert {name: vars(session.order.counts)[name] for name in expected.counts} == dict(expected.counts)

    check()
    journal.close()


def take(session: SessionOrder, begin: int, end: int, now_s: float = 0.0) -> list[SampleBlock]:
    """Let samples come whose one number is their index."""
    samples = np.arange(begin, end, dtype=np.float64)[:, None]
    return session.receive(SampleBlock(0, begin, 0.01 * begin, samples), now_s)


def test_a_short_gap_becomes_no_numbers_once_it_was_waited_for() -> None:
    session = SessionOrder(0.01, 1, SessionRules(hold_s=1.0, hold_rows=100, short_gap_s=0.05), 0)
    take(session, 0, 2)
    assert take(session, 5, 6, now_s=0.0) == []
    assert session.overdue(0.9) == []
    gap, after = session.overdue(1.0)
    assert (gap.index, len(gap.samples), gap.reset) == (2, 3, False)
    assert np.isnan(gap.samples).all()
    assert abs(gap.time_s - 0.02) < 1e-12
    assert (after.index, after.reset) == (5, False)
    assert session.counts.missing == 3


def test_late_samples_are_kept_once_each_and_never_stepped() -> None:
    session = SessionOrder(0.01, 1, SessionRules(hold_s=1.0, hold_rows=100, short_gap_s=0.05), 0)
    take(session, 0, 2)
    take(session, 20, 22)
    session.overdue(1.0)  # samples 2 to 19 are given up
    assert take(session, 1, 6) == []
    assert take(session, 4, 8) == []
    assert [(piece.index, len(piece.samples)) for piece in session.late] == [(2, 4), (6, 2)]
    assert (session.counts.late, session.counts.duplicate) == (6, 3)

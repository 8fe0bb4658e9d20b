"""One client: samples in, estimates and acknowledgements out. A slow reader slows only its own writing."""

import asyncio
import json
import sqlite3
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Protocol

from cylinder_friction_live.events import Events
from cylinder_friction_live.frames import (
    Acknowledgement,
    EstimateBlock,
    FrameError,
    SampleBlock,
    pack_acknowledgement,
    pack_estimates,
    unpack,
)
from cylinder_friction_live.groups import SessionGroups
from cylinder_friction_live.service import BusyError, LiveError, LiveService, LiveSession
from cylinder_friction_live.settings import LiveLimits
from cylinder_friction_live.text_forms import estimates_text, opened_text, read_text
from cylinder_friction_live.totals import Delays

UNSENT_BYTES = 4 << 20
"""Unsent bytes above which the service stops reading from a client, until the client reads."""
RETRY_S = 1.0
"""Time after which a client that is refused because of the load may try again [s]."""
BURST_S = 10.0
"""Duration of samples that a client may send at once, such as those of a break [s]."""
TURN_S = 2e-3
"""Time for one client's messages before other clients and the journal have their turn [s]."""
PATIENCE_S = 0.05
"""Time for which a writer is held back before the next check [s]."""


class ClientGoneError(Exception):
    """The client has disconnected."""


class Transport(Protocol):
    """What carries whole messages to and from one client: frames as bytes, JSON as text."""

    async def receive(self) -> bytes | str:
        """Wait for the next message; raises ``ClientGoneError`` if there will be none."""
        ...

    async def send(self, message: bytes | str) -> None:
        """Send a message; returns when more can be taken, raises ``ClientGoneError`` when the client is gone."""
        ...


class Peers:
    """All connections, the counts of refusals, and whether the service is ending."""

    def __init__(self, events: Events | None = None) -> None:
        self.events = events or Events()
        self.draining, self.keeping = False, asyncio.Lock()
        self.refused: Counter[str] = Counter()
        self.delays = Delays()
        self.connected: set[Connection] = set()

    def full(self, limits: LiveLimits) -> str:
        """Why no client can connect; empty if one can."""
        return "" if len(self.connected) < limits.connections else f"{len(self.connected)} clients are connected"

    def enter(self, connection: "Connection", limits: LiveLimits) -> str:
        """Register a new connection, or return why it is refused."""
        of_user = sum(each.user == connection.user for each in self.connected)
        problem = self.full(limits)
        if not problem and of_user >= limits.connections_per_user:
            problem = f"{of_user} clients of this user are connected"
        if not problem:
            self.connected.add(connection)
        return problem

    async def sent(self, within_s: float) -> None:
        """Wait until all messages for clients are sent, at most ``within_s``."""
        deadline_s = time.monotonic() + within_s
        while any(each.unsent for each in self.connected) and time.monotonic() < deadline_s:
            await asyncio.sleep(0.01)

    def take_over(self, session: LiveSession, connection: "Connection") -> None:
        """Give a session to a connection; the previous connection gets a note, and nothing more of the session."""
        before = session.owner
        if before is not None and before is not connection:
            before.lost(session)
            self.events.note("session lost", session=session.name, client=before.client, to=connection.client)
        session.settle()
        session.owner = connection

    def leave(self, connection: "Connection", sessions: Iterable[LiveSession]) -> None:
        """Remove a connection that has ended; its sessions stay open."""
        self.connected.discard(connection)
        for session in sessions:
            if session.owner is connection:
                session.settle()
                session.owner = None


class Pace:
    """The rate at which one client sends, and its limit."""

    def __init__(self, rows_per_s: float) -> None:
        self._row_s, self._paid_until_s = 1.0 / rows_per_s, 0.0

    def count(self, rows: int, now_s: float) -> None:
        """Count samples that have come."""
        self._paid_until_s = max(self._paid_until_s, now_s - BURST_S) + rows * self._row_s

    def is_ahead(self, now_s: float) -> bool:
        """Check whether the client has sent more than its limit allows so far."""
        return self._paid_until_s > now_s


class Connection:
    """A client. It opens sessions by text, then sends text or frames, and gets estimates in the same form."""

    def __init__(
        self, transport: Transport, service: LiveService, peers: Peers, client: str = "", user: str = ""
    ) -> None:
        self.client, self.user = client, user
        self._pace = Pace(service.limits.rows_per_s)
        self._transport, self._service, self._peers = transport, service, peers
        self._frames: list[bytes] = []
        self._busy_s = 0.0  # Time for its messages since others had their turn
        self._came_s = 0.0  # Arrival of the first message whose estimates are not sent yet
        self._texts: list[str] = []
        self._in_text: set[str] = set()  # Sessions whose client last sent text
        self._groups = SessionGroups(service, self, self._in_text)
        self.unsent, self._waiting = 0, asyncio.Event()

    async def run(self) -> None:
        """Serve the client until it disconnects."""
        if problem := self._peers.enter(self, self._service.limits):
            self._peers.refused["connections"] += 1
            self._peers.events.note("connection refused", client=self.client, kind="connections")
            error = f"{problem}, all that are taken; try later"
            with suppress(ClientGoneError):
                await self._transport.send(json.dumps({"error": error, "retry_after_s": RETRY_S}))
            return
        writer = asyncio.create_task(self._write())
        try:
            while not writer.done():
                message = await self._transport.receive()
                if self._peers.draining:
                    continue  # not acknowledged: the client sends it to the next service
                came_s = time.monotonic()
                self._take(message)
                if self._frames and not self._came_s:
                    self._came_s = came_s
                self._busy_s += time.monotonic() - came_s
                if self._busy_s > TURN_S:  # if more messages are waiting, nothing else gives others their turn
                    self._busy_s = 0.0
                    await asyncio.sleep(0.0)
                while self._is_too_fast():
                    await asyncio.sleep(PATIENCE_S)  # TCP then holds the client back
                    if writer.done():
                        return
        except ClientGoneError:
            pass
        finally:
            self._peers.leave(self, self._service.sessions.values())
            writer.cancel()
            await asyncio.gather(writer, return_exceptions=True)

    def answer(self, message: bytes) -> bytes | None:
        """Answer a message without a wait for other tasks; None if the transport must receive it in its turn."""
        if self.unsent or self._peers.draining or self._busy_s > TURN_S or self._is_too_fast():
            return None
        came_s = time.monotonic()
        answered = self._step(message)
        if answered is not None:
            delay_s = time.monotonic() - came_s
            self._busy_s += delay_s
            self._peers.delays.note(delay_s)
        return answered

    def _is_too_fast(self) -> bool:
        waiting = self._service.unkept_rows > self._service.limits.unkept_rows
        return waiting or self.unsent > UNSENT_BYTES or self._pace.is_ahead(time.monotonic())

    def lost(self, session: LiveSession) -> None:
        """Note that another connection has opened the session."""
        self._put_text(json.dumps({"lost": {"session": session.name, "to": "another connection that opened it"}}))

    def put_estimates(self, estimates: Iterable[tuple[LiveSession, EstimateBlock]]) -> None:
        """Queue estimates, each in the form in which its session's samples came."""
        in_text, frames = self._in_text, list[bytes]()
        for session, block in estimates:
            if session.name in in_text:
                self._put_text(estimates_text(session, block))
            else:
                frames.append(pack_estimates(block))
        if frames:
            self._put_frame(b"".join(frames))

    def put_acknowledgement(self, session: LiveSession) -> None:
        """Queue an acknowledgement."""
        if session.name in self._in_text:
            self._put_text(json.dumps({"acknowledged": {"session": session.name, "index": session.kept_index}}))
        else:
            self._put_frame(pack_acknowledgement(Acknowledgement(session.handle, session.kept_index)))

    def _take(self, message: bytes | str) -> None:
        try:
            if isinstance(message, bytes):
                self._take_frame(message)
            else:
                self._take_text(message)
        except (FrameError, LiveError, sqlite3.Error) as error:
            self._peers.refused[type(error).__name__] += 1
            later = {"retry_after_s": RETRY_S} if isinstance(error, BusyError) else {}
            self._put_text(json.dumps({"error": str(error), **later}))

    def _take_frame(self, message: bytes) -> None:
        answered = self._step(message)
        if answered is not None:
            self._put_frame(answered)
            return
        blocks = unpack(message)
        samples = [block for block in blocks if isinstance(block, SampleBlock)]
        if len(samples) != len(blocks):
            raise FrameError("got estimates or acknowledgements; expected samples alone")
        self._receive(samples)
        self._groups.note(message, samples)

    def _step(self, message: bytes) -> bytes | None:
        rows, answer = self._groups.step(message)
        if rows:
            self._pace.count(rows, time.monotonic())
        return answer

    def _receive(self, samples: Sequence[SampleBlock]) -> None:
        self._pace.count(sum([block.rows for block in samples]), time.monotonic())
        self._service.receive(samples, self)

    def _take_text(self, text: str) -> None:
        if len(text) > self._service.limits.text_bytes:
            raise LiveError(
                f"got {len(text)} bytes of JSON, expected at most {self._service.limits.text_bytes}; send frames"
            )
        what = read_text(text)
        if what.opens:
            session = self._service.open(what.session, what.inputs, what.sample_time_s, self)
            event = "session resumed" if session.next_index else "session opened"
            why = {"begins_anew": session.begins_anew} if session.begins_anew else {}
            self._peers.events.note(event, session=session.name, index=session.next_index, client=self.client, **why)
            self._peers.take_over(session, self)
            self._put_text(opened_text(session))
            if what.estimates_from is not None and what.estimates_from < session.next_index:
                given = self._service.given_from(session, what.estimates_from)
                self.put_estimates((session, block) for block in given)
            return
        session = self._service.sessions.get(what.session)  # type: ignore[assignment]
        if session is None:
            raise LiveError(f"session {what.session[:80]!r}: not open; open it first")
        session.refuse_others(self)
        session.settle()  # by frames, whose estimates were sent as frames
        self._in_text.add(session.name)
        self._receive([SampleBlock(session.handle, what.index, what.time_s, what.samples)])

    def _put_text(self, text: str) -> None:
        self._texts.append(text)
        self.unsent += len(text)
        self._waiting.set()

    def _put_frame(self, frame: bytes) -> None:
        self._frames.append(frame)
        self.unsent += len(frame)
        self._waiting.set()

    async def _write(self) -> None:
        while True:
            await self._waiting.wait()
            self._waiting.clear()
            texts, frames = self._texts, self._frames
            sending = self.unsent
            came_s = self._came_s
            self._texts, self._frames, self._came_s = [], [], 0.0
            for text in texts:
                await self._transport.send(text)
                await asyncio.sleep(0.0)  # whether the client is gone is known by the next turn of the loop
            if frames:
                await self._transport.send(b"".join(frames))
                if came_s:
                    self._peers.delays.note(time.monotonic() - came_s)
            self.unsent -= sending

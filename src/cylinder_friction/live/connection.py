"""One client: samples in, estimates and acknowledgements out; a slow reader slows its own writer alone."""

import asyncio
import json
from collections import Counter
from collections.abc import Iterable
from typing import Protocol

from cylinder_friction.live.frames import (
    Acknowledgement,
    EstimateBlock,
    FrameError,
    SampleBlock,
    pack_acknowledgement,
    pack_estimates,
    unpack,
)
from cylinder_friction.live.service import LiveError, LiveService, LiveSession
from cylinder_friction.live.text_forms import estimates_text, opened_text, read_text

UNSENT_BYTES = 4 << 20
"""Beyond this a client that does not read is not read from, until it does."""
PATIENCE_S = 0.05
"""How long a writer is held back before it is looked at again."""


class ClientGoneError(Exception):
    """The client has left."""


class Transport(Protocol):
    """What carries whole messages to and from one client: frames as bytes, JSON as text."""

    async def receive(self) -> bytes | str:
        """Return the next message; raises ``ClientGoneError`` when there will be none."""
        ...

    async def send(self, message: bytes | str) -> None:
        """Send a message; returns when more can be taken, raises ``ClientGoneError`` when the client is gone."""
        ...


class Peers:
    """Which connection owns which session, and how often what was refused."""

    def __init__(self) -> None:
        self._owners: dict[str, Connection] = {}
        self.refused: Counter[str] = Counter()
        self.connections = 0

    def take_over(self, session: LiveSession, connection: "Connection") -> None:
        """Give a session to a connection; the one before gets a note, and nothing more of it."""
        before = self._owners.get(session.name)
        if before is not None and before is not connection:
            before.lost(session)
        self._owners[session.name] = connection

    def owns(self, connection: "Connection", session: LiveSession) -> bool:
        """Return whether the session is this connection's."""
        return self._owners.get(session.name) is connection

    def leave(self, connection: "Connection") -> None:
        """Forget a connection that has ended; its sessions stay open."""
        self._owners = {name: owner for name, owner in self._owners.items() if owner is not connection}

    def send(self, session: LiveSession, block: EstimateBlock) -> None:
        """Put estimates into the queue of the session's connection, if it has one."""
        owner = self._owners.get(session.name)
        if owner is not None:
            owner.put_estimates(session, block)

    def acknowledge(self, sessions: Iterable[LiveSession]) -> None:
        """Put acknowledgements of kept samples into the queues of the sessions' connections."""
        for session in sessions:
            owner = self._owners.get(session.name)
            if owner is not None:
                owner.put_acknowledgement(session)


class Connection:
    """A client. It opens sessions by text, then sends frames; either way estimates come back as samples came."""

    def __init__(self, transport: Transport, service: LiveService, peers: Peers) -> None:
        self._transport, self._service, self._peers = transport, service, peers
        self._frames: list[bytes] = []
        self._texts: list[str] = []
        self._in_text: set[str] = set()  # Sessions whose client last sent text
        self._unsent, self._waiting = 0, asyncio.Event()

    async def run(self) -> None:
        """Serve the client until it leaves."""
        self._peers.connections += 1
        writer = asyncio.create_task(self._write())
        try:
            while not writer.done():
                self._take(await self._transport.receive())
                while self._unsent > UNSENT_BYTES or self._service.unkept_rows > self._service.limits.unkept_rows:
                    await asyncio.sleep(PATIENCE_S)  # TCP then holds the client back
                    if writer.done():
                        return
        except ClientGoneError:
            pass
        finally:
            self._peers.leave(self)
            self._peers.connections -= 1
            writer.cancel()
            await asyncio.gather(writer, return_exceptions=True)

    def lost(self, session: LiveSession) -> None:
        """Note that another connection has opened the session."""
        self._put_text(json.dumps({"lost": {"session": session.name, "to": "another connection that opened it"}}))

    def put_estimates(self, session: LiveSession, block: EstimateBlock) -> None:
        """Queue estimates, in the form in which the samples came."""
        if session.name in self._in_text:
            self._put_text(estimates_text(session, block))
        else:
            self._put_frame(pack_estimates(block))

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
        except (FrameError, LiveError) as error:
            self._peers.refused[type(error).__name__] += 1
            self._put_text(json.dumps({"error": str(error)}))

    def _take_frame(self, message: bytes) -> None:
        blocks = unpack(message)
        samples = [block for block in blocks if isinstance(block, SampleBlock)]
        if len(samples) != len(blocks):
            raise FrameError("got estimates or acknowledgements; expected samples alone")
        for block in samples:
            self._refuse_others(self._service.session_of(block))
        self._service.receive(samples)

    def _take_text(self, text: str) -> None:
        what = read_text(text)
        if what.opens:
            session = self._service.open(what.session, what.inputs, what.sample_time_s)
            self._peers.take_over(session, self)
            self._put_text(opened_text(session))
            if what.estimates_from is not None and what.estimates_from < session.next_index:
                for block in self._service.given_from(session, what.estimates_from):
                    self.put_estimates(session, block)
            return
        session = self._service.sessions.get(what.session)  # type: ignore[assignment]
        if session is None:
            raise LiveError(f"session {what.session[:80]!r}: not open; open it first")
        self._refuse_others(session)
        self._in_text.add(session.name)
        self._service.receive([SampleBlock(session.handle, what.index, what.time_s, what.samples)])

    def _refuse_others(self, session: LiveSession) -> None:
        if not self._peers.owns(self, session):
            raise LiveError(f"session {session.name!r}: another connection has opened it; open it to take it over")

    def _put_frame(self, frame: bytes) -> None:
        self._frames.append(frame)
        self._unsent += len(frame)
        self._waiting.set()

    def _put_text(self, text: str) -> None:
        self._texts.append(text)
        self._unsent += len(text)
        self._waiting.set()

    async def _write(self) -> None:
        while True:
            await self._waiting.wait()
            self._waiting.clear()
            texts, frames = self._texts, self._frames
            self._texts, self._frames, self._unsent = [], [], 0
            for text in texts:
                await self._transport.send(text)
            if frames:
                await self._transport.send(b"".join(frames))

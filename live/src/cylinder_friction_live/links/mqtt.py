"""The MQTT link: frames and JSON through an MQTT 5 broker, and the latest newtons of every session for subscribers.

========================  =========================================================================================
topic                     content
========================  =========================================================================================
PREFIX/CLIENT/in          from a client: frames, or JSON (begins with a brace)
PREFIX/CLIENT/out         to the client: estimates, acknowledgements and replies
PREFIX/state              retained: whether the service runs, and since when no message to it was lost
PREFIX/results/SESSION    retained: the latest newtons as JSON, a few times a second
========================  =========================================================================================

A broker's PUBACK does not mean that samples are in the journal; an acknowledgement frame does.
"""

import asyncio
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import ClassVar

from paho.mqtt.client import MQTTMessage

from cylinder_friction.realtime.flags import Flag
from cylinder_friction_live.connection import ClientGoneError, Connection, Peers
from cylinder_friction_live.frames import EstimateBlock
from cylinder_friction_live.journal import LastRow
from cylinder_friction_live.links.broker import Broker, Message
from cylinder_friction_live.links.link import Link, in_background
from cylinder_friction_live.service import LiveService, LiveSession
from cylinder_friction_live.settings import MqttSettings

AT_ONCE = 20
"""Number of sessions whose results are published before samples have their turn."""
SILENT_S = 10.0
"""Time without a message after which a client gives way to a new one if there are too many [s]."""
_BEYOND = 4
"""Multiple of the size limit up to which messages are refused with a reply; the broker keeps larger ones back."""


class MqttTransport:
    """Messages of one client's topics."""

    def __init__(self, broker: Broker, topic: str, idle_s: float) -> None:
        self._broker, self._topic, self._idle_s = broker, topic, idle_s
        self.waiting: asyncio.Queue[MQTTMessage] = asyncio.Queue()
        self.heard_s = time.monotonic()

    async def receive(self) -> bytes | str:
        """Wait for the next message; raises ``ClientGoneError`` after a long silence."""
        try:
            async with asyncio.timeout(self._idle_s):
                message = await self.waiting.get()
        except TimeoutError as error:
            raise ClientGoneError from error
        self._broker.done(message)
        payload = bytes(message.payload)
        return payload.decode(errors="replace") if payload.startswith(b"{") else payload

    def forget(self) -> list[MQTTMessage]:
        """Take all waiting messages."""
        return [self.waiting.get_nowait() for _ in range(self.waiting.qsize())]

    async def send(self, message: bytes | str) -> None:
        """Send a message; return once more can be sent."""
        await self._broker.send(f"{self._topic}/out", message)


class MqttLink(Link):
    """Treats each CLIENT of the topics as a connection, which begins with a text that opens a session."""

    name: ClassVar[str] = "mqtt"

    def __init__(self, settings: MqttSettings) -> None:
        super().__init__(f"mqtt://{settings.broker.host}:{settings.broker.port}/{settings.prefix}")
        self._settings = settings
        self._clients: dict[str, tuple[MqttTransport, asyncio.Task[None]]] = {}
        self._since = ""
        self._changed: set[str] = set()  # Sessions with new estimates

    def note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Mark a session as having new estimates."""
        del block
        self._changed.add(session.name)

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:
        """Serve the broker's clients whenever it is reachable."""
        self._service, self._peers = service, peers
        settings = self._settings
        self._broker = broker = Broker(
            settings.broker, settings.client_id, self._connected, self._take, lambda: self._state(False),
            settings.session_s, _BEYOND * service.limits.message_bytes,
        )  # fmt: skip
        async with broker.running(lambda: self._state(False)), in_background(self._results()):
            try:
                yield
            finally:
                for _, task in self._clients.values():
                    task.cancel()

    def _state(self, online: bool) -> Message:
        content = json.dumps({"online": online, "since": self._since, "model": self._service.engine.model})
        return Message(f"{self._settings.prefix}/state", content, qos=1, retain=True)

    def _connected(self, nothing_lost: bool) -> None:
        self.counts["connected"] += 1
        if nothing_lost:
            for transport, _ in self._clients.values():
                transport.forget()  # the broker repeats messages without acknowledgement
        else:
            self._since = f"{time.time():.6f}"
            self._broker.subscribe(f"{self._settings.prefix}/+/in")
        self._broker.publish(self._state(True))

    def _take(self, message: MQTTMessage) -> None:
        """Pass a message to its client's connection, or refuse it; the link survives any message."""
        topic = message.topic.removesuffix("/in")
        if topic == f"{self._settings.prefix}/results":  # the results of a session called "in"
            self._broker.done(message)
            return
        problem = self._problem(topic, message)
        if problem:
            self._broker.done(message)
            self._answer(topic, problem)
            return
        transport, _ = self._clients[topic]
        transport.heard_s = time.monotonic()
        transport.waiting.put_nowait(message)

    def _problem(self, topic: str, message: MQTTMessage) -> str:
        """State why a message is refused; empty if its client's connection receives it."""
        known = self._clients.get(topic)
        if len(message.payload) > self._service.limits.message_bytes:
            return "too large"
        if known is None:
            if bytes(message.payload[:1]) != b"{":
                return "not open"
            if len(self._clients) >= self._service.limits.connections_per_user:
                silent = min(self._clients, key=lambda each: self._clients[each][0].heard_s)
                if time.monotonic() - self._clients[silent][0].heard_s < SILENT_S:
                    return "too many clients"
                self._end(silent)
                self._answer(silent, "silent")
            self._begin(topic)
        elif known[0].waiting.qsize() >= self._settings.waiting_messages:
            self._end(topic)
            return "overflow"
        return ""

    def _answer(self, topic: str, problem: str) -> None:
        self.counts[problem] += 1
        self._broker.publish(Message(f"{topic}/out", json.dumps({"closed": self._advice(problem)}), qos=1))

    def _advice(self, problem: str) -> str:
        settings, limits = self._settings, self._service.limits
        return {
            "too large": f"got a message of more than {limits.message_bytes} bytes; send smaller ones",
            "not open": "got frames without an open session; open it first, here or after the service was away",
            "too many clients": f"got a client more than {limits.connections_per_user}; try later",
            "silent": f"got {limits.connections_per_user} clients, and this one was silent; open the session again",
            "overflow": f"got more than {settings.waiting_messages} messages that wait; open the session again, and "
            f"send what is not acknowledged, at most {settings.waiting_messages // 2} messages of it at a time",
        }[problem]

    def _begin(self, topic: str) -> None:
        transport = MqttTransport(self._broker, topic, self._service.limits.idle_s)
        task = asyncio.create_task(Connection(transport, self._service, self._peers, topic, self.name).run())
        task.add_done_callback(lambda _: self._forget(topic, task))
        self._clients[topic] = transport, task

    def _forget(self, topic: str, task: asyncio.Task[None]) -> None:
        if topic in self._clients and self._clients[topic][1] is task:
            del self._clients[topic]

    def _end(self, topic: str) -> None:
        """End a connection, so that no sample passes a refused one."""
        transport, task = self._clients.pop(topic)
        task.cancel()
        for message in transport.forget():
            self._broker.done(message)

    async def _results(self) -> None:
        while True:
            await asyncio.sleep(1.0 / self._settings.results_hz)
            changed, self._changed = self._changed, set()
            for place, name in enumerate(changed):
                if place % AT_ONCE == 0:
                    await asyncio.sleep(0.0)
                session = self._service.sessions.get(name)
                if self._broker.connected and session is not None and (last := session.latest) is not None:
                    topic = f"{self._settings.prefix}/results/{name}"
                    self._broker.publish(Message(topic, _result(last), retain=True))


def _result(last: LastRow) -> str:
    friction_n, lower_n, upper_n = last.newtons
    named = {"friction_n": friction_n, "lower_n": lower_n, "upper_n": upper_n}
    return json.dumps({"index": last.index, "time_s": last.time_s, **named, "flags": Flag.names(last.flags)})

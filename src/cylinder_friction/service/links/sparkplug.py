"""Sparkplug B: the service is an edge node, each session a device whose metrics are its latest newtons.

Samples do not come in this way, and between two publications newtons pass unseen: it shows, it does not record.
"""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import ClassVar

from paho.mqtt.client import MQTTMessage

from cylinder_friction.service.links.broker import Broker, Message
from cylinder_friction.service.links.link import LatestLink, in_background
from cylinder_friction.service.links.sparkplug_payload import (
    BOOLEAN,
    DOUBLE,
    INT64,
    REBIRTH,
    UINT32,
    UINT64,
    Metric,
    SparkplugError,
    asks_for_rebirth,
    payload_of,
)
from cylinder_friction.service.live.connection import Peers
from cylinder_friction.service.live.journal import LastRow
from cylinder_friction.service.live.service import LiveService
from cylinder_friction.service.live.settings import SparkplugSettings


class SparkplugLink(LatestLink):
    """Births at every connection and on request, data some times a second, deaths of sessions that are closed."""

    name: ClassVar[str] = "sparkplug"

    def __init__(self, settings: SparkplugSettings) -> None:
        super().__init__(f"mqtt://{settings.broker.host}:{settings.broker.port}/spBv1.0/{settings.group}")
        self._settings = settings
        self._born: set[str] = set()
        self._sequence, self._connects, self._asked_for_birth = 0, -1, False

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:  # noqa: ARG002 - nobody comes in
        """Be a node whenever the broker is there."""
        self._service = service
        node = f"{self._settings.group}/{self._settings.node}"
        self._broker = Broker(self._settings.broker, f"sparkplug-{node}", self._connected, self._take, self._will)
        async with self._broker.running(self._death), in_background(self._publish()):
            yield

    def _will(self) -> Message:
        """Return the death certificate of the connection to come."""
        self._connects += 1
        return self._death()

    def _death(self) -> Message:
        now_ms = _now_ms()
        return Message(self._topic("NDEATH"), payload_of([self._of_connection(now_ms)], now_ms, None), qos=1)

    def _of_connection(self, now_ms: int) -> Metric:
        return Metric("bdSeq", INT64, self._connects % 256, now_ms)

    def _connected(self, _nothing_lost: bool) -> None:
        self.counts["connected"] += 1
        self._broker.subscribe(self._topic("NCMD"))
        self._bear()

    def _take(self, message: MQTTMessage) -> None:
        self._broker.done(message)
        try:
            if asks_for_rebirth(bytes(message.payload)):
                self.counts["rebirth"] += 1
                self._asked_for_birth = True
            else:
                self.counts["other command"] += 1
        except SparkplugError:
            self.counts["no payload"] += 1

    def _bear(self) -> None:
        """Publish the birth of the node and of all sessions."""
        now_ms = _now_ms()
        self._born, self._sequence, self._asked_for_birth = set(), -1, False
        self._send("NBIRTH", [self._of_connection(now_ms), Metric(REBIRTH, BOOLEAN, False, now_ms)])
        for name, session in self._service.sessions.items():
            if (last := session.latest) is not None:
                self._send_device(name, last)

    async def _publish(self) -> None:
        while True:
            await asyncio.sleep(1.0 / self._settings.rate_hz)
            if self._broker.connected:
                if self._asked_for_birth:  # once however often they asked: a birth is of all sessions
                    self._bear()
                for name in self._born.difference(self._service.sessions):
                    self._send("DDEATH", [], name)
            async for session, last in self.changed(self._service.sessions):
                if self._broker.connected:
                    self._send_device(session.name, last)
            self._born.intersection_update(self._service.sessions)

    def _send_device(self, name: str, last: LastRow) -> None:
        time_ms = int(1e3 * last.time_s)
        named = zip(("friction_n", "lower_n", "upper_n"), last.newtons, strict=True)
        metrics = [Metric(each, DOUBLE, value, time_ms) for each, value in named]
        metrics.append(Metric("flags", UINT32, last.flags, time_ms))
        metrics.append(Metric("index", UINT64, last.index, time_ms))
        self._send("DDATA" if name in self._born else "DBIRTH", metrics, name)
        self._born.add(name)

    def _send(self, kind: str, metrics: list[Metric], device: str = "") -> None:
        self._sequence = (self._sequence + 1) % 256
        self._broker.publish(Message(self._topic(kind, device), payload_of(metrics, _now_ms(), self._sequence)))

    def _topic(self, kind: str, device: str = "") -> str:
        behind = f"/{device.replace('/', '%2F')}" if device else ""  # a device is one level
        return f"spBv1.0/{self._settings.group}/{kind}/{self._settings.node}{behind}"


def _now_ms() -> int:
    return int(1e3 * time.time())

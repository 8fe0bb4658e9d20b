"""A connection to an MQTT 5 broker on the event loop, renewed after a break."""

import asyncio
import logging
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from socket import IPPROTO_TCP, TCP_NODELAY
from typing import Any

from paho.mqtt.client import Client, MQTTMessage, MQTTv5
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from cylinder_friction_live.links.link import in_background
from cylinder_friction_live.settings import BrokerSettings

RETRY_S, LONGEST_RETRY_S = 0.2, 5.0
KEEPALIVE_S = 20
RECEIVE_MAXIMUM = 1000
"""Most messages that the broker sends before the first of them is acknowledged."""
UNSENT_MESSAGES = 100
_MISC_S = 1.0
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Message:
    """A message to publish."""

    topic: str
    payload: bytes | str
    qos: int = 0
    retain: bool = False


class Broker:
    """A client of a broker; its callbacks run on the event loop.

    Args:
        settings: The broker's address, and how to log in.
        client_id: Name of this client, unique at the broker.
        on_connect: Called after each connection, with whether the broker kept the messages of the break.
        on_message: Called with each message; the callback, or a later owner of the message, calls ``done``.
        will: Called before each connection; makes the message that the broker publishes if the connection is lost.
        session_s: Time for which the broker keeps messages after a break [s]; not those of an earlier process.
        largest_bytes: Size above which the broker keeps messages back.

    Attributes:
        connected: Whether the client is connected.
    """

    def __init__(
        self,
        settings: BrokerSettings,
        client_id: str,
        on_connect: Callable[[bool], None],
        on_message: Callable[[MQTTMessage], None],
        will: Callable[[], Message],
        session_s: int = 0,
        largest_bytes: int = 1 << 20,
    ) -> None:
        self._settings, self._on_connect, self._will = settings, on_connect, will
        self._session_s, self._largest_bytes = session_s, largest_bytes
        self._loop = asyncio.get_running_loop()
        self._client = client = Client(CallbackAPIVersion.VERSION2, client_id, protocol=MQTTv5, manual_ack=True)
        if settings.tls:
            client.tls_set(settings.ca_file)
        if settings.user is not None:
            client.username_pw_set(settings.user, settings.password())
        client.on_connect = self._connected_to
        client.on_message = lambda _client, _data, message: on_message(message)
        client.on_publish = lambda _client, _data, number, _code, _properties: self._published(number)
        client.on_socket_close = lambda _client, _data, socket: self._closed(socket)
        client.on_socket_register_write = lambda _client, _data, socket: self._watch_writing(socket)
        client.on_socket_unregister_write = lambda _client, _data, socket: self._unwatch_writing(socket)
        self._lost = asyncio.Event()
        self._room = asyncio.Semaphore(UNSENT_MESSAGES)
        self._unsent: set[int] = set()
        self._connecting = self.connected = False
        self._again = False

    @asynccontextmanager
    async def running(self, goodbye: Callable[[], Message]) -> AsyncIterator[None]:
        """Stay connected whenever the broker is reachable; at the end publish ``goodbye`` in place of the will."""
        async with in_background(self._run()):
            try:
                yield
            finally:
                if self.connected:
                    self.publish(goodbye())
                    self._client.disconnect()
                    with suppress(TimeoutError):
                        async with asyncio.timeout(1.0):
                            await self._lost.wait()

    def publish(self, message: Message) -> None:
        """Publish without waiting; messages of QoS 0 are lost without a connection."""
        self._client.publish(message.topic, message.payload, message.qos, message.retain)

    async def send(self, topic: str, payload: bytes | str) -> None:
        """Publish with QoS 1; return once more can be sent, which waits while the broker is unreachable."""
        await self._room.acquire()
        self._unsent.add(self._client.publish(topic, payload, qos=1).mid)

    def subscribe(self, topic: str) -> None:
        """Subscribe to a topic with QoS 1, without its retained message."""
        self._client.subscribe(topic, options=SubscribeOptions(qos=1, retainHandling=2))

    def done(self, message: MQTTMessage) -> None:
        """Allow the broker to send one more message."""
        if self.connected:
            self._client.ack(message.mid, message.qos)

    async def _run(self) -> None:
        retry_s = RETRY_S
        try:
            while True:
                try:
                    await self._connect()
                    while not self._lost.is_set():
                        with suppress(TimeoutError):
                            async with asyncio.timeout(_MISC_S):
                                await self._lost.wait()
                        self._client.loop_misc()
                        retry_s = RETRY_S if self.connected else retry_s
                except OSError as error:
                    _log.warning("broker %s:%d: %s", self._settings.host, self._settings.port, error)
                self._drop()
                await asyncio.sleep(retry_s)
                retry_s = min(2.0 * retry_s, LONGEST_RETRY_S)
        finally:
            self._drop()

    def _drop(self) -> None:
        """Drop a broken connection; the broker then publishes the will."""
        self.connected = False
        socket = self._client.socket()
        if socket is not None:
            self._closed(socket)
            socket.close()

    async def _connect(self) -> None:
        """Connect in a thread, as name lookup and TLS are slow; then the event loop takes over."""
        self._lost.clear()
        properties = Properties(PacketTypes.CONNECT)
        properties.SessionExpiryInterval, properties.ReceiveMaximum = self._session_s, RECEIVE_MAXIMUM
        properties.MaximumPacketSize = self._largest_bytes
        will = self._will()
        self._client.will_set(will.topic, will.payload, will.qos, will.retain)
        self._connecting = True
        try:
            await asyncio.to_thread(
                self._client.connect, self._settings.host, self._settings.port, KEEPALIVE_S,
                clean_start=not (self._again and self._session_s), properties=properties,
            )  # fmt: skip
        finally:
            self._connecting = False
        socket: Any = self._client.socket()
        socket.setsockopt(IPPROTO_TCP, TCP_NODELAY, 1)  # otherwise small messages wait for each other
        self._loop.add_reader(socket, self._read)
        if self._client.want_write():
            self._loop.add_writer(socket, self._client.loop_write)

    def _read(self) -> None:
        self._client.loop_read()
        while isinstance(socket := self._client.socket(), ssl.SSLSocket) and socket.pending():
            self._client.loop_read()  # bytes that TLS has read already do not wake the event loop

    def _watch_writing(self, socket: Any) -> None:
        if not self._connecting:
            self._loop.add_writer(socket, self._client.loop_write)

    def _unwatch_writing(self, socket: Any) -> None:
        if not self._connecting:
            self._loop.remove_writer(socket)

    def _closed(self, socket: Any) -> None:
        if not self._connecting and socket.fileno() >= 0:
            self._loop.remove_reader(socket)
            self._loop.remove_writer(socket)
            self._lost.set()

    def _connected_to(self, _client: Client, _data: Any, flags: Any, code: Any, _properties: Any) -> None:
        if code.is_failure:
            _log.warning("broker %s:%d: %s", self._settings.host, self._settings.port, code)
            self._lost.set()
            return
        self.connected = self._again = True
        self._on_connect(flags.session_present)

    def _published(self, number: int) -> None:
        if number in self._unsent:
            self._unsent.discard(number)
            self._room.release()

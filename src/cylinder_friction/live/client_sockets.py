"""What carries a client's messages, by its address: WebSocket, raw TCP or MQTT."""

import json
import queue
import select
import socket
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import unquote, urlsplit

from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect

from cylinder_friction.live.settings import HELD_BACK_S
from cylinder_friction.live.tcp import HEAD, message_size, packed, unpacked

OPEN_S = 5.0
REFUSED = (4401, 4403)
"""Codes with which the service closes a connection that may not be."""
KEEPALIVE_S = 20
_LARGEST_BYTES = 1 << 30


class LiveClientError(RuntimeError):
    """The service refused something, or cannot be reached; the message is its own."""


class ClientSocket(Protocol):
    """Whole messages to and from the service; a break is an ``OSError``.

    Attributes:
        window: Most blocks that may be on their way without an acknowledgement; None: the link itself holds back.
    """

    window: int | None

    def send(self, message: bytes | str) -> None:
        """Send a message."""
        ...

    def recv(self, timeout_s: float) -> bytes | str:
        """Return the next message; raises ``TimeoutError`` when there is none within ``timeout_s``."""
        ...


def connected(url: str, token: str = "", ca: Path | None = None) -> AbstractContextManager[ClientSocket]:
    """Return the context of a connection to the service at ``ws://``, ``wss://``, ``tcp://``, ``mqtt://``, ``mqtts://``.

    Raises:
        ValueError: It is none of these.
        LiveClientError: The service does not take this client, or its certificate is not that of ``ca``.
    """
    scheme = url.partition("://")[0]
    if scheme in ("ws", "wss"):
        return _web_socket(url, token, ca)
    if scheme == "tcp":
        return _tcp(url)
    if scheme in ("mqtt", "mqtts"):
        return _mqtt(url, ca)
    raise ValueError(
        f"{url!r}: expected ws://HOST:PORT/stream, wss://..., tcp://HOST:PORT, mqtt://BROKER:PORT/PREFIX/CLIENT or "
        "mqtts://..."
    )


@contextmanager
def _web_socket(url: str, token: str, ca: Path | None) -> Iterator[ClientSocket]:
    tls = ssl.create_default_context(cafile=ca) if url.startswith("wss:") else None
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        with connect(
            url, max_size=None, open_timeout=OPEN_S, close_timeout=0.5, ssl=tls, additional_headers=headers,
            ping_timeout=HELD_BACK_S,
        ) as connection:  # fmt: skip
            yield _WebSocket(connection)
    except ssl.SSLCertVerificationError as error:
        raise LiveClientError(f"{url}: its certificate is not trusted ({error}); give ca") from error
    except (ConnectionClosed, InvalidHandshake, EOFError) as error:  # also of a service killed while it greets
        raise ConnectionError(str(error)) from error


def _broken(error: ConnectionClosed) -> OSError:
    """Return a break as an ``OSError``; raises ``LiveClientError`` where another try would be refused as well."""
    if error.rcvd is not None and error.rcvd.code in REFUSED:
        raise LiveClientError(error.rcvd.reason) from error
    return ConnectionError(str(error))


class _WebSocket:
    window: int | None = None

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection

    def send(self, message: bytes | str) -> None:
        try:
            self._connection.send(message)
        except ConnectionClosed as error:
            raise _broken(error) from error

    def recv(self, timeout_s: float) -> bytes | str:
        try:
            return self._connection.recv(timeout=timeout_s)
        except ConnectionClosed as error:
            raise _broken(error) from error


@contextmanager
def _tcp(url: str) -> Iterator[ClientSocket]:
    place = urlsplit(url)
    with socket.create_connection((place.hostname, place.port), OPEN_S) as connection:
        _send_at_once(connection)
        connection.setblocking(False)
        yield _Tcp(connection)


def _send_at_once(connection: Any) -> None:
    """Let small messages not wait for each other."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


class _Tcp:
    window: int | None = None

    def __init__(self, connection: socket.socket) -> None:
        self._connection, self._got = connection, bytearray()

    def send(self, message: bytes | str) -> None:
        rest = memoryview(packed(message))
        while rest:  # estimates are read meanwhile, or both sides could wait for each other
            readable, writable, _ = select.select([self._connection], [self._connection], [])
            if readable:
                self._read()
            if writable:
                rest = rest[self._connection.send(rest) :]

    def recv(self, timeout_s: float) -> bytes | str:
        deadline = time.monotonic() + timeout_s
        size, kind = message_size(self._first(HEAD.size, deadline), _LARGEST_BYTES)
        content = self._first(HEAD.size + size, deadline)[HEAD.size :]
        del self._got[: HEAD.size + size]
        return unpacked(content, kind)

    def _first(self, size: int, deadline: float) -> bytes:
        """Return the first bytes of what has come, which stay until their message is whole."""
        while len(self._got) < size:
            if not select.select([self._connection], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise TimeoutError
            self._read()
        return bytes(self._got[:size])

    def _read(self) -> None:
        part = self._connection.recv(1 << 20)
        if not part:
            raise ConnectionError("the service has closed the connection")
        self._got += part


@contextmanager
def _mqtt(url: str, ca: Path | None) -> Iterator[ClientSocket]:
    place = urlsplit(url)
    topic = place.path.strip("/")
    connection = _Mqtt(topic)
    client = connection.client
    if place.scheme == "mqtts":
        client.tls_set(None if ca is None else str(ca))
    if place.username is not None:
        client.username_pw_set(unquote(place.username), unquote(place.password or ""))
    client.connect(place.hostname or "", place.port or (8883 if place.scheme == "mqtts" else 1883), KEEPALIVE_S)
    client.loop_start()
    try:
        connection.wait_for_service()
        yield connection
    finally:
        client.disconnect()
        client.loop_stop()


class _Mqtt:
    """A client of a broker that knows from ``PREFIX/state`` whether the service may have missed a message."""

    window: int | None = 200

    def __init__(self, topic: str) -> None:
        from paho.mqtt.client import Client, MQTTv5
        from paho.mqtt.enums import CallbackAPIVersion

        prefix, _, name = topic.rpartition("/")
        self._topic, self._state, self._since = topic, f"{prefix}/state", ""
        self._got: queue.Queue[bytes | str | None] = queue.Queue()  # None: messages may have been lost
        self._there = threading.Event()
        self.client = Client(CallbackAPIVersion.VERSION2, name, protocol=MQTTv5, reconnect_on_failure=False)
        self.client.max_queued_messages_set(1000)
        self.client.on_socket_open = lambda _client, _data, opened: _send_at_once(opened)
        self.client.on_connect = lambda client, *_: client.subscribe([(self._state, 1), (f"{topic}/out", 1)])
        self.client.on_disconnect = lambda *_: self._got.put(None)
        self.client.on_message = lambda _client, _data, message: self._take(message.topic, bytes(message.payload))

    def wait_for_service(self) -> None:
        if not self._there.wait(OPEN_S):
            raise ConnectionError(f"no live service states on {self._state} that it is there")

    def send(self, message: bytes | str) -> None:
        if self.client.publish(f"{self._topic}/in", message, qos=1).rc:
            raise ConnectionError("the broker is away, or takes no more")

    def recv(self, timeout_s: float) -> bytes | str:
        try:
            message = self._got.get(timeout=timeout_s) if timeout_s > 0.0 else self._got.get_nowait()
        except queue.Empty:
            raise TimeoutError from None
        if message is None:
            raise ConnectionError("messages to the service may have been lost")
        if isinstance(message, str) and message.startswith('{"closed"'):
            raise ConnectionError(message)
        return message

    def _take(self, topic: str, payload: bytes) -> None:
        if topic != self._state:
            self._got.put(payload.decode() if payload.startswith(b"{") else payload)
            return
        state = json.loads(payload)
        if state["online"]:
            if self._since not in ("", state["since"]):
                self._got.put(None)
            self._since = state["since"]
            self._there.set()

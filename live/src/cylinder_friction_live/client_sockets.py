"""Sockets of a client, chosen by the address: WebSocket or MQTT."""

import json
import queue
import select
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import unquote, urlsplit

from websockets.client import ClientProtocol
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

from cylinder_friction_live.settings import HELD_BACK_S

OPEN_S, CLOSE_S = 5.0, 0.5
REFUSED = (4401, 4403)
"""Codes with which the service closes a refused connection."""
KEEPALIVE_S = 20


class LiveClientError(RuntimeError):
    """The service refused a request, or cannot be reached; the message is the service's own."""


class ClientSocket(Protocol):
    """Whole messages to and from the service; a break is an ``OSError``.

    Attributes:
        window: Most blocks without an acknowledgement; None: the link itself limits them.
    """

    window: int | None

    def send(self, message: bytes | str) -> None:
        """Send a message."""
        ...

    def recv(self, timeout_s: float) -> bytes | str:
        """Wait for the next message; raises ``TimeoutError`` if none comes within ``timeout_s``."""
        ...


def connected(url: str, token: str = "", ca: Path | None = None) -> AbstractContextManager[ClientSocket]:
    """Open a connection to the service at ``ws://``, ``wss://``, ``mqtt://`` or ``mqtts://``.

    Raises:
        ValueError: The address has another form.
        LiveClientError: The service refuses this client, or its certificate is not signed by ``ca``.
    """
    scheme = url.partition("://")[0]
    if scheme in ("ws", "wss"):
        return _web_socket(url, token, ca)
    if scheme in ("mqtt", "mqtts"):
        return _mqtt(url, ca)
    raise ValueError(
        f"{url!r}: expected ws://HOST:PORT/stream, wss://..., mqtt://BROKER:PORT/PREFIX/CLIENT or mqtts://..."
    )


def _send_at_once(connection: Any) -> None:
    """Send small messages at once (TCP_NODELAY)."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


@contextmanager
def _web_socket(url: str, token: str, ca: Path | None) -> Iterator[ClientSocket]:
    uri = parse_uri(url)
    with ExitStack() as opened:
        connection = opened.enter_context(socket.create_connection((uri.host, uri.port), OPEN_S))
        _send_at_once(connection)
        if uri.secure:
            tls = ssl.create_default_context(cafile=ca)
            try:
                connection = opened.enter_context(tls.wrap_socket(connection, server_hostname=uri.host))
            except ssl.SSLCertVerificationError as error:
                raise LiveClientError(f"{url}: its certificate is not trusted ({error}); give ca") from error
        stream = _WebSocket(connection, ClientProtocol(uri, max_size=None), token)
        opened.callback(stream.close)
        yield stream


class _WebSocket:
    """Messages over a WebSocket, in the caller's thread.

    While it cannot send, it reads. The service stops reading from a client that leaves its estimates unread, so
    otherwise both sides would wait forever.
    """

    window: int | None = None

    def __init__(self, connection: socket.socket, protocol: ClientProtocol, token: str) -> None:
        connection.setblocking(False)
        self._connection, self._out, self._heard_s = connection, bytearray(), time.monotonic()
        self._protocol = protocol
        self._messages: deque[bytes | str] = deque()
        self._parts: list[bytes | bytearray | memoryview] = []
        self._text = False
        request, deadline = protocol.connect(), time.monotonic() + OPEN_S
        if token:
            request.headers["Authorization"] = f"Bearer {token}"
        protocol.send_request(request)
        self._send_out()
        while protocol.state is State.CONNECTING and protocol.handshake_exc is None:
            if not self._exchange(deadline - time.monotonic()):
                raise TimeoutError(f"the service did not greet within {OPEN_S:g} s")
        if protocol.handshake_exc is not None:
            raise ConnectionError(str(protocol.handshake_exc)) from protocol.handshake_exc

    def send(self, message: bytes | str) -> None:
        self._refuse_when_closed()
        if isinstance(message, str):
            self._protocol.send_text(message.encode())
        else:
            self._protocol.send_binary(message)
        self._send_out()

    def close(self) -> None:
        """Close the connection; once the service has closed it too, it has read everything that was sent."""
        deadline = time.monotonic() + CLOSE_S
        with suppress(OSError):  # until the timeout
            self._refuse_when_closed()
            self._protocol.send_close(CloseCode.NORMAL_CLOSURE)
            self._out += b"".join(self._protocol.data_to_send())
            while self._protocol.state is not State.CLOSED and time.monotonic() < deadline:
                self._exchange(deadline - time.monotonic())

    def recv(self, timeout_s: float) -> bytes | str:
        deadline = time.monotonic() + timeout_s
        while (message := self._next()) is None:
            if not self._exchange(deadline - time.monotonic()):
                raise TimeoutError
        return message

    def _send_out(self) -> None:
        self._out += b"".join(self._protocol.data_to_send())
        while self._out:
            self._exchange(HELD_BACK_S)

    def _exchange(self, timeout_s: float) -> bool:
        """Send if possible, else receive; return whether either happened within ``timeout_s``."""
        out = [self._connection] if self._out else []
        readable, writable, _ = select.select([self._connection], out, [], max(0.0, timeout_s))
        with suppress(BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):  # half a record of TLS
            if writable:
                del self._out[: self._connection.send(self._out)]
            elif readable:
                part = self._connection.recv(1 << 16)
                self._heard_s = time.monotonic()
                self._take(part)
        if not readable and time.monotonic() - self._heard_s > HELD_BACK_S:  # the service's pings come more often
            raise ConnectionError(f"nothing came from the service for {HELD_BACK_S:g} s")
        return bool(readable or writable)

    def _take(self, part: bytes) -> None:
        if part:
            self._protocol.receive_data(part)
        else:
            self._protocol.receive_eof()
        for event in self._protocol.events_received():
            if isinstance(event, Frame) and event.opcode in (Opcode.TEXT, Opcode.BINARY, Opcode.CONT):
                if event.opcode is not Opcode.CONT:
                    self._text = event.opcode is Opcode.TEXT
                self._parts.append(event.data)
                if event.fin:
                    whole, self._parts = b"".join(self._parts), []
                    self._messages.append(whole.decode() if self._text else whole)
        self._out += b"".join(self._protocol.data_to_send())  # to pings

    def _next(self) -> bytes | str | None:
        if self._messages:
            return self._messages.popleft()
        self._refuse_when_closed()
        return None

    def _refuse_when_closed(self) -> None:
        """Raise ``ConnectionError``, or ``LiveClientError`` if another try would be refused as well."""
        if self._protocol.state is State.OPEN:
            return
        close = self._protocol.close_rcvd
        if close is not None and close.code in REFUSED:
            raise LiveClientError(close.reason)
        raise ConnectionError("the service has closed the connection" + (f": {close}" if close else ""))


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

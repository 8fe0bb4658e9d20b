"""What carries a client's messages, by its address: WebSocket or raw TCP."""

import select
import socket
import ssl
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from cylinder_friction.live.tcp import HEAD, message_size, packed, unpacked

OPEN_S = 5.0
REFUSED = (4401, 4403)
"""Codes with which the service closes a connection that may not be."""
_LARGEST_BYTES = 1 << 30


class LiveClientError(RuntimeError):
    """The service refused something, or cannot be reached; the message is its own."""


class ClientSocket(Protocol):
    """Whole messages to and from the service; a break is an ``OSError``."""

    def send(self, message: bytes | str) -> None:
        """Send a message."""
        ...

    def recv(self, timeout_s: float) -> bytes | str:
        """Return the next message; raises ``TimeoutError`` when there is none within ``timeout_s``."""
        ...


def connected(url: str, token: str = "", ca: Path | None = None) -> AbstractContextManager[ClientSocket]:
    """Return the context of a connection to the service at ``ws://``, ``wss://`` or ``tcp://``.

    Raises:
        ValueError: It is none of these.
        LiveClientError: The service does not take this client, or its certificate is not that of ``ca``.
    """
    scheme = url.partition("://")[0]
    if scheme in ("ws", "wss"):
        return _web_socket(url, token, ca)
    if scheme == "tcp":
        return _tcp(url)
    raise ValueError(f"{url!r}: expected ws://HOST:PORT/stream, wss://... or tcp://HOST:PORT")


@contextmanager
def _web_socket(url: str, token: str, ca: Path | None) -> Iterator[ClientSocket]:
    tls = ssl.create_default_context(cafile=ca) if url.startswith("wss:") else None
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        with connect(
            url, max_size=None, open_timeout=OPEN_S, close_timeout=0.5, ssl=tls, additional_headers=headers
        ) as connection:
            yield _WebSocket(connection)
    except ssl.SSLCertVerificationError as error:
        raise LiveClientError(f"{url}: its certificate is not trusted ({error}); give ca") from error
    except ConnectionClosed as error:
        raise ConnectionError(str(error)) from error


def _broken(error: ConnectionClosed) -> OSError:
    """Return a break as an ``OSError``; raises ``LiveClientError`` where another try would be refused as well."""
    if error.rcvd is not None and error.rcvd.code in REFUSED:
        raise LiveClientError(error.rcvd.reason) from error
    return ConnectionError(str(error))


class _WebSocket:
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
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setblocking(False)
        yield _Tcp(connection)


class _Tcp:
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

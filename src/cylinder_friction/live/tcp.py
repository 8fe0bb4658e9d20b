"""Raw TCP, for clients without WebSocket: the same messages, each behind its length and its kind."""

import asyncio
import json
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import ClassVar

from cylinder_friction.live.connection import ClientGoneError, Connection, Peers
from cylinder_friction.live.frames import FrameError
from cylinder_friction.live.links import Link
from cylinder_friction.live.service import LiveService
from cylinder_friction.live.settings import TcpSettings

HEAD = struct.Struct("<IB")
"""Length of the message behind it [bytes], and its kind."""
FRAMES, TEXT = 1, 2
_LAST_WORD_S = 1.0
"""For so long a client that is refused may read why."""


def packed(message: bytes | str) -> bytes:
    """Return a message with its head: frames as they are, JSON as UTF-8."""
    content = message.encode() if isinstance(message, str) else message
    return HEAD.pack(len(content), TEXT if isinstance(message, str) else FRAMES) + content


def message_size(head: bytes, limit_bytes: int) -> tuple[int, int]:
    """Return length and kind of the message behind a head; raises ``FrameError`` where none can follow."""
    size, kind = HEAD.unpack(head)
    if kind not in (FRAMES, TEXT) or not 0 < size <= limit_bytes:
        raise FrameError(
            f"got a message of kind {kind} and {size} bytes; expected 1 (frames) or 2 (JSON), and at most {limit_bytes}"
        )
    return size, kind


def unpacked(content: bytes, kind: int) -> bytes | str:
    """Return what stands behind a head; raises ``FrameError`` where text is no UTF-8."""
    try:
        return content.decode() if kind == TEXT else content
    except UnicodeDecodeError as error:
        raise FrameError(f"got text that is no UTF-8 ({error}); expected JSON") from error


class TcpTransport:
    """Messages of one connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, limit_bytes: int) -> None:
        self._reader, self._writer, self._limit_bytes = reader, writer, limit_bytes

    async def receive(self) -> bytes | str:
        """Return the next message; raises ``ClientGoneError``, or ``FrameError`` after which none can be found."""
        try:
            size, kind = message_size(await self._reader.readexactly(HEAD.size), self._limit_bytes)
            return unpacked(await self._reader.readexactly(size), kind)
        except (asyncio.IncompleteReadError, OSError) as error:
            raise ClientGoneError from error

    async def send(self, message: bytes | str) -> None:
        """Send a message; returns when more can be taken, raises ``ClientGoneError``."""
        try:
            self._writer.write(packed(message))
            await self._writer.drain()
        except OSError as error:
            raise ClientGoneError from error

    async def refuse(self, problem: str) -> None:
        """State what is wrong, and give the client time to read it before the connection is closed."""
        await self.send(json.dumps({"error": problem}))
        self._writer.write_eof()
        while await self._reader.read(1 << 16):
            pass


class TcpLink(Link):
    """Listens for clients; each is a connection as any other."""

    name: ClassVar[str] = "tcp"

    def __init__(self, settings: TcpSettings) -> None:
        super().__init__()
        self._settings = settings

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:
        """Listen; clients that are there at the end are left."""
        clients: set[asyncio.Task[None] | None] = set()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            clients.add(asyncio.current_task())
            writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            transport = TcpTransport(reader, writer, service.limits.message_bytes)
            try:
                await Connection(transport, service, peers).run()
            except FrameError as error:
                peers.refused["FrameError"] += 1
                with suppress(ClientGoneError, OSError, TimeoutError):
                    async with asyncio.timeout(_LAST_WORD_S):
                        await transport.refuse(str(error))
            finally:
                clients.discard(asyncio.current_task())
                writer.close()

        server = await asyncio.start_server(serve, self._settings.host, self._settings.port)
        host, port = server.sockets[0].getsockname()[:2]
        self.address = f"tcp://{host}:{port}"
        try:
            yield
        finally:
            server.close()
            for client in filter(None, clients.copy()):
                client.cancel()
            await server.wait_closed()

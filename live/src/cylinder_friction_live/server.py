"""uvicorn's server, which ends within two seconds whatever its clients do."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import uvicorn
from starlette.applications import Starlette
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import WebSocketException
from websockets.frames import Frame
from websockets.protocol import State

from cylinder_friction_live.access import Access
from cylinder_friction_live.settings import HELD_BACK_S

ANSWERING = "cylinder_friction.answering"
"""Name of the protocol in a scope's extensions."""
LAST_WORD_S = 0.2
"""Time for clients to read why they are closed when the service ends [s]."""
LINGER_TICKS = 50
"""Tenths of a second between two checks that abandon connections which were already closing at the last check."""


class AnsweringProtocol(WebSocketsSansIOProtocol):
    """Answers a message in the call that reads it, if the application can; others wait in the queue."""

    answer: Callable[[bytes], bytes | None] | None = None
    """Makes the answer to a message, or returns None if the message must wait; the application sets it."""

    async def run_asgi(self) -> None:
        """Run the application."""
        self.scope["extensions"][ANSWERING] = {"protocol": self}
        await super().run_asgi()

    def handle_bytes(self, event: Frame) -> None:
        """Answer a whole message at once if no message and no answer waits, or queue it."""
        idle = self.conn.state is State.OPEN and self.queue.empty() and self.writable.is_set()
        idle = idle and not self.transport.is_closing()  # a client that has died leaves messages behind
        answer = self.answer(bytes(event.data)) if idle and event.fin and self.answer is not None else None
        if answer is None:
            super().handle_bytes(event)
        else:
            self.conn.send_binary(answer)
            self.transport.write(b"".join(self.conn.data_to_send()))

    def send_receive_event_to_app(self) -> None:
        """Queue a whole message; a text that is not UTF-8 is answered like any other that is no JSON."""
        if self.curr_msg_data_type == "text":
            self.frames = [b"".join(self.frames).decode(errors="replace").encode()]
        super().send_receive_event_to_app()


class LiveServer(uvicorn.Server):
    """A server that drains before it closes.

    Args:
        config: uvicorn's configuration.
        drain: Awaited before closing; health is still reported meanwhile.
    """

    def __init__(self, config: uvicorn.Config, drain: Callable[[], Awaitable[None]]) -> None:
        super().__init__(config)
        self._drain = drain
        self._closing: set[Any] = set()

    async def on_tick(self, counter: int) -> bool:
        """Abandon closing connections whose client does not read its last messages."""
        if counter % LINGER_TICKS == 0:
            closing = {each for each in self.server_state.connections if _transport(each).is_closing()}
            for connection in closing & self._closing:
                _transport(connection).abort()
            self._closing = closing
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Drain, close open connections with 1012 (service restart), and abandon clients that do not read."""
        await self._drain()
        for server in self.servers:
            server.close()
        for connection in list(self.server_state.connections):
            with suppress(WebSocketException):  # it is being closed already
                connection.shutdown()
        await asyncio.sleep(LAST_WORD_S)
        for connection in list(self.server_state.connections):
            _transport(connection).abort()
        await asyncio.sleep(0.0)  # let transports close
        await super().shutdown(sockets)


def live_server(app: Starlette, host: str, port: int, access: Access, message_bytes: int) -> LiveServer:
    """Build the server of an application of ``live.app.create_app``; port 0 takes a free one."""
    config = uvicorn.Config(
        app, host=host, port=port, ws_max_size=message_bytes, log_level="warning", ws_per_message_deflate=False,
        ws=AnsweringProtocol, ws_ping_timeout=HELD_BACK_S, timeout_graceful_shutdown=1, loop="asyncio",
        ssl_certfile=access.tls_certificate, ssl_keyfile=access.tls_key,
    )  # fmt: skip
    return LiveServer(config, app.state.drain)


def _transport(connection: Any) -> asyncio.Transport:
    transport: asyncio.Transport = connection.transport
    return transport

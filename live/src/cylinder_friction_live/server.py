"""uvicorn's server, which ends within two seconds whoever is connected."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import uvicorn
from starlette.applications import Starlette
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import WebSocketException

from cylinder_friction_live.access import Access
from cylinder_friction_live.settings import HELD_BACK_S

LAST_WORD_S = 0.2
"""For so long a client may read why it is closed when the service ends."""
LINGER_TICKS = 50
"""Every so many tenths of a second, connections are left behind that were being closed the last time already."""


class _ReadsAhead(WebSocketsSansIOProtocol):
    """Stops reading at the second message that waits, not at each one: that would cost as much as what it brings."""

    def send_receive_event_to_app(self) -> None:
        self.read_paused = self.queue.empty()  # where it is true, nothing is paused now
        super().send_receive_event_to_app()


class LiveServer(uvicorn.Server):
    """A server that drains before it closes.

    Args:
        config: Of uvicorn.
        drain: Awaited first; within it health is still reported.
    """

    def __init__(self, config: uvicorn.Config, drain: Callable[[], Awaitable[None]]) -> None:
        super().__init__(config)
        self._drain = drain
        self._closing: set[Any] = set()

    async def on_tick(self, counter: int) -> bool:
        """Leave connections behind whose client does not read what is left for it before they are closed."""
        if counter % LINGER_TICKS == 0:
            closing = {each for each in self.server_state.connections if _transport(each).is_closing()}
            for connection in closing & self._closing:
                _transport(connection).abort()
            self._closing = closing
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Drain, close what is open with 1012 (service restart), and leave those that do not read behind."""
        await self._drain()
        for server in self.servers:
            server.close()
        for connection in list(self.server_state.connections):
            with suppress(WebSocketException):  # it is being closed already
                connection.shutdown()
        await asyncio.sleep(LAST_WORD_S)
        for connection in list(self.server_state.connections):
            _transport(connection).abort()
        await asyncio.sleep(0.0)  # they take their leave
        await super().shutdown(sockets)


def live_server(app: Starlette, host: str, port: int, access: Access, message_bytes: int) -> LiveServer:
    """Return the server of an application of ``live.app.create_app``; port 0 takes a free one."""
    config = uvicorn.Config(
        app, host=host, port=port, ws_max_size=message_bytes, log_level="warning", ws_per_message_deflate=False,
        ws=_ReadsAhead, ws_ping_timeout=HELD_BACK_S, timeout_graceful_shutdown=1, loop="asyncio",
        ssl_certfile=access.tls_certificate, ssl_keyfile=access.tls_key,
    )  # fmt: skip
    return LiveServer(config, app.state.drain)


def _transport(connection: Any) -> asyncio.Transport:
    transport: asyncio.Transport = connection.transport
    return transport

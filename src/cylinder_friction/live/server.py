"""uvicorn's server, which ends within two seconds whoever is connected."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress

import uvicorn
from websockets.exceptions import WebSocketException

LAST_WORD_S = 0.2
"""For so long a client may read why it is closed."""


class LiveServer(uvicorn.Server):
    """A server that drains before it closes.

    Args:
        config: Of uvicorn.
        drain: Awaited first; within it health is still reported.
    """

    def __init__(self, config: uvicorn.Config, drain: Callable[[], Awaitable[None]]) -> None:
        super().__init__(config)
        self._drain = drain

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
            transport = connection.transport
            if isinstance(transport, asyncio.Transport):
                transport.abort()
        await asyncio.sleep(0.0)  # they take their leave
        await super().shutdown(sockets)

"""A client's WebSocket."""

from starlette.websockets import WebSocket, WebSocketDisconnect

from cylinder_friction.service.live.connection import ClientGoneError


class WebSocketTransport:
    """Messages of a WebSocket that has been accepted."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket

    async def receive(self) -> bytes | str:
        """Return the next message; raises ``ClientGoneError``."""
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise ClientGoneError
        content: bytes | None = message.get("bytes")
        return content if content is not None else message.get("text") or ""

    async def send(self, message: bytes | str) -> None:
        """Send a message; raises ``ClientGoneError``."""
        try:
            if isinstance(message, bytes):
                await self._socket.send_bytes(message)
            else:
                await self._socket.send_text(message)
        except (WebSocketDisconnect, RuntimeError) as error:
            raise ClientGoneError from error

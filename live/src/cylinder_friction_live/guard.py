"""Who may do what: the role of a connection's token, and the names under which a browser may come."""

import asyncio
import base64
import binascii
import json
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import suppress
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket, WebSocketDisconnect

from cylinder_friction_live.access import LOOPBACK, Access, Refusal, TokenFile, bearer_token
from cylinder_friction_live.events import Events

PROTOCOL, TOKEN_PROTOCOL = "cylinder-friction", "token."
"""A browser cannot set headers of a WebSocket: it offers these subprotocols, the second with its token in base64url."""
GUESS_S = 0.5
"""How long a wrong token waits for its refusal."""
LAST_WORD_S = 1.0
"""For so long a client that is sent away may read why."""


class AccessControl:
    """Looks at every connection before it is served.

    Args:
        access: Tokens and names; as shipped whoever reaches the service may do all, under loopback's names.
        host: What the service listens on.
        refused: Counts refusals by kind, and as ``revoked`` WebSockets whose token lost what let them in.
        events: Get them as well.

    Raises:
        AccessError: The tokens cannot be read.
    """

    def __init__(self, access: Access, host: str, refused: Counter[str], events: Events) -> None:
        self.tokens = None if access.tokens is None else TokenFile(access.tokens)
        self._hosts, self._refused = LOOPBACK | {host.lower(), *map(str.lower, access.hosts)}, refused
        self._events = events
        self._served: dict[asyncio.Timeout, tuple[WebSocket, str]] = {}

    def http(
        self, role: str, endpoint: Callable[[Request], Awaitable[Response]]
    ) -> Callable[[Request], Awaitable[Response]]:
        """Return an endpoint that a request reaches only with a token of the role, or a greater one."""

        async def guarded(request: Request) -> Response:
            refusal = await self._refusal(request, role)
            if refusal is None:
                return await endpoint(request)
            headers = {"WWW-Authenticate": "Bearer"} if refusal.status == 401 else {}
            return JSONResponse({"error": refusal.reason}, refusal.status, headers)

        return guarded

    async def serve(self, socket: WebSocket, role: str, use: Callable[[], Awaitable[None]]) -> None:
        """Accept a WebSocket and use it while it may; then, or if it may not, it is given the reason and closed."""
        refusal = await self._refusal(socket, role)
        try:
            async with asyncio.timeout(None) as scope:
                self._served[scope] = socket, role
                await socket.accept(PROTOCOL if PROTOCOL in socket.scope.get("subprotocols", ()) else None)
                if refusal is None:
                    await use()
        except TimeoutError:
            if not scope.expired():
                raise
            refusal = refusal or self._revoked(socket, role)
        finally:
            self._served.pop(scope, None)
        if refusal is not None:
            with suppress(TimeoutError, WebSocketDisconnect, RuntimeError):  # it does not read, or has left
                async with asyncio.timeout(LAST_WORD_S):
                    await socket.send_text(json.dumps({"error": refusal.reason}))
                    await socket.close(4000 + refusal.status, refusal.reason.encode()[:120].decode(errors="ignore"))

    def refresh(self) -> None:
        """Read the tokens again if their file has changed; end the use of WebSockets that these do not let in."""
        if self.tokens is None or not self.tokens.refresh():
            return
        for scope, (socket, role) in list(self._served.items()):
            refusal = self._revoked(socket, role)
            if refusal is not None:
                self._refused[refusal.kind] += 1
                self._events.note("connection closed", client=client_of(socket), why=refusal.reason)
                del self._served[scope]
                scope.reschedule(0.0)

    def _revoked(self, socket: WebSocket, role: str) -> Refusal | None:
        refusal = self._not_allowed(socket, role)
        if refusal is None:
            return None
        reason = "this token was taken out of the service's file" if refusal.status == 401 else refusal.reason
        return Refusal("revoked", refusal.status, reason)

    async def _refusal(self, connection: HTTPConnection, role: str) -> Refusal | None:
        refusal = self._foreign(connection) or self._not_allowed(connection, role)
        if refusal is not None:
            self._refused[refusal.kind] += 1
            self._events.note("connection refused", client=client_of(connection), kind=refusal.kind)
            if refusal.status == 401:
                await asyncio.sleep(GUESS_S)
        return refusal

    def _foreign(self, connection: HTTPConnection) -> Refusal | None:
        """Refuse a page of another origin, which a browser would let reach this service."""
        host, origin = connection.headers.get("host", ""), connection.headers.get("origin")
        if urlsplit(f"//{host}").hostname not in self._hosts:
            reason = f"host {host[:80]!r}: not a name of this service; use 127.0.0.1, or list it under access.hosts"
            return Refusal("host", 403, reason)
        if origin is not None and origin.partition("://")[2] != host:
            reason = f"origin {origin[:80]!r}: only this service's own page may connect from a browser"
            return Refusal("origin", 403, reason)
        return None

    def _not_allowed(self, connection: HTTPConnection, role: str) -> Refusal | None:
        return None if self.tokens is None else self.tokens.refusal(token_of(connection), role)


def client_of(connection: HTTPConnection) -> str:
    """Return where a connection comes from."""
    return "" if connection.client is None else f"{connection.client.host}:{connection.client.port}"


def token_of(connection: HTTPConnection) -> bytes:
    """Return the token of a connection, from its header or its subprotocols; empty where there is none."""
    for offered in connection.scope.get("subprotocols", ()):
        if offered.startswith(TOKEN_PROTOCOL):
            encoded = offered.removeprefix(TOKEN_PROTOCOL)
            try:
                return base64.b64decode(encoded + "=" * (-len(encoded) % 4), b"-_", validate=True)
            except (binascii.Error, ValueError):
                return b""
    return bearer_token(connection.headers.get("authorization", "").encode("latin-1"))

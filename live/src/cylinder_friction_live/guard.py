"""Checks of each connection: the role of its token, and the names that a browser may use for the service."""

import asyncio
import base64
import binascii
import json
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import suppress
from hashlib import sha256
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket, WebSocketDisconnect

from cylinder_friction_live.access import LOOPBACK, Access, Refusal, TokenFile, bearer_token
from cylinder_friction_live.events import Events

PROTOCOL, TOKEN_PROTOCOL = "cylinder-friction", "token."
"""Subprotocols that a browser offers as it cannot set headers, the second with its token in base64url."""
GUESS_S = 0.5
"""Delay of the refusal of a wrong token [s]."""
LAST_WORD_S = 1.0
"""Time for a refused client to read the reason [s]."""


class AccessControl:
    """Checks every connection before it is served.

    Args:
        access: Tokens and names; by default every client of this machine may do everything.
        host: Host on which the service listens.
        refused: Counter of refusals by kind, and as ``revoked`` of WebSockets whose token lost its role.
        events: Log of the refusals.

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
        """Protect an endpoint: a request needs a token of the role, or of a greater one."""

        async def guarded(request: Request) -> Response:
            refusal = await self._refusal(request, role)
            if refusal is None:
                return await endpoint(request)
            headers = {"WWW-Authenticate": "Bearer"} if refusal.status == 401 else {}
            return JSONResponse({"error": refusal.reason}, refusal.status, headers)

        return guarded

    async def serve(self, socket: WebSocket, role: str, use: Callable[[], Awaitable[None]]) -> None:
        """Accept a WebSocket and use it while its token allows; then send the reason and close it."""
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
            with suppress(TimeoutError, WebSocketDisconnect, RuntimeError):  # the client does not read, or has gone
                async with asyncio.timeout(LAST_WORD_S):
                    await socket.send_text(json.dumps({"error": refusal.reason}))
                    await socket.close(4000 + refusal.status, refusal.reason.encode()[:120].decode(errors="ignore"))

    def user_of(self, connection: HTTPConnection) -> str:
        """Name whom a connection counts for: the hash of its token, or its address if there are no tokens."""
        if self.tokens is not None:
            return sha256(token_of(connection)).hexdigest()
        return "" if connection.client is None else connection.client.host

    def refresh(self) -> None:
        """Read the tokens again if their file has changed, and close WebSockets that they no longer admit."""
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
        """Refuse pages of other origins, which a browser would let connect to this service."""
        host, origin = connection.headers.get("host", ""), connection.headers.get("origin")
        name = None
        with suppress(ValueError):  # half of an IPv6 address
            name = urlsplit(f"//{host}").hostname
        if name not in self._hosts:
            reason = f"host {host[:80]!r}: not a name of this service; use 127.0.0.1, or list it under access.hosts"
            return Refusal("host", 403, reason)
        if origin is not None and origin.partition("://")[2] != host:
            reason = f"origin {origin[:80]!r}: only this service's own page may connect from a browser"
            return Refusal("origin", 403, reason)
        return None

    def _not_allowed(self, connection: HTTPConnection, role: str) -> Refusal | None:
        return None if self.tokens is None else self.tokens.refusal(token_of(connection), role)


def client_of(connection: HTTPConnection) -> str:
    """Name the address that a connection comes from."""
    return "" if connection.client is None else f"{connection.client.host}:{connection.client.port}"


def token_of(connection: HTTPConnection) -> bytes:
    """Read the token of a connection, from its header or its subprotocols; empty if there is none."""
    for offered in connection.scope.get("subprotocols", ()):
        if offered.startswith(TOKEN_PROTOCOL):
            encoded = offered.removeprefix(TOKEN_PROTOCOL)
            try:
                return base64.b64decode(encoded + "=" * (-len(encoded) % 4), b"-_", validate=True)
            except (binascii.Error, ValueError):
                return b""
    return bearer_token(connection.headers.get("authorization", "").encode("latin-1"))

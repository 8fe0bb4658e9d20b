"""What every request passes: its ID, its token, the access log and the metrics; and the last resort for errors."""

import logging
import re
import secrets
import time
from datetime import UTC, datetime
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cylinder_friction.service.access import TokenFile, bearer_token
from cylinder_friction.service.json_log import JsonLog
from cylinder_friction.service.scoring.errors import RETRY, RequestError, error_body
from cylinder_friction.service.scoring.metrics import Metrics

OPEN_TO_ALL = frozenset({"/livez", "/readyz", "/ping", "/health"})
_ID = re.compile(rb"[A-Za-z0-9._-]{1,64}")

_log = logging.getLogger(__name__)


class Gate:
    """Wraps the application; sets ``scope["request_id"]``, and logs what the application puts in ``scope["notes"]``."""

    def __init__(
        self, app: ASGIApp, metrics: Metrics, tokens: TokenFile | None, log: JsonLog | None, routes: frozenset[str]
    ) -> None:
        self._app, self._metrics, self._tokens, self._log, self._routes = app, metrics, tokens, log, routes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or the application's start and end."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        began = time.perf_counter()
        headers: dict[bytes, bytes] = dict(scope["headers"])
        given = headers.get(b"x-request-id", b"")
        request_id = scope["request_id"] = given.decode() if _ID.fullmatch(given) else secrets.token_hex(8)
        notes: dict[str, Any] = scope.setdefault("notes", {})
        reply = {"status": 500, "bytes": 0}

        async def send_and_note(message: Message) -> None:
            if message["type"] == "http.response.start":
                reply["status"] = message["status"]
                message["headers"] = [*message["headers"], (b"x-request-id", request_id.encode())]
            else:
                reply["bytes"] += len(message.get("body", b""))
            await send(message)

        try:
            if b"content-length" in headers and b"transfer-encoding" in headers:
                message = "a body has either Content-Length or Transfer-Encoding; expected one of them"
                raise RequestError(400, message, {"Connection": "close"})
            self._refuse_strangers(scope["path"], headers.get(b"authorization", b""))
            await self._app(scope, receive, send_and_note)
        except RequestError as error:
            await _send_error(send_and_note, error, request_id)
        except MemoryError:
            message = "the request needs more memory than there is; send fewer rows"
            await _send_error(send_and_note, RequestError(503, message, RETRY), request_id)
        except Exception:
            _log.exception("request %s failed", request_id)
            if reply["bytes"] == 0:
                await _send_error(send_and_note, RequestError(500, "the server failed; its log has why"), request_id)
        finally:
            self._note(scope, reply, time.perf_counter() - began, notes)

    def _refuse_strangers(self, path: str, authorization: bytes) -> None:
        if self._tokens is None or path in OPEN_TO_ALL:
            return
        if refusal := self._tokens.refusal(bearer_token(authorization)):
            raise RequestError(refusal.status, refusal.reason, {"WWW-Authenticate": "Bearer"})

    def _note(self, scope: Scope, reply: dict[str, int], seconds: float, notes: dict[str, Any]) -> None:
        route = scope["path"] if scope["path"] in self._routes else "other"
        self._metrics.requests.labels(route, reply["status"]).inc()
        self._metrics.seconds.labels(route).observe(seconds)
        if self._log is None:
            return
        entry = {
            "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "request_id": scope["request_id"],
            "client": (scope.get("client") or ("",))[0],
            "method": scope["method"],
            "path": scope["path"][:200],
            **reply,
            "seconds": round(seconds, 6),
            **notes,
        }
        self._log.write(entry)


async def _send_error(send: Send, error: RequestError, request_id: str) -> None:
    body = error_body(error.status, error.message, request_id)
    headers = {"content-type": "application/json", "content-length": str(len(body)), **error.headers}
    encoded = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": error.status, "headers": encoded})
    await send({"type": "http.response.body", "body": body})

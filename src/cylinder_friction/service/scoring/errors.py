"""Refusals of requests: a status, a message for whoever sent it, and nothing of the server."""

from collections.abc import Mapping
from http import HTTPStatus

import orjson

MESSAGE_BYTES = 600
SHOWN = 80
RETRY = {"Retry-After": "1"}


class RequestError(Exception):
    """A request that is refused.

    Attributes:
        status: HTTP status.
        message: What is wrong, where, what was expected; without anything of the server.
        headers: Further headers of the response.
    """

    def __init__(self, status: int, message: str, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(message)
        self.status, self.message, self.headers = status, message, dict(headers or {})


def error_body(status: int, message: str, request_id: str) -> bytes:
    """Return the JSON of a refusal; it has MLflow's keys and the request's ID, and is short whatever was sent."""
    short = message.encode(errors="replace")[:MESSAGE_BYTES].decode(errors="ignore")
    printable = "".join(letter if letter.isprintable() else "?" for letter in short)
    code = HTTPStatus(status).name
    return orjson.dumps({"error_code": code, "message": printable, "request_id": request_id})


def shown(value: object) -> str:
    """Return a value as Python writes it, but not at any length."""
    text = repr(value[: 2 * SHOWN] if isinstance(value, str | bytes) else value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."

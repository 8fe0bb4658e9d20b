"""Refusals of requests, which show nothing of the server, and what every body is checked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import orjson

from cylinder_friction.deployment.scoring import Column, shown

MESSAGE_BYTES = 600
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


Columns = dict[str, Column]
MAX_COLUMNS = 64


@dataclass(frozen=True)
class Expected:
    """What a body should hold: at least the columns ``inputs``, and at most ``max_rows`` rows."""

    inputs: tuple[str, ...]
    max_rows: int

    def refuse_rows(self, count: int) -> None:
        """Raise ``RequestError`` (413) for too many rows."""
        if count > self.max_rows:
            raise RequestError(413, f"got {count} rows; expected at most {self.max_rows}; send recordings one by one")


def refuse_names(names: Sequence[Any]) -> None:
    """Refuse column names that are no text, there twice, or very many.

    Raises:
        RequestError: 422.
    """
    for at, name in enumerate(names):
        if not isinstance(name, str):
            raise RequestError(422, f"column {at} has the name {shown(name)}; expected text")
    if len(set(names)) < len(names):
        twice = next(name for at, name in enumerate(names) if name in names[:at])
        raise RequestError(422, f"column {shown(twice)} is there more than once; expected each column once")
    if len(names) > MAX_COLUMNS:
        raise RequestError(422, f"got {len(names)} columns; expected at most {MAX_COLUMNS}")

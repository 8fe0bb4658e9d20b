"""Times of sessions and entries, which count as UTC where they state no zone."""

from __future__ import annotations

from datetime import UTC, datetime


def moment(text: str) -> datetime:
    """Return an ISO 8601 time; one without a zone counts as UTC."""
    time = datetime.fromisoformat(text)
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def utc_time(text: str, where: str) -> str:
    """Return an ISO 8601 time as UTC with a ``Z``; see ``moment``.

    Raises:
        ValueError: It is no such time.
    """
    try:
        return moment(text).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except ValueError:
        raise ValueError(f"{where}: got {text!r}, expected a time such as 2026-03-01 or 2026-03-01T14:30Z") from None

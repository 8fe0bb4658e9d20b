"""Times of sessions and entries; a time without a zone is UTC."""

import re
from datetime import UTC, datetime, timedelta

_DAYS = re.compile(r"([+-]\d{1,5}) d")


def moment(text: str) -> datetime:
    """Parse an ISO 8601 time; without a zone it is UTC."""
    time = datetime.fromisoformat(text)
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def utc_time(text: str, where: str) -> str:
    """Write an ISO 8601 time as UTC with a ``Z``; raise ``ValueError`` if the text is not such a time."""
    try:
        return moment(text).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except ValueError:
        raise ValueError(f"{where}: got {text!r}, expected a time such as 2026-03-01 or 2026-03-01T14:30Z") from None


def corrected(start: str, stated: str, where: str) -> str:
    """Correct a start by what the fleet file states: a time, or days to add such as ``+365 d``."""
    if days := _DAYS.fullmatch(stated):
        return start and utc_time((moment(start) + timedelta(days=int(days[1]))).isoformat(), where)
    return utc_time(stated, where)

"""Origin of a recording: condition and session from its file's path, and when its log was started."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from unicodedata import category
from zoneinfo import ZoneInfo

import numpy as np

from cylinder_friction.recordings.recording import RecordingError


@dataclass(frozen=True)
class PathNames:
    """Name, condition, session, load and machine of a file's recording."""

    name: str
    condition: str
    session: str
    load: str = ""
    asset: str = ""


@dataclass(frozen=True)
class NameRules:
    """How a file's path below the source states condition and session.

    ``pattern`` is a regular expression with the group ``session`` and optionally ``condition`` (by default "1"),
    ``load`` and ``asset``. None makes each file a session of its own, named as its recording.
    """

    pattern: str | None = None

    def __post_init__(self) -> None:
        try:
            groups = re.compile(self.pattern or "").groupindex
        except re.error as error:
            raise RecordingError(f"name pattern {self.pattern!r} is not a regular expression: {error}") from None
        if self.pattern is not None and "session" not in groups:
            raise RecordingError(
                f"name pattern {self.pattern!r} has no group 'session'; write (?P<session>...) around the part of the "
                "path that names the session"
            )

    def names(self, relative_path: str) -> PathNames:
        """Find the names of a file by its path relative to the source, with ``/``.

        Raises:
            RecordingError: The pattern does not match, or the name is not allowed on other systems.
        """
        if "\\" in relative_path or {"Cc", "Cs"} & set(map(category, relative_path)):
            raise RecordingError(
                f"path {relative_path!r} holds a backslash, a control character or bytes that are not UTF-8; rename "
                "the file"
            )
        name = name_of(relative_path)
        if self.pattern is None:
            return PathNames(name, "1", name)
        match = re.search(self.pattern, relative_path)
        groups = {"condition": "1", **match.groupdict()} if match else {}
        if not groups.get("condition") or not groups.get("session"):
            raise RecordingError(
                f"path {relative_path!r} does not give condition and session: the pattern {self.pattern!r} finds "
                f"{'nothing in it' if match is None else groups}; rename the file, or change the "
                "pattern: name_pattern in the mapping, or --names"
            )
        return PathNames(name, *(groups.get(each) or "" for each in ("condition", "session", "load", "asset")))


def name_of(path: str) -> str:
    """Make a recording's name from its file's path: drop the last suffix and replace ``/`` by ``-``."""
    stem = path.rsplit(".", 1)[0] if "." in path.rsplit("/", 1)[-1] else path
    return stem.replace("/", "-")


@dataclass(frozen=True)
class Start:
    """When a log's clock was at 0 s."""

    at: np.datetime64  # Time to the nanosecond, or the day if no time of day is stated
    utc: bool  # Whether it is UTC; otherwise it is the time of the logger's clock, whose time zone is not stated
    source: str  # Its source, in words
    dated_rows: bool = False  # Whether every row is dated, also after a restart of the clock

    @property
    def day_only(self) -> bool:
        return np.datetime_data(self.at.dtype)[0] == "D"

    @classmethod
    def of_datetime(cls, moment: datetime, source: str) -> Start:
        """Make a start from a date with or without a time zone."""
        plain = moment if moment.tzinfo is None else moment.astimezone(UTC).replace(tzinfo=None)
        return cls(np.datetime64(plain, "ns"), moment.tzinfo is not None, source)

    def after(self, seconds: float) -> Start:
        """Return the start moved later by ``seconds``; a day without a time of day stays unchanged."""
        return self if self.day_only else replace(self, at=self.at + np.timedelta64(round(1e9 * seconds), "ns"))

    def text(self) -> str:
        """Format it in ISO 8601 to the millisecond, with Z if it is UTC; a day alone if only that is known."""
        return str(self.at) if self.day_only else f"{self.at.astype('datetime64[ms]')}{'Z' if self.utc else ''}"


@dataclass(frozen=True)
class StartRules:
    """A mapping's rules for the start of logs."""

    zone: str | None = None  # Time zone of the logger's clock, such as Europe/Oslo, if the logs state none

    def __post_init__(self) -> None:
        try:
            _ = self.zone is None or ZoneInfo(self.zone)
        except (KeyError, ValueError, OSError) as error:
            raise RecordingError(
                f"start: zone: got {self.zone!r}, expected a name of the time zone database such as Europe/Oslo"
            ) from error

    def in_utc(self, start: Start | None) -> Start | None:
        """Convert a start to UTC if the zone is known; a day, or an hour that was twice or never, stays unchanged."""
        if start is None or start.utc or self.zone is None or start.day_only:
            return start
        local, zone = start.at.astype("datetime64[us]").item(), ZoneInfo(self.zone)
        offsets = {local.replace(tzinfo=zone, fold=fold).utcoffset() for fold in (0, 1)}
        if len(offsets) > 1:
            return replace(start, source=f"{start.source}; in {self.zone} that hour was twice or never")
        at = start.at - np.timedelta64(offsets.pop(), "ns")
        return replace(start, at=at, utc=True, source=f"{start.source}, {self.zone}")

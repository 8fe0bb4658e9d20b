"""When a recording was made, and what states it: a log's header, its time stamps, its measurement file or its name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from zoneinfo import ZoneInfo

import numpy as np

from cylinder_friction.recordings.epochs import FILETIME, is_future
from cylinder_friction.recordings.recording import RecordingError

_KEY = re.compile(
    r"(?:(?:test|log|logging|recording|measurement|acquisition|mess|aufnahme|aufzeichnungs)?"
    r"(?:start|begin|beginn|date|datum|time|zeit|uhrzeit|timestamp|(?:start|date)(?:date|time|timestamp|zeit|datum)))"
    r"|started|recorded(?:at)?"
)
"""What precedes a start in a header, in small letters without anything else."""
_LINE = re.compile(r"^[\s#%;\"*/]*([^\W\d][^\d:=;,\t]*?)[\s\"]*[:=;,\t](.*)$")
_DATE = re.compile(r"(?<!\d)(?:(\d{4})([-/.])(\d\d?)\2(\d\d?)|(\d\d?)\.(\d\d?)\.(\d{4}))(?!\d)")
_CLOCK = re.compile(
    r"(?<!\d)(\d\d?):(\d\d)(?::(\d\d)(?:[.,;](\d{1,9})\d*)?)?\s*([AaPp][Mm])?\s*(Z\b|UTC|[+-]\d\d:?\d\d(?!\d))?"
)
START_PARTS = ("year", "month", "day", "hour", "minute", "second")


@dataclass(frozen=True)
class Start:
    """When a log's clock was at 0 s."""

    at: np.datetime64  # To the nanosecond, or the day where no time of day is stated
    utc: bool  # Whether that is UTC; otherwise it is what the logger's clock showed, whose time zone is not stated
    source: str  # What states it, in words
    dated_rows: bool = False  # Whether each row states it, also behind a restart of the clock

    @classmethod
    def of_filetime(cls, ticks: int, source: str) -> Start:
        """Return the start that Windows' FILETIME states, which is UTC."""
        return cls(FILETIME.stamps(np.array([ticks]))[0], True, source)

    @classmethod
    def of_datetime(cls, moment: datetime, source: str) -> Start:
        """Return the start of a date with or without a time zone."""
        plain = moment if moment.tzinfo is None else moment.astimezone(UTC).replace(tzinfo=None)
        return cls(np.datetime64(plain, "ns"), moment.tzinfo is not None, source)

    def after(self, seconds: float) -> Start:
        """Return the time this much later; a day stays what it is."""
        if np.datetime_data(self.at.dtype)[0] == "D":
            return self
        return replace(self, at=self.at + np.timedelta64(round(1e9 * seconds), "ns"))

    def text(self) -> str:
        """Return it in ISO 8601 to the millisecond, with Z if it is UTC; a day alone where only that is known."""
        if np.datetime_data(self.at.dtype)[0] == "D":
            return str(self.at)
        return f"{self.at.astype('datetime64[ms]')}{'Z' if self.utc else ''}"


def start_in_header(lines: list[str], delimiter: str) -> Start | None:
    """Return the start that the lines above a text table's rows state; None where no date can be read in one way only.

    Known are the FILETIME of the TwinCAT Scope, and lines such as ``Start time: 2026-03-27 10:15:00``, or a date and a
    time of day on lines of their own.
    """
    date = clock = where = None
    for line in lines:
        cells = line.split(delimiter) if delimiter != "whitespace" else [line]
        if cells[0].strip().casefold() == "starttime of export" and len(cells) > 1 and cells[1].strip().isdecimal():
            return Start.of_filetime(int(cells[1]), "FILETIME of the header")
        found = _LINE.match(line.rstrip())
        if found is None or not _KEY.fullmatch(re.sub(r"[\W_]", "", found[1]).casefold()):
            continue
        if date is None and (date := _DATE.search(found[2])):
            where = f"header line {line.strip()[:60]!r}"
        clock = clock or _CLOCK.search(found[2])
    if date is None:
        return None
    year, _, month, day, *others = date.groups()
    day, month, year = (day, month, year) if year else others
    parts: dict[str, str | None] = {"year": year, "month": month, "day": day}
    if clock is not None:
        hour, minute, second, fraction, half, zone = clock.groups()
        if half:
            hour = str(int(hour) % 12 + 12 * (half.casefold() == "pm"))
        parts |= {"hour": hour, "minute": minute, "second": second, "fraction": fraction, "zone": zone}
    return start_of_parts(parts, where or "")


def start_of_parts(parts: Mapping[str, str | None], source: str) -> Start | None:
    """Return the start of a date's parts; None if they are no date, as 31 February.

    Args:
        parts: Of ``START_PARTS``, with ``fraction`` (digits of a second) and ``zone``; a year may have two digits.
        source: What states them, in words.
    """
    year = int(parts["year"] or 0)
    date = f"{year + 2000 if year < 100 else year:04d}-{int(parts['month'] or 0):02d}-{int(parts['day'] or 0):02d}"
    try:
        if not parts.get("hour"):
            return Start(np.datetime64(date, "D"), False, f"{source}, a date without a time of day")
        clock = [int(parts.get(name) or 0) for name in START_PARTS[3:]]
        zone = (parts.get("zone") or "").replace("UTC", "Z")
        moment = datetime.fromisoformat(f"{date}T{clock[0]:02d}:{clock[1]:02d}:{clock[2]:02d}{zone}")
    except ValueError:
        return None
    start = Start.of_datetime(moment, source)
    return replace(start, at=start.at + np.timedelta64(int(f"{parts.get('fraction') or '0':0<9}"), "ns"))


@dataclass(frozen=True)
class StartRules:
    """What a mapping states about when logs were made."""

    zone: str | None = None  # Of the logger's clock, such as Europe/Oslo, where the logs state none
    # Regular expression on the path below the source with the groups ``year`` (two or four digits), ``month``, ``day``,
    # optionally ``hour``, ``minute`` and ``second``, for logs that state no start themselves
    pattern: str | None = None

    def __post_init__(self) -> None:
        _ = self._zone, self._pattern  # refuses what is wrong at once

    @cached_property
    def _zone(self) -> ZoneInfo | None:
        try:
            return None if self.zone is None else ZoneInfo(self.zone)
        except (KeyError, ValueError, OSError) as error:
            raise RecordingError(
                f"start: zone: got {self.zone!r}, expected a name of the time zone database such as Europe/Oslo"
            ) from error

    @cached_property
    def _pattern(self) -> re.Pattern[str] | None:
        try:
            compiled = None if self.pattern is None else re.compile(self.pattern)
        except re.error as error:
            raise RecordingError(f"start: pattern: {self.pattern!r} is not a regular expression: {error}") from None
        if compiled is not None and not {"year", "month", "day"} <= compiled.groupindex.keys() <= {*START_PARTS}:
            raise RecordingError(
                f"start: pattern: got groups {', '.join(compiled.groupindex) or 'none'}, expected year, month, day, "
                "and if you like hour, minute, second"
            )
        return compiled

    def of(self, stated: Start | None, relative_path: str) -> Start | None:
        """Return when a file's clock was at 0 s: as the file states it, else as its name does; in UTC if known."""
        start = stated or self._named(relative_path)
        if start is None or start.utc or self._zone is None or np.datetime_data(start.at.dtype)[0] == "D":
            return start
        local = start.at.astype("datetime64[us]").item()
        offsets = {local.replace(tzinfo=self._zone, fold=fold).utcoffset() for fold in (0, 1)}
        if len(offsets) > 1:
            return replace(start, source=f"{start.source}; in {self.zone} that hour was twice or never")
        return replace(
            start, at=start.at - np.timedelta64(offsets.pop(), "ns"), utc=True, source=f"{start.source}, {self.zone}"
        )

    def _named(self, path: str) -> Start | None:
        match = self._pattern.search(path) if self._pattern is not None else None
        start = None if match is None else start_of_parts(match.groupdict(), "file name")
        return None if start is None or is_future(start.at) else start

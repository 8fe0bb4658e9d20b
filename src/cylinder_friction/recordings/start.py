"""Date a log: find the epoch of its clock's numbers, its start, and the source of that start."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.recordings.recording import RecordingError

EARLIEST_S = 946_684_800
"""Earliest credible date of a log, the year 2000 [s since 1970]."""
LONGEST_STEP_S = 60.0
"""Longest credible time between two rows of a log [s]."""
NEVER_FALLS = 0.99
"""Least share of a clock's steps that do not fall."""


@dataclass(frozen=True)
class Epoch:
    """A way to write a date as one number."""

    unit: str  # Unit of the number, spelled as in ``units``
    unit_ns: int  # One unit [ns]
    of_1970: int  # Number of the first moment of 1970
    since: str  # Date that it counts from, for messages
    utc: bool  # Whether it is in UTC; otherwise it is local time

    @property
    def counted(self) -> str:
        """Description of what it counts."""
        return {"100ns": "ticks of 100 ns", "d": "days"}.get(self.unit, self.unit)

    def holds(self, number: float, latest_s: float) -> bool:
        """Check whether a number is a date between 2000 and ``latest_s`` [s since 1970]."""
        return EARLIEST_S < (number - self.of_1970) * self.unit_ns * 1e-9 < latest_s

    def stamps(self, numbers: NDArray[Any]) -> NDArray[np.datetime64]:
        """Convert numbers to ``datetime64[ns]``; NaN becomes NaT."""
        stamps = np.full(len(numbers), np.datetime64("NaT"), dtype="datetime64[ns]")
        known = np.isfinite(numbers)
        whole = np.floor(numbers[known]).astype(np.int64)  # separate, because a float cannot hold all digits
        parts = np.rint((numbers[known] - whole) * self.unit_ns).astype(np.int64)
        stamps[known] = ((whole - self.of_1970) * self.unit_ns + parts).astype("datetime64[ns]")
        return stamps


DAY_NS = 86_400 * 10**9
FILETIME = Epoch("100ns", 100, 116_444_736_000_000_000, "1601 (FILETIME)", True)
SECONDS_SINCE_1970 = Epoch("s", 10**9, 0, "1970", True)
EPOCHS = (
    FILETIME,
    Epoch("100ns", 100, 621_355_968_000_000_000, "the year 1 (.NET)", False),
    Epoch("d", DAY_NS, 25_569, "30 December 1899 (Excel)", False),
    Epoch("d", DAY_NS, 719_529, "the year 0 (MATLAB)", False),
    Epoch("s", 10**9, 2_082_844_800, "1904 (LabVIEW)", True),
    SECONDS_SINCE_1970,
    *(Epoch(unit, size, 0, "1970", True) for unit, size in (("ms", 10**6), ("us", 10**3), ("ns", 1))),
)
"""Epochs that are detected. No number is a date since 2000 in two of them."""
WINCC = Epoch("millionths of a day", DAY_NS // 10**6, 25_569 * 10**6, "30 December 1899 (WinCC)", False)


def is_future(moment: np.datetime64) -> bool:
    """Check whether a moment is later than tomorrow, so that no log can have been made then."""
    return bool(moment > np.datetime64(int(_tomorrow_s()), "s"))


def epoch_of(numbers: NDArray[Any], name: str = "") -> Epoch | None:
    """Find the epoch of a channel's numbers, shape ``(n,)``, also by its name; None if they are not dates."""
    known = numbers[np.isfinite(numbers)] if numbers.dtype.kind == "f" else numbers
    if numbers.dtype.kind not in "iuf" or len(known) < 3:
        return None
    latest_s, ends = _tomorrow_s(), (float(known[0]), float(known[-1]))
    epochs = (WINCC,) if name.casefold() == "time_ms" else EPOCHS
    found = next((each for each in epochs if all(each.holds(end, latest_s) for end in ends)), None)
    if found is None:
        return None
    steps = np.diff(known.astype(np.float64) - ends[0])
    mean_s = abs(ends[1] - ends[0]) / len(steps) * found.unit_ns * 1e-9
    runs = max((steps >= 0.0).mean(), (steps <= 0.0).mean()) >= NEVER_FALLS
    return found if runs and 0.0 < mean_s <= LONGEST_STEP_S else None


def _tomorrow_s() -> float:
    return (datetime.now(UTC) + timedelta(days=1)).timestamp()


_KEY = re.compile(
    r"(?:(?:test|log|logging|recording|measurement|acquisition|mess|aufnahme|aufzeichnungs)?"
    r"(?:start|begin|beginn|date|datum|time|zeit|uhrzeit|timestamp|(?:start|date)(?:date|time|timestamp|zeit|datum)))"
    r"|started|recorded(?:at)?"
)
"""Words before a start in a header, in lower case, letters only."""
_LINE = re.compile(r"^[\s#%;\"*/]*([^\W\d][^\d:=;,\t]*?)[\s\"]*[:=;,\t](.*)$")
_DATE = re.compile(r"(?<!\d)(?:(\d{4})([-/.])(\d\d?)\2(\d\d?)|(\d\d?)\.(\d\d?)\.(\d{4}))(?!\d)")
_CLOCK = re.compile(
    r"(?<!\d)(\d\d?):(\d\d)(?::(\d\d)(?:[.,;](\d{1,9})\d*)?)?\s*([AaPp][Mm])?\s*(Z\b|UTC|[+-]\d\d:?\d\d(?!\d))?"
)
START_PARTS = ("year", "month", "day", "hour", "minute", "second")


@dataclass(frozen=True)
class Start:
    """When a log's clock was at 0 s."""

    at: np.datetime64  # Time to the nanosecond, or the day if no time of day is stated
    utc: bool  # Whether it is UTC; otherwise it is the time of the logger's clock, whose time zone is not stated
    source: str  # Its source, in words
    dated_rows: bool = False  # Whether every row is dated, also after a restart of the clock

    @classmethod
    def of_filetime(cls, ticks: int, source: str) -> Start:
        """Make a start from a Windows FILETIME, which is UTC."""
        return cls(FILETIME.stamps(np.array([ticks]))[0], True, source)

    @classmethod
    def of_datetime(cls, moment: datetime, source: str) -> Start:
        """Make a start from a date with or without a time zone."""
        plain = moment if moment.tzinfo is None else moment.astimezone(UTC).replace(tzinfo=None)
        return cls(np.datetime64(plain, "ns"), moment.tzinfo is not None, source)

    def after(self, seconds: float) -> Start:
        """Return the start moved later by ``seconds``; a day without a time of day stays unchanged."""
        if np.datetime_data(self.at.dtype)[0] == "D":
            return self
        return replace(self, at=self.at + np.timedelta64(round(1e9 * seconds), "ns"))

    def text(self) -> str:
        """Format it in ISO 8601 to the millisecond, with Z if it is UTC; a day alone if only that is known."""
        if np.datetime_data(self.at.dtype)[0] == "D":
            return str(self.at)
        return f"{self.at.astype('datetime64[ms]')}{'Z' if self.utc else ''}"


def start_in_header(lines: list[str], delimiter: str) -> Start | None:
    """Read the start in the lines above a text table's rows; None without an unambiguous date.

    It reads the FILETIME of the TwinCAT Scope, lines such as ``Start time: 2026-03-27 10:15:00``, and a date and a time
    of day on separate lines.
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
    """Make a start from the parts of a date; None if they are no date, such as 31 February.

    Args:
        parts: Parts named in ``START_PARTS``, ``fraction`` (of a second) and ``zone``; a year may have two digits.
        source: Source of the date, in words.
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
    """A mapping's rules for the start of logs."""

    zone: str | None = None  # Time zone of the logger's clock, such as Europe/Oslo, if the logs state none
    # Regular expression for the path below the source, for logs without a start. Groups: ``year`` (two or four digits),
    # ``month``, ``day``, and optionally ``hour``, ``minute`` and ``second``
    pattern: str | None = None

    def __post_init__(self) -> None:
        try:
            _ = self.zone is None or ZoneInfo(self.zone)
        except (KeyError, ValueError, OSError) as error:
            raise RecordingError(
                f"start: zone: got {self.zone!r}, expected a name of the time zone database such as Europe/Oslo"
            ) from error
        try:
            groups = re.compile(self.pattern or "").groupindex
        except re.error as error:
            raise RecordingError(f"start: pattern: {self.pattern!r} is not a regular expression: {error}") from None
        if self.pattern is not None and not {"year", "month", "day"} <= groups.keys() <= {*START_PARTS}:
            raise RecordingError(
                f"start: pattern: got groups {', '.join(groups) or 'none'}, expected year, month, day, "
                "and if you like hour, minute, second"
            )

    def of(self, stated: Start | None, relative_path: str) -> Start | None:
        """Find when a file's clock was at 0 s: from the file, or else from its name; in UTC if the zone is known."""
        start = stated or self._named(relative_path)
        if start is None or start.utc or self.zone is None or np.datetime_data(start.at.dtype)[0] == "D":
            return start
        local, zone = start.at.astype("datetime64[us]").item(), ZoneInfo(self.zone)
        offsets = {local.replace(tzinfo=zone, fold=fold).utcoffset() for fold in (0, 1)}
        if len(offsets) > 1:
            return replace(start, source=f"{start.source}; in {self.zone} that hour was twice or never")
        at = start.at - np.timedelta64(offsets.pop(), "ns")
        return replace(start, at=at, utc=True, source=f"{start.source}, {self.zone}")

    def _named(self, path: str) -> Start | None:
        match = None if self.pattern is None else re.search(self.pattern, path)
        start = None if match is None else start_of_parts(match.groupdict(), "file name")
        return None if start is None or is_future(start.at) else start

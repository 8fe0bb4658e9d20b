"""Read the cells of tables and headers: numbers, dates, times of day, and clocks that two columns or a count make."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.format import Column, LoggedTable
from cylinder_friction.recordings.mapping.channel_mapping import conversion, names_a_unit
from cylinder_friction.recordings.mapping.channel_words import words_of
from cylinder_friction.recordings.recording import Start
from cylinder_friction.recordings.timeline.timestamps import LATEST_S

_NO_SAMPLE = "nan NaN NAN -nan -NaN NA N/A n/a null NULL Null None - -- --- #N/A #NV Bad EOF"
_NAN_OF_WINDOWS = "nan(ind) -nan(ind) 1.#IND -1.#IND 1.#QNAN -1.#QNAN"
MISSING = ("", "No Data", "Bad Input", *_NO_SAMPLE.split(), *_NAN_OF_WINDOWS.split())
"""Cells of a missing sample. ``Bad`` is a quality of OPC, ``EOF`` is written below a column that ends before others."""
OVER_RANGE = r"[+-]?(?:∞|ol|over(?:load|flow|range)?)|[+]{5,6}|-{5,6}|[*]{5,6}"
"""Cells of a value beyond the range of the logger's input, in upper or lower case."""

POINT_NUMBER, COMMA_NUMBER = (
    rf"[+-]? *(?:\d{{1,3}}(?:{other}\d{{3}})+{sign}\d*|\d+{sign}?\d*|{sign}\d+)(?:(?:[eE][+-]?|[dD][+-])\d+)?"
    for sign, other in ((r"\.", ","), (",", r"\."))
)
"""Numbers with either decimal sign. If the other sign separates thousands, a decimal sign shows that it does."""

_MISSING, _OVER_RANGE = frozenset(MISSING), re.compile(OVER_RANGE, re.IGNORECASE)
_FORMS = {".": POINT_NUMBER, ",": COMMA_NUMBER, None: f"{POINT_NUMBER}|{COMMA_NUMBER}"}
_NUMBERS = {sign: re.compile(rf"{form}|[+-]?inf(?:inity)?", re.IGNORECASE) for sign, form in _FORMS.items()}
DATE = r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}[- ][A-Za-z]{3}[- ](?:\d{4}|\d{2}))"
TIME_OF_DAY = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,:;]\d{1,9})?|[.,]\d{1,9})?(?: ?[AaPp][Mm])?"
ZONE = r"(?:Z|[+-]\d{2}:?\d{2}|(?:UTC|GMT)(?:[+-]\d{1,2}(?::?\d{2})?)?)"
_CLOCK_PARTS = r"(?P<H>\d{1,2}):(?P<M>\d{2})(?::(?P<S>\d{2})(?:[.,:;](?P<f>\d{1,9}))?)?\s*(?P<half>[AaPp][Mm])?"
_TIME_OF_DAY = f"^{_CLOCK_PARTS}$"
_MINUTES = r"^(?P<M>\d{1,2}):(?P<S>\d{2})[.,](?P<f>\d{1,9})$"  # as Excel shows a time of day: mm:ss.0
_WITH_UNIT = r"^(?P<number>[+-]?[\d.,eE+-]*\d)\s*(?P<unit>[^\d\s.,:;+-][^\d\s:]*)$"
_REST = rf"(?:[T ,]+{_CLOCK_PARTS})?\s*(?P<zone>{ZONE}|[A-Z]{{2,5}})?$"
_YEAR_FIRST = r"^(?P<Y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})" + _REST
_BASIC = r"^(?P<Y>\d{4})(?P<m>\d\d)(?P<d>\d\d)[T_ ]?(?P<H>\d\d)(?P<M>\d\d)(?P<S>\d\d)[.,]?(?P<f>\d{0,9})(?P<zone>Z?)$"
_DOTS = r"^(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<Y>\d{4})" + _REST
_EITHER = r"^(?P<d>\d{1,2})[-/](?P<m>\d{1,2})[-/](?P<Y>\d{4})" + _REST
_SHORT_YEAR = r"^'?(?P<d>\d{1,2})[-/.](?P<m>\d{1,2})[-/.](?P<Y>\d{2})" + _REST
_NAMED_MONTH = r"^(?P<d>\d{1,2})[- ](?P<m>[A-Za-z]{3})[- ](?P<Y>\d{4}|\d{2})" + _REST
_STAMPS = (_TIME_OF_DAY, _MINUTES, _YEAR_FIRST, _BASIC, _DOTS, _EITHER, _SHORT_YEAR, _NAMED_MONTH)
_STAMP = re.compile(re.sub(r"\?P<\w+>", "?:", "|".join(_STAMPS)))
_MONTHS = pa.array(["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"])
_HALF_DAYS = pa.array([f"{hour or 12:02d}{half}" for half in ("am", "pm") for hour in range(12)])


def is_missing(cell: str) -> bool:
    return cell in _MISSING or _OVER_RANGE.fullmatch(cell) is not None


def is_number(cell: str, decimal: str | None) -> bool:
    """Check whether a cell is a number with this decimal sign; None allows point and comma."""
    return bool(_NUMBERS[decimal].fullmatch(cell))


def is_value(cell: str, decimal: str | None) -> bool:
    """Check whether a cell is a number, a date or a time of day."""
    return bool(_NUMBERS[decimal].fullmatch(cell) or _STAMP.fullmatch(cell))


class CellValues(NamedTuple):
    """The values of a column."""

    values: NDArray[Any]  # Numbers, dates, or numbers and text, shape ``(n,)``
    unit: str = ""  # Unit that every cell states; ``s`` for times of day, which are seconds since midnight
    clock_s: int = 0  # Period of a clock: a day for times of day, an hour for minutes and seconds; 0 for other values
    utc: bool = False  # Whether every date states its time zone
    note: str = ""  # Which cells were read as missing


def column_values(column: Any, decimal: str | None, name: str) -> CellValues:
    """Read an Arrow column; a null becomes NaN or NaT, a date ``datetime64[ns]`` (in UTC if it has a time zone)."""
    kind, types = column.type, pa.types
    if types.is_dictionary(kind):
        return column_values(column.cast(kind.value_type), decimal, name)
    if types.is_null(kind):
        return CellValues(np.full(len(column), np.nan))
    if types.is_time(kind) or types.is_duration(kind):
        clock = bool(types.is_time(kind))
        nanoseconds = column.cast(pa.time64("ns") if clock else pa.duration("ns")).cast(pa.int64())
        seconds = pc.divide(nanoseconds.cast(pa.float64()), 1e9).to_numpy()
        return CellValues(seconds, "s" if clock else "", DAY_S * clock)
    utc = types.is_timestamp(kind) and kind.tz is not None
    if types.is_temporal(kind):
        column = column.cast(pa.timestamp("ns"))
    elif types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif not (types.is_integer(kind) or types.is_floating(kind)):
        return _text_values(column, decimal, name)
    dated = types.is_integer(kind) and len(column) and re.match(_BASIC, str(column[0]))
    dates = stamps_of(column.cast(pa.string()), name) if dated else None  # such as 20260314081500000
    return dates or CellValues(np.asarray(column.to_numpy()), utc=utc)


def _text_values(column: Any, decimal: str | None, name: str) -> CellValues:
    """Read a text column as numbers (``7.2``, ``+  7.2``, ``7.2 bar``), dates or times of day; else keep the text.

    If the decimal sign is a comma, a cell with only a point stays text, because the point may separate thousands. Cells
    that mark a value beyond the range become missing samples.
    """
    text = pc.utf8_trim_whitespace(column.cast(pa.string()))
    text = pc.if_else(pc.is_in(text, pa.array(MISSING)), None, text)
    if text.null_count == len(text):
        return CellValues(np.full(len(text), np.nan))
    if decimal is None:  # the first rows have whole numbers
        decimal = "," if pc.all(pc.match_substring_regex(text, f"^(?:{COMMA_NUMBER})$")).as_py() else "."
    form = f"^(?:{COMMA_NUMBER if decimal == ',' else POINT_NUMBER})$"
    number, note = pc.match_substring_regex(text, form), ""
    if pc.any(number).as_py():
        over = pc.fill_null(pc.match_substring_regex(text, f"^(?:{OVER_RANGE})$", ignore_case=True), False)
        if count := pc.sum(over).as_py():
            cells = f"{count} cell{'' if count == 1 else 's'} of {name!r} with {text.filter(over)[0].as_py()!r}"
            note = f"{cells}, beyond the range of the input, taken as missing"
        return CellValues(_numbers(pc.if_else(over, None, text), number, decimal), note=note)
    if (stamps := stamps_of(text, name)) is not None:
        return stamps
    if (parts := _fields(text, _WITH_UNIT)) is not None:
        units = pc.unique(parts["unit"].drop_null()).to_pylist()
        values = _numbers(parts["number"], pc.match_substring_regex(parts["number"], form), decimal)
        if len(units) == 1 and names_a_unit(units[0]) and values.dtype.kind == "f":
            return CellValues(values, units[0])
    return CellValues(_numbers(text, number, decimal))


def _numbers(text: Any, number: Any, decimal: str) -> NDArray[Any]:
    """Convert the cells that match ``number``, and keep the others as text; a null becomes NaN."""
    thousands = "." if decimal == "," else ","
    plain = pc.replace_substring_regex(pc.if_else(number, text, None), rf"^\+|[ {thousands}]", "")
    plain = pc.replace_substring_regex(pc.replace_substring(plain, ",", "."), "[dD]", "e")  # Fortran's exponents
    numbers: NDArray[Any] = plain.cast(pa.float64()).to_numpy()
    words = pc.and_(pc.fill_null(pc.invert(number), False), text.is_valid()).to_numpy()
    if not words.any():
        return numbers
    mixed = numbers.astype(object)
    mixed[words] = text.filter(pa.array(words)).to_pylist()
    return mixed


def stamps_of(text: Any, name: str) -> CellValues | None:
    """Convert dates to ``datetime64[ns]``, and times of day or minutes and seconds (15:00.1) to seconds.

    None for cells of any other form. In dates with dots the day comes first; with slashes, the first row that can only
    be read one way decides. Stamps with a time zone are converted to UTC; letters such as CET name none for certain.
    """
    for pattern in _STAMPS:
        if (found := _fields(text, pattern)) is None:
            continue
        fields = {"Y": "1970", "m": "1", "d": "1", "H": "0", "half": "", "zone": "", **found}
        note, first = "", "year" if pattern == _SHORT_YEAR else ""
        if pattern == _EITHER:
            month_first = _month_first(fields)
            first = "month" if month_first is None else ""
            fields["d"], fields["m"] = (fields["m"], fields["d"]) if month_first else (fields["d"], fields["m"])
        elif pattern == _NAMED_MONTH:
            fields["Y"] = pc.replace_substring_regex(fields["Y"], "^(..)$", r"20\1")
            fields["m"] = pc.add(pc.index_in(pc.utf8_lower(fields["m"]), _MONTHS), 1).cast(pa.string())
        zones = set(pc.unique(found["zone"]).drop_null().to_pylist()) if "zone" in found else set()
        if first:
            ways = f"the day or the {first} first; they, and the start, are left out"
            note = f"time: the dates of {name!r} may have {ways}"
            fields |= {"Y": "1970", "m": "1", "d": "1", "zone": ""}
        elif letters := [zone for zone in zones if zone and not re.fullmatch(ZONE, zone)]:
            if len(zones) > 1:
                return None
            note = f"time: {letters[0]} in {name!r} names no time zone for certain; state start.zone in the mapping"
            fields["zone"] = ""
        stamps = _instants(fields)
        if stamps is None:
            return None
        if "Y" not in found or first:
            seconds = stamps.cast(pa.int64()).to_numpy() / 1e9
            return CellValues(seconds, "s", HOUR_S if pattern == _MINUTES else DAY_S, note=note)
        zoned = bool(pc.all(pc.not_equal(fields["zone"], "")).as_py())
        return CellValues(stamps.cast(pa.timestamp("ns")).to_numpy(), utc=zoned, note=note)
    return None


def _fields(text: Any, pattern: str) -> dict[str, Any] | None:
    """Split cells into the groups of a pattern; None if a cell does not match."""
    parts = pc.extract_regex(text, pattern=pattern)
    if parts.null_count > text.null_count:
        return None
    return {field.name: pc.struct_field(parts, field.name) for field in parts.type}


def _month_first(fields: dict[str, Any]) -> bool | None:
    """Decide whether dates such as 01/02/2026 begin with the month, as those with AM or PM do; None if unknown."""
    first, second = (fields[key].cast(pa.int64()) for key in ("d", "m"))
    if pc.any(pc.greater(first, 12)).as_py() or pc.all(pc.equal(first, second)).as_py():
        return False
    return pc.any(pc.greater(second, 12)).as_py() or pc.any(pc.not_equal(fields["half"], "")).as_py() or None


def _instants(fields: dict[str, Any]) -> Any | None:
    """Parse the fields as ISO 8601 and return instants in UTC; None if a cell is no date or time of day."""
    year, month, day, hour, minute, second = (pc.utf8_lpad(fields[key], 2, "0") for key in "YmdHMS")
    half = pc.utf8_lower(fields["half"])
    on_clock = pc.index_in(pc.binary_join_element_wise(hour, half, ""), _HALF_DAYS).cast(pa.string())
    hour = pc.utf8_lpad(pc.if_else(pc.equal(half, ""), hour, on_clock), 2, "0")
    date = pc.binary_join_element_wise(year, month, day, "-")
    second = pc.binary_join_element_wise(second, pc.utf8_rpad(fields["f"], 9, "0"), ".")
    clock = pc.binary_join_element_wise(hour, minute, second, ":")
    zone = pc.replace_substring_regex(fields["zone"], "^(UTC|GMT)", "")  # UTC+1 becomes +01
    zone = pc.replace_substring_regex(zone, r"^([+-])(\d)(:|$)", r"\10\2\3")
    zone = pc.if_else(pc.equal(zone, ""), "Z", zone)
    iso = pc.binary_join_element_wise(pc.binary_join_element_wise(date, clock, "T"), zone, "")
    if iso.null_count > fields["M"].null_count:
        return None
    try:
        return iso.cast(pa.timestamp("ns", "UTC"))
    except pa.ArrowInvalid:
        return None


_KEY = re.compile(
    r"(?:(?:test|log|logging|recording|measurement|acquisition|mess|aufnahme|aufzeichnungs)?"
    r"(?:start|begin|beginn|date|datum|time|zeit|uhrzeit|timestamp|(?:start|date)(?:date|time|timestamp|zeit|datum)))"
    r"|started|recorded(?:at)?|starttimeofexport|t0"
)
"""Words before a start in a header, in lower case, letters only."""
_LINE = re.compile(r"^[\s#%;\"*/]*(T0|[^\W\d][^\d:=;,\t]*?)[\s\"]*[:=;,\t](.*)$")
_SPAN = re.compile(r"(test|log|logging|recording|measurement|acquisition|mess|aufnahme|aufzeichnungs)(time|zeit)")
"""Words before a duration, or before a time of day if the date has the same first word."""
_DATE = re.compile(rf"(?<!\d){DATE}(?!\d)")
_AMID = re.compile(rf"\b(?:log|sec)\s+(?={DATE} \d)", re.IGNORECASE)
"""Before a start within a line: PuTTY log 2026.03.14 08:15; Time: 1.5 Sec 3/14/2026."""
_COUNT = re.compile(r"[=\s\"]*(\d{5,18}(?:[.,]\d+)?)(?![\w.:/-]|,\d)")
_CLOCK = re.compile(rf"(?<!\d)(?P<time>{TIME_OF_DAY})(?: ?(?P<zone>{ZONE}))?(?: ?(?P<letters>[A-Z]{{2,4}}[TZ])\b)?")


def start_in_header(lines: list[str]) -> Start | None:
    """Read the start in the lines above a text table's rows; None without an unambiguous date.

    It reads ``Start time: 2026-03-27 10:15:00``, a date and a time of day on separate lines, and numbers: FILETIME,
    seconds since 1970, days of Excel (with a fraction). 00:00:00 is a date alone, as spreadsheets write it.
    """
    stated = list[tuple[str, str, str]]()
    for line in lines:
        found = _LINE.match(line.rstrip())
        name, _, zone = found[1].partition("(") if found else ("", "", "")  # Start time (UTC)
        if found and _KEY.fullmatch(key := re.sub(r"[\W_]", "", name).casefold()):
            utc = " UTC" if zone.upper().startswith(("UTC", "GMT")) else ""
            stated.append((key, re.sub("[()]", "", found[2]) + utc, f"header line {line.strip()[:60]!r}"))
        elif amid := _AMID.search(line):
            stated.append(("start", line[amid.end() :], f"header line {line.strip()[:60]!r}"))
    for key, text, where in stated:
        if count := _COUNT.match(text):
            number = int(count[1]) if count[1].isdecimal() else float(count[1].replace(",", "."))
            epoch = _epoch([number], EPOCHS)
            if epoch and (epoch.unit_ns < DAY_NS or (isinstance(number, float) and re.search("start|begin|dat", key))):
                return Start(epoch.stamps(np.array([number]))[0], epoch.utc, where)
    dated = next(((date[0], *each) for each in stated if (date := _DATE.search(each[1]))), None)
    if dated is None:
        return None
    day, key, own, where = dated
    others = (text for word, text, _ in stated if not (span := _SPAN.fullmatch(word)) or key.startswith(span[1]))
    clocks = (clock for text in (own, *others) if (clock := _CLOCK.search(text)) and clock[0].strip("0:.,"))
    of_day, zone, letters = clock.groups("") if (clock := next(clocks, None)) else ("00:00", "", "")
    stamps = stamps_of(pa.array([f"{day} {of_day} {zone}", f"{day} 00:00 {zone}"]), where)
    if stamps is None or stamps.clock_s or stamps.values[0] < np.datetime64(EARLIEST_S, "s"):
        return None
    unsaid = f", whose time zone {letters} is not known" if letters else ", a date without a time of day"
    at = stamps.values[0] if clock else stamps.values[0].astype("datetime64[D]")
    return Start(at, stamps.utc, where if clock and not letters else where + unsaid, midnight=stamps.values[1])


EARLIEST_S = 946_684_800  # Earliest credible date of a log, the year 2000 [s since 1970]
LONGEST_STEP_S, LONGEST_OF_DAYS_S = 60.0, 1.0
"""Longest credible time between two rows of a log [s]; if days are counted, which may be seconds of a faster log."""
NEVER_FALLS = 0.99  # Least share of a clock's steps that do not fall


@dataclass(frozen=True)
class Epoch:
    """A way to write a date as one number."""

    counted: str  # What the number counts, in words
    unit_ns: int  # One unit [ns]
    of_1970: int  # Number of the first moment of 1970
    since: str  # Date that it counts from, for messages
    utc: bool  # Whether it is in UTC; otherwise it is local time

    def stamps(self, numbers: NDArray[Any]) -> NDArray[np.datetime64]:
        """Convert numbers to ``datetime64[ns]``; NaN becomes NaT."""
        stamps = np.full(len(numbers), np.datetime64("NaT"), dtype="datetime64[ns]")
        known = np.isfinite(numbers)
        whole = np.floor(numbers[known]).astype(np.int64)  # separate, because a float cannot hold all digits
        parts = np.rint((numbers[known] - whole) * self.unit_ns).astype(np.int64)
        stamps[known] = ((whole - self.of_1970) * self.unit_ns + parts).astype("datetime64[ns]")
        return stamps


MINUTE_S, HOUR_S, DAY_S = 60, 3_600, 86_400
DAY_NS = DAY_S * 10**9
FILETIME = Epoch("ticks of 100 ns", 100, 116_444_736_000_000_000, "1601 (FILETIME)", True)
EPOCHS = (
    FILETIME,
    Epoch("ticks of 100 ns", 100, 621_355_968_000_000_000, "the year 1 (.NET)", False),
    Epoch("days", DAY_NS, 25_569, "30 December 1899 (Excel)", False),
    Epoch("days", DAY_NS, 719_529, "the year 0 (MATLAB)", False),
    Epoch("s", 10**9, 2_082_844_800, "1904 (LabVIEW)", True),
    *(Epoch(unit, size, 0, "1970", True) for unit, size in (("s", 10**9), ("ms", 10**6), ("us", 10**3), ("ns", 1))),
)
"""Epochs that are detected. No number is a date since 2000 in two of them."""
WINCC = Epoch("millionths of a day", DAY_NS // 10**6, 25_569 * 10**6, "30 December 1899 (WinCC)", False)


def is_future(moment: np.datetime64) -> bool:
    """Check whether a moment is later than tomorrow, so that no log can have been made then."""
    return bool(moment > np.datetime64("now") + np.timedelta64(1, "D"))


def _epoch(numbers: Sequence[float], epochs: Iterable[Epoch]) -> Epoch | None:
    """Find the epoch in which all numbers are dates between 2000 and tomorrow."""
    times = ((each, [(number - each.of_1970) * each.unit_ns * 1e-9 for number in numbers]) for each in epochs)
    latest_s = time.time() + DAY_S
    return next((each for each, own in times if EARLIEST_S < min(own) <= max(own) < latest_s), None)


def epoch_of(numbers: NDArray[Any], name: str = "") -> Epoch | None:
    """Find the epoch of a channel's numbers, shape ``(n,)``, also by its name; None if they are not dates."""
    known = numbers[np.isfinite(numbers)] if numbers.dtype.kind == "f" else numbers
    if numbers.dtype.kind not in "iuf" or len(known) < 3:
        return None
    ends = float(known[0]), float(known[-1])
    found = _epoch(ends, (*EPOCHS, WINCC) if name.casefold() == "time_ms" else EPOCHS)
    if found is None:
        return None
    mean_s = abs(ends[1] - ends[0]) / (len(known) - 1) * found.unit_ns * 1e-9
    longest_s = LONGEST_OF_DAYS_S if found.unit_ns == DAY_NS else LONGEST_STEP_S
    return found if way_of(known) and 0.0 < mean_s <= longest_s else None


FEWEST_ROWS = 20  # Fewest rows that show an order; in fewer, the order may be chance


def _part_ns(name: str) -> int:
    """Return the unit of a part of the second of a stamp beside it [ns], if a column's name states one; else 0."""
    scale_s, _ = conversion(words_of(name).unit, "time") or (0.0, 0.0)
    return round(1e9 * scale_s) if scale_s in (1e-3, 1e-6, 1e-9) else 0


def names_to_read(names: Iterable[str], wanted: Collection[str] | None) -> set[str]:
    """Choose the channels of a table to read: those wanted (None: all), and with them all that may be time."""
    there = set(names)
    if wanted is None or there.isdisjoint(wanted):
        return there if wanted is None else set()
    clocks = {name for name in there if words_of(name).quantity == "time" or _part_ns(name)}
    return clocks | there.intersection(wanted)


class Columns(NamedTuple):
    """The content of Arrow columns."""

    columns: list[Column]
    units: dict[str, str]  # Units that their cells state, by name
    notes: list[str]
    utc: bool  # Whether time stamps state their time zone
    clocks: dict[str, int]  # Periods of times of day [s], by name


def columns_of(named: Iterable[tuple[str, Any]], decimal: str | None, wanted: Collection[str] | None) -> Columns:
    """Read named Arrow columns; join date and time of day."""
    read = [(name, column_values(column, decimal, name)) for name, column in named]
    clocks = {name: cells.clock_s for name, cells in read if cells.clock_s}
    units = {name: cells.unit for name, cells in read if cells.unit}
    notes = [cells.note for _, cells in read if cells.note]
    columns: list[Column] = [(name, cells.values) for name, cells in read]
    found = dict(columns)
    days = [name for name, values in columns if values.dtype.kind == "M" and _known(values, DAY_S)]
    if len(days) == 1 and len(own := [name for name, _ in columns if name in clocks]) == 1:
        (day,), (clock,) = days, own
        dated = found[day] + pd.to_timedelta(found[clock], unit="s").to_numpy()
        kept, joined = (day, clock) if wanted and day in wanted and clock not in wanted else (clock, day)
        columns = [(name, dated if name == kept else own) for name, own in columns if name != joined]
    return Columns(columns, units, notes, any(cells.utc for _, cells in read), clocks)


def _with_parts(table: LoggedTable, wanted: Collection[str]) -> LoggedTable:
    """Join stamps of whole seconds (dates or numbers) with the part of the second in another column."""
    names = [str(name) for name in table.channels.columns[~table.channels.columns.duplicated(keep=False)]]
    numbers = {name: table.channels[name].to_numpy() for name in names if _part_ns(name) and name not in wanted}
    parts = {
        name: own.astype(np.int64) * _part_ns(name)
        for name, own in numbers.items()
        if own.dtype.kind in "iuf" and ((own >= 0) & (own < 1e9 / _part_ns(name)) & (own % 1 == 0)).all()
    }
    if len(parts) != 1:
        return table
    ((part, late_ns),) = parts.items()
    whole = [name for name in names if name != part and _whole_seconds(table, name, late_ns)]
    if len(whole) != 1:
        return table
    seconds = table.channels[whole[0]].to_numpy()
    dated = seconds.dtype.kind == "M"
    stamps = seconds + (late_ns.astype("timedelta64[ns]") if dated else 1e-9 * late_ns)
    joined, units = table.channels.assign(**{whole[0]: stamps}).drop(columns=part), {} if dated else {whole[0]: "s"}
    return replace(table, channels=joined, units={**table.units, **units}) if way_of(stamps) else table


def _whole_seconds(table: LoggedTable, name: str, late_ns: NDArray[np.int64]) -> bool:
    """Check whether a column counts whole seconds; without a unit, it must step exactly where the part wraps."""
    stamps, unit = table.channels[name].to_numpy(), table.units.get(name) or words_of(name).unit
    if stamps.dtype.kind not in "Miuf" or not _known(stamps, 1) or _known(stamps, DAY_S):
        return False
    bare = not unit and words_of(name).quantity == "time"
    in_step = bare and (anew := np.diff(late_ns) < 0).any() and np.array_equal(np.diff(stamps) > 0, anew)
    return bool(stamps.dtype.kind == "M" or conversion(unit, "time") == (1.0, 0.0) or in_step)


def on_its_day(found: Columns, start: Start | None, dated: Collection[str] | None) -> Columns:
    """Date times of day, past midnight too, if a header states the day; ``dated`` names them if they are known.

    Times that begin in the first minute are durations. Numbers, or minutes and seconds, are times of day only if they
    begin within a minute of the start.
    """
    if start is None or start.midnight is None:
        return found
    columns, utc, stated_s = list[Column](), found.utc, (start.at - start.midnight) / np.timedelta64(1, "s")
    for name, values in found.columns:
        period_s = found.clocks.get(name, DAY_S)
        if values.dtype.kind in "iuf" and (name in found.clocks or words_of(name).quantity == "time"):
            first_s, hour_s = next(iter(values[np.isfinite(values)]), 0.0), stated_s // period_s * period_s
            near = found.clocks.get(name) == DAY_S or abs(first_s + hour_s - stated_s) < MINUTE_S
            if near and first_s >= MINUTE_S if dated is None else name in dated:
                since_s = hour_s + first_s + (values - first_s + period_s / 4) % period_s - period_s / 4
                values, utc = start.midnight + pd.to_timedelta(since_s, unit="s").to_numpy(), start.utc
        columns.append((name, values))
    return found._replace(columns=columns, utc=utc)


def _known(stamps: NDArray[Any], step_s: int) -> bool:
    """Check whether there are stamps and all of them are multiples of ``step_s``."""
    known = stamps[np.isfinite(stamps)]
    numbers, unit = (known.astype(np.int64), 10**9) if known.dtype.kind == "M" else (known, 1)
    return len(known) > 0 and not (numbers % (step_s * unit)).any()


def with_dates(table: LoggedTable, stated: Mapping[str, str]) -> LoggedTable:
    """Convert a table's numbers of days, seconds or ticks since a known date to dates, and note which.

    Parts of a second complete whole seconds. Numbers with another unit of time, ``stated`` by a mapping or by the file,
    stay numbers if they are credible in it.
    """
    dates: dict[str, NDArray[Any]] = {}
    notes, utc = [], table.utc
    for name, values in table.channels.items():
        name, numbers = str(name), values.to_numpy()
        epoch = epoch_of(numbers, name)
        if epoch is None or (table.channels.columns == name).sum() > 1:
            continue
        counted_s = 1e-9 * epoch.unit_ns
        unit_s, _ = conversion(stated.get(name) or table.units.get(name, ""), "time") or (counted_s, 0.0)
        if epoch is not WINCC and not math.isclose(unit_s, counted_s) and abs(float(numbers[0])) * unit_s < LATEST_S:
            continue
        dates[name], utc = epoch.stamps(numbers), utc or epoch.utc
        notes.append(f"time: {name!r} counts {epoch.counted} since {epoch.since}")
    if dates:
        units, notes = {name: unit for name, unit in table.units.items() if name not in dates}, [*table.notes, *notes]
        table = replace(table, channels=table.channels.assign(**dates), units=units, utc=utc, notes=tuple(notes))
    return _with_parts(table, stated)


def oldest_first(table: LoggedTable) -> LoggedTable:
    """Reverse a table whose column of dates, or named time, falls while none rises, and add a note."""
    ways = [
        way_of(values.to_numpy())
        for name, values in table.channels.items()
        if words_of(str(name)).quantity == "time" and values.dtype.kind in "Miuf"
    ]
    if len(table.channels) < FEWEST_ROWS or -1 not in ways or 1 in ways:
        return table
    turned = table.channels.iloc[::-1].reset_index(drop=True)
    return replace(table, channels=turned, notes=(*table.notes, "its newest row comes first; turned round"))


def way_of(values: NDArray[Any]) -> int:
    """Return 1 if values hardly ever fall, -1 if they hardly ever rise, else 0, also if they are constant."""
    known = values[~pd.isna(values)]
    steps = np.diff(known.astype(np.int64) if known.dtype.kind in "Miu" else known)
    rises, falls = ((way * steps > 0).any() and (way * steps >= 0).mean() >= NEVER_FALLS for way in (1, -1))
    return int(rises) - int(falls)

"""Parse the cells of text tables, singly and by column: numbers, loggers' dates, missing values, or words."""

import csv
import re
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.mapping.units import names_a_unit
from cylinder_friction.recordings.recording import RecordingError

MISSING = (
    "", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "null", "NULL", "Null", "None", "-", "--", "---",
    "#N/A", "#NV", "nan(ind)", "-nan(ind)", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN", "EOF",
)  # fmt: skip
"""Cells of a missing sample. C libraries on Windows print NaN as ``1.#IND`` and the like. ``EOF`` is written below a
column that ends before others."""

OVER_RANGE = (
    "∞", "+∞", "-∞", "OL", "+OL", "-OL", "OVER", "+OVER", "-OVER", "Over", "OVERLOAD", "Overload", "overload",
    "OVERFLOW", "Overflow", "OVERRANGE", "Overrange", "+++++", "++++++", "-----", "------", "*****", "******",
)  # fmt: skip
"""Cells of a value beyond the range of the logger's input."""

POINT_NUMBER = r"[+-]? *(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
COMMA_NUMBER = r"[+-]? *(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?"

_MISSING_OR_OVER = frozenset((*MISSING, *OVER_RANGE))
_FORMS = {".": POINT_NUMBER, ",": COMMA_NUMBER, None: f"{POINT_NUMBER}|{COMMA_NUMBER}"}
_NUMBERS = {sign: re.compile(rf"{form}|[+-]?inf(?:inity)?", re.IGNORECASE) for sign, form in _FORMS.items()}
_DATE = r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}-[A-Za-z]{3}-(?:\d{4}|\d{2}))"
_CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,:;]\d{1,9})?|[.,]\d{1,9})?(?: ?[AaPp][Mm])?(?:Z|[+-]\d{2}:?\d{2})?"
_DATE_OR_CLOCK = re.compile(rf"{_DATE}(?:[T ,]+{_CLOCK})?|{_CLOCK}")
_TOKEN = re.compile(r'"[^"]*"|\S+(?:[ \t]+(?:\[[^\]]*\]|\([^)]*\)))?')


def is_missing(cell: str) -> bool:
    return cell in _MISSING_OR_OVER


def is_number(cell: str, decimal: str | None) -> bool:
    """Check whether a cell is a number with this decimal sign; None allows point and comma."""
    return bool(_NUMBERS[decimal].fullmatch(cell))


def is_value(cell: str, decimal: str | None) -> bool:
    """Check whether a cell is a number, a date or a time of day."""
    return bool(_NUMBERS[decimal].fullmatch(cell) or _DATE_OR_CLOCK.fullmatch(cell))


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, and strip blanks and quotation marks.

    With the delimiter ``whitespace``, a unit in brackets stays with the name before it.
    """
    line = line.rstrip("\r\n")
    if delimiter == "whitespace":
        return [token.strip('"') for token in _TOKEN.findall(line)]
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return [cell.strip() for cell in line.split(delimiter)]


_CLOCK_PARTS = r"(?P<H>\d{1,2}):(?P<M>\d{2})(?::(?P<S>\d{2})(?:[.,:;](?P<f>\d{1,9}))?)?\s*(?P<half>[AaPp][Mm])?"
_MINUTES = r"^(?P<M>\d{1,2}):(?P<S>\d{2})[.,](?P<f>\d{1,9})$"  # as Excel shows a time of day: mm:ss.0
_WITH_UNIT = r"^(?P<number>[+-]?[\d.,eE+-]*\d)\s*(?P<unit>[^\d\s.,:;+-][^\d\s:]*)$"
_REST = rf"(?:[T ,]+{_CLOCK_PARTS})?\s*(?P<zone>Z|[+-]\d{{2}}:?\d{{2}})?$"
_YEAR_FIRST = r"^(?P<Y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})" + _REST
_DOTS = r"^(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<Y>\d{4})" + _REST
_EITHER = r"^(?P<d>\d{1,2})[-/](?P<m>\d{1,2})[-/](?P<Y>\d{4})" + _REST
_NAMED_MONTH = r"^(?P<d>\d{1,2})-(?P<m>[A-Za-z]{3})-(?P<Y>\d{4}|\d{2})" + _REST
_ZONED = r"\d:\d{2}(?:[.,:]\d+)?\s*(?:[AaPp][Mm])?\s*(?:Z|[+-]\d{2}:?\d{2})\s*$"
_MONTHS = pa.array(["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"])
_HALF_DAYS = pa.array([f"{hour or 12:02d}{half}" for half in ("am", "pm") for hour in range(12)])


def states_zone(column: Any) -> bool:
    """Check whether every cell of a column is a time stamp with a time zone."""
    if pa.types.is_timestamp(column.type):
        return column.type.tz is not None
    if not pa.types.is_string(column.type) or column.null_count == len(column):
        return False
    return bool(pc.all(pc.match_substring_regex(column, _ZONED)).as_py())


class CellValues(NamedTuple):
    """The values of a column."""

    values: NDArray[Any]  # Numbers, dates, or numbers and text, shape ``(n,)``
    unit: str = ""  # Unit that every cell states; ``s`` for times of day, which are seconds since midnight
    clock: bool = False  # Whether the values are times of day
    note: str = ""  # Which cells were read as missing


def column_values(column: Any, decimal: str, name: str) -> CellValues:
    """Read an Arrow column; a null becomes NaN or NaT, a date ``datetime64[ns]`` (in UTC if it has a time zone)."""
    kind, types = column.type, pa.types
    if types.is_null(kind):
        return CellValues(np.full(len(column), np.nan))
    if types.is_time(kind) or types.is_duration(kind):
        clock = bool(types.is_time(kind))
        nanoseconds = column.cast(pa.time64("ns") if clock else pa.duration("ns")).cast(pa.int64())
        seconds = pc.divide(nanoseconds.cast(pa.float64()), 1e9).to_numpy()
        return CellValues(seconds, "s" if clock else "", clock)
    if types.is_temporal(kind):
        column = column.cast(pa.timestamp("ns"))
    elif types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif not (types.is_integer(kind) or types.is_floating(kind)):
        return _text_values(column, decimal, name)
    return CellValues(np.asarray(column.to_numpy()))


def _text_values(column: Any, decimal: str, name: str) -> CellValues:
    """Read a text column as numbers (``7.2``, ``+  7.2``, ``7.2 bar``), dates or times of day; else keep the text.

    If the decimal sign is a comma, a cell with a point stays text, because the point may separate thousands. Cells that
    mark a value beyond the range become missing samples.
    """
    text = pc.utf8_trim_whitespace(column.cast(pa.string()))
    text = pc.if_else(pc.is_in(text, pa.array(MISSING)), None, text)
    form = f"^(?:{COMMA_NUMBER if decimal == ',' else POINT_NUMBER})$"
    if text.null_count == len(text):
        return CellValues(np.full(len(text), np.nan))
    number, note = pc.match_substring_regex(text, form), ""
    if pc.any(number).as_py():
        over = pc.fill_null(pc.is_in(text, pa.array(OVER_RANGE)), False)
        if count := pc.sum(over).as_py():
            cells = f"{count} cell{'' if count == 1 else 's'} of {name!r} with {text.filter(over)[0].as_py()!r}"
            note = f"{cells}, beyond the range of the input, taken as missing"
        return CellValues(_numbers(pc.if_else(over, None, text), number, decimal), note=note)
    if (seconds := _clock_seconds(text)) is not None:
        return CellValues(seconds, "s", clock=True)
    if (stamps := _date_stamps(text, name)) is not None:
        return CellValues(stamps)
    if (parts := _fields(text, _WITH_UNIT)) is not None:
        units = pc.unique(parts["unit"].drop_null()).to_pylist()
        values = _numbers(parts["number"], pc.match_substring_regex(parts["number"], form), decimal)
        if len(units) == 1 and names_a_unit(units[0]) and values.dtype.kind == "f":
            return CellValues(values, units[0])
    return CellValues(_numbers(text, number, decimal))


def _numbers(text: Any, number: Any, decimal: str) -> NDArray[Any]:
    """Convert the cells that match ``number``, and keep the others as text; a null becomes NaN."""
    plain = pc.if_else(number, text, None)
    plain = pc.replace_substring(plain, ",", ".") if decimal == "," else plain
    plain = pc.replace_substring(pc.utf8_ltrim(plain, characters="+ "), " ", "")
    numbers: NDArray[Any] = plain.cast(pa.float64()).to_numpy()
    words = pc.and_(pc.fill_null(pc.invert(number), False), text.is_valid()).to_numpy()
    if not words.any():
        return numbers
    mixed = numbers.astype(object)
    mixed[words] = text.filter(pa.array(words)).to_pylist()
    return mixed


def holds_decimal_commas(column: Any) -> bool:
    """Check whether every cell of a text column is a number with a decimal comma."""
    text = pc.utf8_trim_whitespace(column)
    return bool(pc.all(pc.match_substring_regex(text, f"^(?:{COMMA_NUMBER})$")).as_py())


def _clock_seconds(text: Any) -> Array | None:
    """Convert times of day (08:15:00,125; 08:15 PM) or minutes and seconds (15:00.1) to seconds; None for others."""
    for pattern, missing in ((f"^{_CLOCK_PARTS}$", {}), (_MINUTES, {"H": "0", "half": ""})):
        if (fields := _fields(text, pattern)) is not None:
            fields |= {key: pc.if_else(fields["M"].is_null(), None, value) for key, value in missing.items()}
            stamps = _stamps({"Y": "1970", "m": "1", "d": "1", **fields})
            return None if stamps is None else stamps.cast(pa.int64()).to_numpy() / 1e9
    return None


def _date_stamps(text: Any, name: str) -> NDArray[np.datetime64] | None:
    """Convert dates with or without a time of day to ``datetime64[ns]``; a null becomes NaT. None for other cells.

    In dates with dots the day comes first. In dates with slashes, the first row that can only be read one way decides
    for the column. Stamps with a time zone are converted to UTC.
    """
    for pattern in (_YEAR_FIRST, _DOTS, _EITHER, _NAMED_MONTH):
        if (fields := _fields(text, pattern)) is None:
            continue
        if pattern == _EITHER and _month_first(fields, text, name):
            fields["d"], fields["m"] = fields["m"], fields["d"]
        elif pattern == _NAMED_MONTH:
            fields["Y"] = pc.replace_substring_regex(fields["Y"], "^(..)$", r"20\1")
            fields["m"] = pc.add(pc.index_in(pc.utf8_lower(fields["m"]), _MONTHS), 1).cast(pa.string())
        stamps = _stamps(fields)
        return None if stamps is None else stamps.cast(pa.timestamp("ns")).to_numpy()
    return None


def _fields(text: Any, pattern: str) -> dict[str, Any] | None:
    """Split cells into the groups of a pattern; None if a cell does not match."""
    parts = pc.extract_regex(text, pattern=pattern)
    if parts.null_count > text.null_count:
        return None
    return {field.name: pc.struct_field(parts, field.name) for field in parts.type}


def _month_first(fields: dict[str, Any], text: Any, name: str) -> bool:
    """Decide whether dates such as 01/02/2026 begin with the month; refuse dates that do not show it."""
    first, second = (fields[key].cast(pa.int64()) for key in ("d", "m"))
    if pc.any(pc.greater(second, 12)).as_py():
        return True
    unsettled = pc.index(pc.not_equal(first, second), True).as_py()
    if unsettled < 0 or pc.any(pc.greater(first, 12)).as_py():
        return False
    raise RecordingError(
        f"channel {name!r}: {text[unsettled].as_py()!r} may have the day or the month first, and no row settles it; "
        "expected dates with one reading: let the logger write ISO 8601 (2026-12-31 08:15:00), or rewrite the channel "
        "so"
    )


def _stamps(fields: dict[str, Any]) -> Any | None:
    """Parse the fields as ISO 8601 and return instants in UTC; None if a cell is no date or time of day."""
    hour, fraction = pc.utf8_lpad(fields["H"], 2, "0"), pc.utf8_rpad(fields["f"], 9, "0")
    if "half" in fields:
        half = pc.utf8_lower(fields["half"])
        on_clock = pc.index_in(pc.binary_join_element_wise(hour, half, ""), _HALF_DAYS).cast(pa.string())
        hour = pc.utf8_lpad(pc.if_else(pc.equal(half, ""), hour, on_clock), 2, "0")
    year, month, day, minute, second = (
        pc.utf8_lpad(field, 2, "0") for field in (fields["Y"], fields["m"], fields["d"], fields["M"], fields["S"])
    )
    date = pc.binary_join_element_wise(year, month, day, "-")
    clock = pc.binary_join_element_wise(hour, minute, pc.binary_join_element_wise(second, fraction, "."), ":")
    zone = fields.get("zone", "Z")
    zone = pc.if_else(pc.equal(zone, ""), "Z", zone)
    iso = pc.binary_join_element_wise(pc.binary_join_element_wise(date, clock, "T"), zone, "")
    if iso.null_count > fields["H"].null_count:
        return None
    try:
        return iso.cast(pa.timestamp("ns", "UTC"))
    except pa.ArrowInvalid:
        return None

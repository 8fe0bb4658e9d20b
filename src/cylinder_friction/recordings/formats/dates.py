"""Dates and times of day as loggers write them, beyond ISO 8601, which Arrow reads itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CLOCK = r"(?P<H>\d{1,2}):(?P<M>\d{2})(?::(?P<S>\d{2})(?:[.,:](?P<f>\d{1,9}))?)?"
_REST = rf"(?:[T ,]+{_CLOCK}\s*(?P<half>[AaPp][Mm])?)?\s*(?P<zone>Z|[+-]\d{{2}}:?\d{{2}})?$"
_YEAR_FIRST = r"^(?P<Y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})" + _REST
_DOTS = r"^(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<Y>\d{4})" + _REST
_EITHER = r"^(?P<d>\d{1,2})[-/](?P<m>\d{1,2})[-/](?P<Y>\d{4})" + _REST
_NAMED_MONTH = r"^(?P<d>\d{1,2})-(?P<m>[A-Za-z]{3})-(?P<Y>\d{4})" + _REST
_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]


def clock_seconds(text: Any) -> NDArray[np.float64] | None:
    """Return times of day (08:15:00,125) as seconds since midnight, or None if a cell is none; null is NaN."""
    parts = pc.extract_regex(text, pattern=f"^{_CLOCK}$")
    if parts.null_count > text.null_count:
        return None
    nanoseconds = _clock_ns(parts)
    if nanoseconds is None:
        return None
    return np.where(_valid(text), nanoseconds / 1e9, np.nan)


def date_stamps(text: Any, name: str) -> NDArray[np.datetime64] | None:
    """Return dates with or without a time of day as ``datetime64[ns]``, or None if a cell is none; null is NaT.

    With dots the day comes first. With strokes the first row that can only be read one way settles it for the column.
    A time zone is taken off: the stamps are then in UTC.

    Args:
        text: A ``pyarrow.ChunkedArray`` of strings.
        name: Of the channel, for the message.

    Raises:
        RecordingError: Day and month are ambiguous.
    """
    for pattern in (_YEAR_FIRST, _DOTS, _EITHER, _NAMED_MONTH):
        parts = pc.extract_regex(text, pattern=pattern)
        if parts.null_count > text.null_count:
            continue
        day, month = _integers(parts, "d"), None
        if pattern == _NAMED_MONTH:
            names = pc.utf8_lower(pc.struct_field(parts, "m"))
            month = pc.index_in(names, pa.array(_MONTHS)).fill_null(-1).to_numpy().astype(np.int64) + 1
        else:
            month = _integers(parts, "m")
        if pattern == _EITHER:
            day, month = _settled(day, month, _valid(text), text, name)
        return _stamps(parts, day, month, _valid(text))
    return None


def _settled(
    first: NDArray[np.int64], second: NDArray[np.int64], valid: NDArray[np.bool_], text: Any, name: str
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return day and month of dates such as 01/02/2026."""
    if (second > 12).any():
        return second, first
    open_rows = valid & (first != second)
    if (first > 12).any() or not open_rows.any():
        return first, second
    cell = text[int(np.flatnonzero(open_rows)[0])].as_py()
    raise RecordingError(
        f"channel {name!r}: {cell!r} may have the day or the month first, and no row settles it; expected dates with "
        "one reading: let the logger write ISO 8601 (2026-12-31 08:15:00), or rewrite the channel so"
    )


def _stamps(
    parts: Any, day: NDArray[np.int64], month: NDArray[np.int64], valid: NDArray[np.bool_]
) -> NDArray[np.datetime64] | None:
    year = _integers(parts, "Y")
    clock = _clock_ns(parts)
    valid_date = (year >= 1678) & (year <= 2261) & (month >= 1) & (month <= 12) & (day >= 1)
    if clock is None or not valid_date[valid].all():
        return None
    months = np.where(valid, (year - 1970) * 12 + month - 1, 0).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + np.where(valid, day - 1, 0)
    if (days.astype("datetime64[M]") != months).any():
        return None
    stamps = days.astype("datetime64[ns]") + (clock - _zone_ns(parts)).astype("timedelta64[ns]")
    stamps[~valid] = np.datetime64("NaT")
    return stamps


def _clock_ns(parts: Any) -> NDArray[np.int64] | None:
    """Return the time of day in nanoseconds, or None if an hour, minute or second is none; 0 where there is none."""
    hour, minute, second = (_integers(parts, field) for field in ("H", "M", "S"))
    fields = [field.name for field in parts.type]
    if "half" in fields:
        half = pc.utf8_lower(pc.struct_field(parts, "half")).fill_null("")
        has_half = pc.not_equal(half, "").to_numpy()
        if (has_half & ((hour < 1) | (hour > 12))).any():
            return None
        hour = np.where(has_half, hour % 12 + 12 * pc.equal(half, "pm").to_numpy(), hour)
    if (hour > 23).any() or (minute > 59).any() or (second > 60).any():
        return None
    padded = pc.utf8_rpad(pc.struct_field(parts, "f").fill_null(""), width=9, padding="0")
    fraction = pc.cast(padded, pa.int64()).to_numpy()
    return ((hour * 60 + minute) * 60 + second) * 1_000_000_000 + fraction


def _zone_ns(parts: Any) -> NDArray[np.int64]:
    zone = pc.struct_field(parts, "zone").fill_null("")
    if pc.all(pc.equal(pc.utf8_length(zone), 0)).as_py():
        return np.zeros(len(parts), dtype=np.int64)
    offset = pc.extract_regex(zone, pattern=r"^(?P<sign>[+-])(?P<h>\d{2}):?(?P<min>\d{2})$")
    minutes = _integers(offset, "h") * 60 + _integers(offset, "min")
    behind = pc.equal(pc.struct_field(offset, "sign"), "-").fill_null(False).to_numpy()
    return np.where(behind, -minutes, minutes) * 60_000_000_000


def _integers(parts: Any, field: str) -> NDArray[np.int64]:
    """Return one part as whole numbers, 0 where it is not there."""
    text = pc.struct_field(parts, field).fill_null("")
    filled = pc.if_else(pc.equal(text, ""), "0", text)
    numbers: NDArray[np.int64] = pc.cast(filled, pa.int64()).to_numpy()
    return numbers


def _valid(text: Any) -> NDArray[np.bool_]:
    valid: NDArray[np.bool_] = text.is_valid().to_numpy()
    return valid

"""Dates and times of day as loggers write them, beyond ISO 8601, which Arrow reads itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array

_CLOCK = r"(?P<H>\d{1,2}):(?P<M>\d{2})(?::(?P<S>\d{2})(?:[.,:](?P<f>\d{1,9}))?)?"
_REST = rf"(?:[T ,]+{_CLOCK}\s*(?P<half>[AaPp][Mm])?)?\s*(?P<zone>Z|[+-]\d{{2}}:?\d{{2}})?$"
_YEAR_FIRST = r"^(?P<Y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})" + _REST
_DOTS = r"^(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<Y>\d{4})" + _REST
_EITHER = r"^(?P<d>\d{1,2})[-/](?P<m>\d{1,2})[-/](?P<Y>\d{4})" + _REST
_NAMED_MONTH = r"^(?P<d>\d{1,2})-(?P<m>[A-Za-z]{3})-(?P<Y>\d{4})" + _REST
_MONTHS = pa.array(["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"])
_HALF_DAYS = pa.array([f"{hour or 12:02d}{half}" for half in ("am", "pm") for hour in range(12)])


def clock_seconds(text: Any) -> Array | None:
    """Return times of day (08:15:00,125) as seconds since midnight, or None if a cell is none; null is NaN."""
    parts = pc.extract_regex(text, pattern=f"^{_CLOCK}$")
    if parts.null_count > text.null_count:
        return None
    stamps = _stamps({"Y": "1970", "m": "1", "d": "1", **_fields(parts)})
    return None if stamps is None else stamps.cast(pa.int64()).to_numpy() / 1e9


def date_stamps(text: Any, name: str) -> NDArray[np.datetime64] | None:
    """Return dates with or without a time of day as ``datetime64[ns]``, or None if a cell is none; null is NaT.

    With dots the day comes first. With strokes the first row that can only be read one way settles it for the column.
    A time zone is taken off: the stamps are then in UTC.

    Raises:
        RecordingError: Day and month are ambiguous.
    """
    for pattern in (_YEAR_FIRST, _DOTS, _EITHER, _NAMED_MONTH):
        parts = pc.extract_regex(text, pattern=pattern)
        if parts.null_count > text.null_count:
            continue
        fields = _fields(parts)
        if pattern == _EITHER and _month_first(fields, text, name):
            fields["d"], fields["m"] = fields["m"], fields["d"]
        elif pattern == _NAMED_MONTH:
            fields["m"] = pc.add(pc.index_in(pc.utf8_lower(fields["m"]), _MONTHS), 1).cast(pa.string())
        stamps = _stamps(fields)
        return None if stamps is None else stamps.cast(pa.timestamp("ns")).to_numpy()
    return None


def _fields(parts: Any) -> dict[str, Any]:
    return {field.name: pc.struct_field(parts, field.name) for field in parts.type}


def _month_first(fields: dict[str, Any], text: Any, name: str) -> bool:
    """Return whether dates such as 01/02/2026 have their month in the place of the day."""
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
    """Return instants in UTC by way of ISO 8601, or None if a cell is no date or time of day."""
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

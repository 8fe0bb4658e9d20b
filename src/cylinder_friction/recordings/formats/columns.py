"""From Arrow's columns to a logged table's: numbers, time stamps, or text where a cell is none."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cylinder_friction.recordings.formats.cells import COMMA_NUMBER, MISSING, POINT_NUMBER
from cylinder_friction.recordings.formats.dates import clock_seconds, date_stamps

if TYPE_CHECKING:
    from numpy.typing import NDArray


def plain_values(column: Any) -> NDArray[Any] | None:
    """Return a column of a simple type; a null is NaN (or NaT), a date is ``datetime64[ns]`` (UTC if it has a zone).

    None for text and for types that are no single value per row, such as lists.
    """
    kind = column.type
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_temporal(kind) and not pa.types.is_duration(kind):
        return _temporal(column)
    if pa.types.is_duration(kind):
        return pc.divide(column.cast(pa.duration("ns")).cast(pa.int64()).cast(pa.float64()), 1e9).to_numpy()
    if pa.types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return None
    values: NDArray[Any] = column.to_numpy()
    return values


def _temporal(column: Any) -> NDArray[Any]:
    if pa.types.is_time(column.type):
        unit = "ns" if pa.types.is_time64(column.type) else "ms"
        wide = column.cast(pa.time64("ns") if unit == "ns" else pa.time32("ms"))
        ticks = wide.cast(pa.int64() if unit == "ns" else pa.int32()).cast(pa.float64())
        seconds: NDArray[Any] = pc.divide(ticks, 1e9 if unit == "ns" else 1e3).to_numpy()
        return seconds
    stamps: NDArray[Any] = column.cast(pa.timestamp("ns")).to_numpy()
    return stamps


def text_values(column: Any, decimal: str, name: str) -> tuple[NDArray[Any], bool]:
    """Return a column of text as numbers, dates or times of day; if neither, its cells as they are, numbers as such.

    Under a decimal comma a point is no decimal sign: such a cell stays text, for it may be a thousands separator.

    Args:
        column: A ``pyarrow.ChunkedArray`` of strings.
        decimal: ``.`` or ``,``.
        name: Of the channel, for messages.

    Returns:
        The values, and whether they are seconds since midnight.

    Raises:
        RecordingError: They are dates whose day and month are ambiguous.
    """
    text = pc.utf8_trim_whitespace(column.cast(pa.string()))
    text = pc.if_else(pc.is_in(text, pa.array(MISSING)), None, text)
    number = pc.match_substring_regex(text, f"^(?:{COMMA_NUMBER if decimal == ',' else POINT_NUMBER})$")
    if not pc.any(number).as_py():
        if text.null_count < len(text):
            seconds = clock_seconds(text)
            if seconds is not None:
                return seconds, True
            stamps = date_stamps(text, name)
            if stamps is not None:
                return stamps, False
        return _objects(text, text.null_count == len(text)), False
    plain = pc.if_else(number, text, None)
    plain = pc.replace_substring(plain, ",", ".") if decimal == "," else plain
    numbers = pc.utf8_ltrim(plain, characters="+").cast(pa.float64()).to_numpy()
    words = pc.fill_null(pc.invert(number), False).to_numpy()
    if not words.any():
        return numbers, False
    mixed = numbers.astype(object)
    mixed[words] = text.filter(pa.array(words)).to_pylist()
    return mixed, False


def holds_decimal_commas(column: Any) -> bool:
    """Return whether every cell of a column of text is a number under a decimal comma."""
    text = pc.utf8_trim_whitespace(column)
    return bool(pc.all(pc.match_substring_regex(text, f"^(?:{COMMA_NUMBER})$")).as_py())


def _objects(text: Any, nothing: bool) -> NDArray[Any]:
    if nothing:
        return np.full(len(text), np.nan)
    cells = np.array(text.to_pylist(), dtype=object)
    cells[~text.is_valid().to_numpy()] = np.nan
    return cells

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
    if pa.types.is_time(kind) or pa.types.is_duration(kind):
        nanoseconds = column.cast(pa.duration("ns") if pa.types.is_duration(kind) else pa.time64("ns"))
        return pc.divide(nanoseconds.cast(pa.int64()).cast(pa.float64()), 1e9).to_numpy()
    if pa.types.is_temporal(kind):
        column = column.cast(pa.timestamp("ns"))
    elif pa.types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return None
    return np.asarray(column.to_numpy())


def text_values(column: Any, decimal: str, name: str) -> tuple[NDArray[Any], bool]:
    """Return a column of text as numbers, dates or times of day; if neither, its cells as they are, numbers as such.

    Under a decimal comma a point is no decimal sign: such a cell stays text, for it may be a thousands separator.

    Returns:
        The values, and whether they are seconds since midnight.
    """
    text = pc.utf8_trim_whitespace(column.cast(pa.string()))
    text = pc.if_else(pc.is_in(text, pa.array(MISSING)), None, text)
    number = pc.match_substring_regex(text, f"^(?:{COMMA_NUMBER if decimal == ',' else POINT_NUMBER})$")
    if text.null_count == len(text):
        return np.full(len(text), np.nan), False
    if not pc.any(number).as_py():
        if (seconds := clock_seconds(text)) is not None:
            return seconds, True
        stamps = date_stamps(text, name)
        return text_objects(text) if stamps is None else stamps, False
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


def text_objects(text: Any) -> NDArray[Any]:
    """Return a column of text as Python strings; a null is NaN."""
    cells = np.array(text.to_pylist(), dtype=object)
    cells[~text.is_valid().to_numpy()] = np.nan
    return cells

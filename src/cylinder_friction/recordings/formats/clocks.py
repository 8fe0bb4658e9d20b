"""Bring the clocks of tables into one form: date and time of day joined, dates instead of numbers, oldest row first.

A text table with several time columns of one name, each before the channels of its rate, becomes several tables. The
TwinCAT Scope (``Name;p1;p2;Name;x``), LabVIEW (``X_Value``) and others that log at several rates write such tables. If
a group ends before the others, its cells are empty, or the rows are shorter.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.cells import column_values, is_value, split_cells, states_zone
from cylinder_friction.recordings.formats.format import Column, LoggedTable, named_columns
from cylinder_friction.recordings.mapping.channel_words import words_of
from cylinder_friction.recordings.mapping.units import conversion
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import NEVER_FALLS, epoch_of
from cylinder_friction.recordings.timeline.timestamps import LATEST_S

DAY = np.timedelta64(1, "D")
MILLISECONDS = ("ms", "msec", "millisecond", "milliseconds", "millisekunden")
"""Names of a column that holds the milliseconds of a stamp beside it."""
FEWEST_ROWS = 20
"""Fewest rows that show an order; in fewer, the order may be chance."""


def beside_clocks(names: Collection[str]) -> set[str]:
    """Name the columns that may be a part of a time stamp: dates, times of day, milliseconds."""
    return {name for name in names if words_of(name).quantity == "time" or name.casefold() in MILLISECONDS}


class Columns(NamedTuple):
    """The content of Arrow columns."""

    columns: list[Column]
    units: dict[str, str]  # Units that their cells state, by name
    notes: list[str]
    utc: bool  # Whether time stamps state their time zone


def columns_of(named: Iterable[tuple[str, Any]], decimal: str, wanted: Collection[str] | None) -> Columns:
    """Read named Arrow columns. A column that is not wanted is left out if it cannot be read.

    Date and time of day, or whole seconds and milliseconds, are joined.
    """
    columns, units, clocks, notes, utc = list[Column](), dict[str, str](), list[str](), list[str](), False
    for name, column in named:
        utc |= states_zone(column)
        try:
            cells = column_values(column, decimal, name)
        except RecordingError:
            if wanted is None or name in wanted:
                raise
            continue
        columns.append((name, cells.values))
        units |= {name: cells.unit} if cells.unit else {}
        notes += [cells.note] if cells.note else []
        clocks += [name] if cells.clock else []
    return Columns(_joined(columns, clocks, wanted), units, notes, utc)


def _joined(columns: list[Column], clocks: Collection[str], wanted: Collection[str] | None) -> list[Column]:
    """Join dates with times of day; ``clocks`` names the columns of times of day, which are in seconds."""
    dates = [name for name, values in columns if values.dtype.kind == "M"]
    days = [name for name, values in columns if name in dates and _known(values, DAY)]
    found = dict(columns)
    if len(days) == 1 and len(clocks) == 1:
        (day,), (clock,) = days, clocks
        seconds = np.rint(1e9 * found[clock])
        stamps = found[day] + np.where(np.isfinite(seconds), seconds, np.iinfo(np.int64).min).astype("timedelta64[ns]")
        kept = day if wanted and day in wanted and clock not in wanted else clock
        return _in_place(columns, {day, clock}, stamps, kept)
    parts = [name for name, values in columns if name.casefold() in MILLISECONDS and _are_milliseconds(values)]
    seconds_of = [name for name in dates if name not in days and _known(found[name], np.timedelta64(1, "s"))]
    if len(seconds_of) == 1 and len(parts) == 1 and (wanted is None or seconds_of[0] in wanted):
        stamps = found[seconds_of[0]] + found[parts[0]].astype("timedelta64[ms]")
        return _in_place(columns, {seconds_of[0], parts[0]}, stamps, seconds_of[0])
    return columns


def _known(stamps: NDArray[Any], step: np.timedelta64) -> bool:
    """Check whether there are stamps and all of them are multiples of ``step``."""
    known = stamps[~np.isnat(stamps)].astype(np.int64)
    return len(known) > 0 and not (known % step.astype("timedelta64[ns]").astype(np.int64)).any()


def _are_milliseconds(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "iu" and bool(((values >= 0) & (values < 1000)).all())


def _in_place(columns: list[Column], old: set[str], stamps: NDArray[Any], name: str) -> list[Column]:
    return [(other, stamps if other == name else values) for other, values in columns if other not in old - {name}]


def with_dates(table: LoggedTable) -> LoggedTable:
    """Convert a table's numbers of days, ticks and the like since a known date to dates; a note states which.

    Numbers since 1970 stay numbers.
    """
    dates: dict[str, NDArray[Any]] = {}
    notes, utc = [], table.utc
    for name, values in table.channels.items():
        name, numbers = str(name), values.to_numpy()
        epoch = epoch_of(numbers, name)
        if epoch is None or epoch.of_1970 == 0 or (table.channels.columns == name).sum() > 1:
            continue
        unit = conversion(table.units.get(name, ""), "time")
        if unit and epoch.unit != table.units[name] and abs(float(numbers[0])) * unit[0] < LATEST_S:
            continue
        dates[name], utc = epoch.stamps(numbers), utc or epoch.utc
        notes.append(f"time: {name!r} counts {epoch.counted} since {epoch.since}")
    if not dates:
        return table
    units = {name: unit for name, unit in table.units.items() if name not in dates}
    channels = table.channels.copy(deep=False)
    for name, stamps in dates.items():
        channels[name] = stamps
    return replace(table, channels=channels, units=units, utc=utc, notes=(*table.notes, *notes))


def oldest_first(table: LoggedTable) -> LoggedTable:
    """Reverse a table that was written newest row first, and add a note.

    A table is reversed if a column of dates or one named time falls, and none rises.
    """
    ways = [
        _way(values.to_numpy())
        for name, values in table.channels.items()
        if words_of(str(name)).quantity == "time" and values.dtype.kind in "Miuf"
    ]
    if -1 not in ways or 1 in ways:
        return table
    turned = table.channels.iloc[::-1].reset_index(drop=True)
    return replace(table, channels=turned, notes=(*table.notes, "its newest row comes first; turned round"))


def steps_of(values: NDArray[Any]) -> NDArray[Any]:
    """Compute the differences of numbers or dates, without missing ones."""
    known = values[~pd.isna(values)]
    return np.diff(known.astype(np.int64) if known.dtype.kind in "Miu" else known)


def _way(values: NDArray[Any]) -> int:
    """Return 1 if values rise, -1 if they fall, else 0."""
    steps = steps_of(values)
    if len(steps) < FEWEST_ROWS - 1:
        return 0
    return int((steps > 0).mean() >= NEVER_FALLS) - int((steps < 0).mean() >= NEVER_FALLS)


def repeated_names(names: Sequence[str]) -> set[str]:
    """Find names that occur again after another column, because they may be time columns."""
    counts = Counter(names)
    adjacent = {one for one, other in pairwise(names) if one == other}
    return {name for name, count in counts.items() if name and count > 1} - adjacent


def padded(lines: list[str], delimiters: Collection[str]) -> list[str]:
    """Pad the rows below a line of repeated names to its number of cells."""
    for number, line in enumerate(lines):
        if line[:1].isdecimal():  # a row, as most lines are
            continue
        for delimiter in delimiters:
            cells = split_cells(line, delimiter) if delimiter != "whitespace" else []
            if cells and cells[0] in repeated_names(cells) and not is_value(cells[0], None):
                return [*lines[:number], *(_padded(below, delimiter, len(cells)) for below in lines[number:])]
    return lines


def _padded(line: str, delimiter: str, width: int) -> str:
    """Append empty cells to a row up to ``width`` cells; return any other line unchanged."""
    first = next((cell for cell in split_cells(line, delimiter) if cell), "")
    bare = line.rstrip("\r\n")
    return bare + delimiter * (width - 1 - bare.count(delimiter)) + line[len(bare) :] if is_value(first, None) else line


def split_groups(columns: list[Column], units: dict[str, str], repeated: Collection[str]) -> list[LoggedTable]:
    """Make a table ``group 1``, ... for each time column of a ``repeated`` name; without one, make a single table.

    A group ends with its last row that is not empty.
    """
    names = [name for name, _ in columns]
    clock = next((name for name in names if name in repeated and _are_clocks(columns, name)), None)
    if clock is None:
        return [LoggedTable(named_columns(columns), units)]
    starts = [index for index, name in enumerate(names) if name == clock]
    bounds = [0, *starts[1:], len(columns)]
    frames = [named_columns(columns[start:end]) for start, end in pairwise(bounds)]
    filled = [frame[frame.notna().any(axis=1)].reset_index(drop=True) for frame in frames]
    return [LoggedTable(frame, units, f"group {number}") for number, frame in enumerate(filled, start=1) if len(frame)]


def _are_clocks(columns: list[Column], name: str) -> bool:
    """Check whether all columns of a name have rising stamps, or are empty because their channels have no samples."""
    rising = [_rises(values) for other, values in columns if other == name]
    return True in rising and False not in rising


def _rises(values: NDArray[Any]) -> bool | None:
    if values.dtype.kind not in "iufM":
        return False
    if pd.isna(values).all():
        return None
    steps = steps_of(values)
    return bool((steps > 0).any() and (steps >= 0).mean() >= NEVER_FALLS)

"""Text tables with several time columns of one name, each followed by the channels of its rate, become several tables.

So write the TwinCAT Scope (``Name;p1;p2;Name;x``), LabVIEW (``X_Value``) and others that log at several rates. A group
that ends before the others is padded with empty cells, or its rows are simply shorter.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.cells import is_value, split_cells
from cylinder_friction.recordings.formats.logged_table import RISING_SHARE, Column, LoggedTable, named_columns


def repeated_names(names: Sequence[str]) -> set[str]:
    """Return names that occur again behind another column: they may be those of time columns."""
    counts = Counter(names)
    adjacent = {one for one, other in pairwise(names) if one == other}
    return {name for name, count in counts.items() if name and count > 1} - adjacent


def padded(lines: list[str], delimiters: Collection[str]) -> list[str]:
    """Return a text's first lines, rows below a line of repeated names with as many cells as that one has."""
    for number, line in enumerate(lines):
        if line[:1].isdecimal():  # a row, as most lines are
            continue
        for delimiter in delimiters:
            cells = split_cells(line, delimiter) if delimiter != "whitespace" else []
            if cells and cells[0] in repeated_names(cells) and not is_value(cells[0], None):
                return [*lines[:number], *(_padded(below, delimiter, len(cells)) for below in lines[number:])]
    return lines


def _padded(line: str, delimiter: str, width: int) -> str:
    """Return a row with empty cells behind its last one, up to ``width`` of them; any other line as it is."""
    first = next((cell for cell in split_cells(line, delimiter) if cell), "")
    bare = line.rstrip("\r\n")
    return bare + delimiter * (width - 1 - bare.count(delimiter)) + line[len(bare) :] if is_value(first, None) else line


def split_groups(columns: list[Column], units: dict[str, str], repeated: Collection[str]) -> list[LoggedTable]:
    """Return one table for each time column of a ``repeated`` name, named ``group 1``, ...; else one table.

    A group ends with its last row that holds anything. Rows that repeat the one before, stamp and all, are left out if
    no row repeats a stamp with other values: a slower group was filled up to the rate of a faster one.
    """
    names = [name for name, _ in columns]
    clock = next((name for name in names if name in repeated and _are_clocks(columns, name)), None)
    if clock is None:
        return [LoggedTable(named_columns(columns), units)]
    starts = [index for index, name in enumerate(names) if name == clock]
    bounds = [0, *starts[1:], len(columns)]
    tables = []
    for number, (start, end) in enumerate(pairwise(bounds), start=1):
        frame, notes = _group(columns[start:end], clock)
        if len(frame):
            tables.append(LoggedTable(frame, units, f"group {number}", notes=notes))
    return tables


def _group(columns: list[Column], clock: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    frame = named_columns(columns)
    frame = frame[frame.notna().any(axis=1)].reset_index(drop=True)
    again = (frame[clock] == frame[clock].shift()).to_numpy()
    repeated, before = frame[again], frame.shift()[again]
    if not again.any() or not ((repeated == before) | (repeated.isna() & before.isna())).all(axis=None):
        return frame, ()
    names = ", ".join(repr(name) for name, _ in columns if name != clock)
    note = f"{again.sum()} rows of {names} that repeat stamp and values of the row before left out"
    return frame[~again].reset_index(drop=True), (note,)


def _are_clocks(columns: list[Column], name: str) -> bool:
    """Return whether every column of a name holds rising stamps; of channels without a sample it may be empty."""
    rising = [_rises(values) for other, values in columns if other == name]
    return True in rising and False not in rising


def _rises(values: NDArray[Any]) -> bool | None:
    if values.dtype.kind not in "iufM":
        return False
    stamps = values[~np.isnat(values)].astype(np.int64) if values.dtype.kind == "M" else values[np.isfinite(values)]
    if not len(stamps):
        return None
    steps = np.diff(stamps)
    return bool((steps > 0).any() and (steps >= 0).mean() >= RISING_SHARE)

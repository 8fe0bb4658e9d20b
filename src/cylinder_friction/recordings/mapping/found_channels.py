"""Channels of a file by their names, and their cells as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.recording import RecordingError

MOST_NAMES = 40
"""Channels that a message lists; a measurement file may have thousands."""


def find_channel(tables: Sequence[LoggedTable], name: str, table: str, column: str) -> int:
    """Return the index of the table that holds the channel for ``column``; any table will do if ``table`` is empty.

    Raises:
        RecordingError: The table or the channel is missing (the message lists what there is and the nearest name), or
            the channel occurs more than once.
    """
    searched = [index for index, entry in enumerate(tables) if table in ("", entry.name)]
    if not searched:
        raise RecordingError(
            f"table {table!r} (for {column!r}) is missing; got tables {_listed([entry.name for entry in tables])}; "
            f"correct the file or channels.{column}.table"
        )
    holding = [index for index in searched for other in tables[index].channels.columns if other == name]
    if len(holding) == 1:
        return holding[0]
    key = "channel"
    there = [str(other) for index in searched for other in (*tables[index].channels.columns, *tables[index].unread)]
    if not holding:
        problem = f"is missing; got channels {_listed(there)}{_nearest(name, there)}; correct the file or"
    elif len(set(holding)) == 1:
        problem = f"occurs {len(holding)} times; got channels {_listed(there)}; rename one in the file or correct"
    else:
        problem, key = f"occurs in tables {_listed([tables[each].name for each in holding])}; state which as", "table"
    raise RecordingError(f"channel {name!r} (for {column!r}) {problem} channels.{column}.{key} in the mapping")


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(map(repr, names[:MOST_NAMES])) + more


def _nearest(name: str, there: Sequence[str]) -> str:
    by_folded = {"".join(other.split()).casefold(): other for other in there}
    close = get_close_matches("".join(name.split()).casefold(), by_folded, n=1, cutoff=0.6)
    return f" (nearest: {by_folded[close[0]]!r})" if close else ""


def numbers(raw: pd.Series[Any], channel: str, column: str, unit: str) -> Array:
    """Return a channel's cells as numbers, shape ``(n,)``; an empty cell is NaN. No copy if they are float64.

    Raises:
        RecordingError: The cells are dates or durations, or one holds text.
    """
    if raw.dtype.kind in "iufb":
        return raw.to_numpy(dtype=np.float64)
    if raw.dtype.kind in "mMc":
        raise RecordingError(
            f"channel {channel!r} (for {column!r}) holds "
            f"{'dates' if raw.dtype.kind == 'M' else raw.dtype}; expected numbers "
            f"in {unit}; correct channels.{column}.channel"
        )
    values: Array = pd.to_numeric(raw, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    rows = np.flatnonzero(np.isnan(values) & raw.notna().to_numpy())
    if len(rows):
        raise RecordingError(
            f"channel {channel!r} (for {column!r}) holds {raw.iloc[rows[0]]!r} in row {rows[0] + 1} "
            f"({len(rows)} such rows in all); expected numbers in {unit}; repair or cut the log"
        )
    return values

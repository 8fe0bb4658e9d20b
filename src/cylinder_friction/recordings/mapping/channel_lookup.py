"""One channel among a file's tables: found by name, and its cells as numbers or as seconds."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.formats.logged_table import LoggedTable

    Array = NDArray[np.float64]

MOST_NAMES = 40
"""Channels that a message lists; a measurement file may have thousands."""


def find_channel(tables: Sequence[LoggedTable], name: str, table: str, column: str) -> int:
    """Return the index of the table that holds a channel.

    Args:
        tables: Of the file.
        name: Of the channel.
        table: Name of its table; empty where any will do.
        column: What the channel is for, for the message.

    Raises:
        RecordingError: The table or the channel is missing (the message lists what there is and the nearest name), or
            the channel occurs more than once.
    """
    searched = [index for index, entry in enumerate(tables) if table in ("", entry.name)]
    if not searched:
        raise RecordingError(
            f"table {table!r} (for {column!r}) is missing; got tables {_listed([entry.name for entry in tables])}; "
            f"correct the file or ingest.channels.{column}.table"
        )
    counts = {index: int((tables[index].channels.columns == name).sum()) for index in searched}
    holding = [index for index, count in counts.items() if count]
    if len(holding) > 1:
        raise RecordingError(
            f"channel {name!r} (for {column!r}) occurs in tables {_listed([tables[index].name for index in holding])}; "
            f"state which as ingest.channels.{column}.table"
        )
    if not holding:
        there = [str(other) for index in searched for other in (*tables[index].channels.columns, *tables[index].unread)]
        raise RecordingError(
            f"channel {name!r} (for {column!r}) is missing; got channels {_listed(there)}{_nearest(name, there)}; "
            f"correct the file or ingest.channels.{column}.channel"
        )
    if counts[holding[0]] > 1:
        raise RecordingError(
            f"channel {name!r} (for {column!r}) occurs {counts[holding[0]]} times; got channels "
            f"{_listed([str(other) for other in tables[holding[0]].channels.columns])}; "
            f"rename one in the file or correct ingest.channels.{column}.channel"
        )
    return holding[0]


def numbers(raw: pd.Series[Any], channel: str, column: str, unit: str) -> Array:
    """Return a channel's cells as numbers, shape ``(n,)``; an empty cell is NaN. No copy where they are float64.

    Raises:
        RecordingError: A cell holds text, the first of which is named with its row, counted from 1; or the cells are
            dates or complex numbers.
    """
    kind = raw.dtype.kind
    if kind in "mMc" or isinstance(raw.dtype, pd.DatetimeTZDtype):
        what = "complex numbers" if kind == "c" else "dates or durations"
        raise RecordingError(
            f"channel {channel!r} (for {column!r}) holds {what} ({raw.dtype}); expected numbers in {unit}; "
            f"correct ingest.channels.{column}.channel"
        )
    if pd.api.types.is_numeric_dtype(raw.dtype):
        return raw.to_numpy(dtype=np.float64, na_value=np.nan) if raw.isna().any() else raw.to_numpy(dtype=np.float64)
    cells = raw.astype(object)
    values: Array = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    text = np.isnan(values) & cells.notna().to_numpy()
    if text.any():
        row = int(np.flatnonzero(text)[0])
        raise RecordingError(
            f"channel {channel!r} (for {column!r}) holds {cells.iloc[row]!r} in row {row + 1} "
            f"({int(text.sum())} such rows in all); expected numbers in {unit}; repair or cut the log"
        )
    return values


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(map(repr, names[:MOST_NAMES])) + more


def _nearest(name: str, there: Sequence[str]) -> str:
    by_folded = {"".join(other.split()).casefold(): other for other in there}
    close = get_close_matches("".join(name.split()).casefold(), by_folded, n=1, cutoff=0.6)
    return f" (nearest: {by_folded[close[0]]!r})" if close else ""

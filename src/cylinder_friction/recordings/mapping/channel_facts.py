"""What a channel of a logged file is: its name, its unit, and what its values look like."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cylinder_friction.recordings.mapping.channel_words import Words, words_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.formats.logged_table import LoggedTable

    Array = NDArray[np.float64]

MOSTLY = 0.99
"""Time may have a few repeated or backward stamps and still be time."""


@dataclass(frozen=True)
class ChannelFacts:
    """One channel.

    Attributes:
        table: Place of its table among the file's.
        table_name: Name of that table.
        name: Of the channel.
        words: What the name says.
        unit: Unit that the file or the name states; empty if neither does.
        stated_by: ``file`` or ``name``; empty without a unit.
        values: As numbers, shape ``(n,)``; NaN where a cell is none. Empty for dates and text.
        dates: Whether it holds dates.
        low, high: Of the finite values; NaN if there are none.
        rising: Whether the values, or dates, hardly ever fall or stay.
        step: Median step between two rows.
    """

    table: int
    table_name: str
    name: str
    words: Words
    unit: str
    stated_by: str
    values: Array
    dates: bool
    low: float
    high: float
    rising: bool
    step: float

    def described(self) -> str:
        """Return its values in words."""
        if self.dates:
            return "dates"
        return "no numbers" if math.isnan(self.low) else f"values {self.low:.4g} to {self.high:.4g}"


def facts_of(tables: Sequence[LoggedTable]) -> list[ChannelFacts]:
    """Return every channel that a mapping could name: one whose name occurs once in its table."""
    found = []
    for index, table in enumerate(tables):
        names = [str(name) for name in table.channels.columns]
        for place, name in enumerate(names):
            if names.count(name) == 1:
                found.append(_facts(index, table, name, table.channels.iloc[:, place]))
    return found


def _facts(index: int, table: LoggedTable, name: str, raw: pd.Series[Any]) -> ChannelFacts:
    words = words_of(name)
    stated = table.units.get(name, "").strip()
    dates = pd.api.types.is_datetime64_any_dtype(raw.dtype)
    values = np.empty(0) if dates else _numbers(raw)
    finite = values[np.isfinite(values)]
    stamps = raw.dropna().astype("int64").to_numpy(dtype=np.float64) if dates else finite
    steps = np.diff(stamps)
    return ChannelFacts(
        table=index,
        table_name=table.name,
        name=name,
        words=words,
        unit=stated or words.unit,
        stated_by="name" if words.unit and stated in ("", words.unit) else ("file" if stated else ""),
        values=values,
        dates=bool(dates),
        low=float(finite.min()) if len(finite) else math.nan,
        high=float(finite.max()) if len(finite) else math.nan,
        rising=len(steps) > 2 and float(np.mean(steps > 0.0)) >= MOSTLY,
        step=float(np.median(steps)) if len(steps) else math.nan,
    )


def _numbers(raw: pd.Series[Any]) -> Array:
    if raw.dtype.kind in "mc":
        return np.empty(0)
    if pd.api.types.is_bool_dtype(raw.dtype):
        return np.empty(0)
    return np.asarray(pd.to_numeric(raw, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan))

"""What a channel of a logged file is: its unit, and what its values look like."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.formats.logged_table import RISING_SHARE, LoggedTable
from cylinder_friction.recordings.mapping.channel_words import Words, words_of
from cylinder_friction.recordings.mapping.units import quantity_of
from cylinder_friction.recordings.timeline.timestamps import stamps_to_datetimes


@dataclass(frozen=True)
class ChannelFacts:
    """One channel."""

    table: int  # Place of its table among the file's
    table_name: str
    name: str
    words: Words
    unit: str  # Unit that the file or the name states; empty if neither does
    stated_by: str  # ``file`` or ``name``; empty without a unit
    values: Array  # As numbers, shape ``(n,)``; NaN where a cell is none. Empty for dates and text.
    dates: bool  # Whether it holds dates
    # low, high: Of the finite values; NaN if there are none
    low: float
    high: float
    rising: bool  # Whether the values, or dates, rise and hardly ever fall; those of a coarse clock stay for some rows
    step: float  # Median step between two rows [its unit, dates in ns]
    mean_step: float  # From the first to the last [its unit, dates in ns]
    counts: bool  # Whether it steps by exactly 1
    leads: bool  # Whether it is the first channel of its table
    text: str  # Its first cell that is no number; empty if there is none

    def described(self) -> str:
        """Return its values in words."""
        if self.dates:
            return "dates"
        return "no numbers" if math.isnan(self.low) else f"values {self.low:.4g} to {self.high:.4g}"


def facts_of(tables: Sequence[LoggedTable]) -> list[ChannelFacts]:
    """Return every channel that a mapping could name: one whose name occurs once in its table."""
    return [
        _facts(index, table, str(name), table.channels[name], leads=name == table.channels.columns[0])
        for index, table in enumerate(tables)
        for name in table.channels.columns
        if (table.channels.columns == name).sum() == 1
    ]


def clocks_of(table: LoggedTable, known: Collection[str] = ()) -> list[ChannelFacts]:
    """Return the channels of a table that are time by name, unit and values, beside those ``known`` to be."""
    names = [str(name) for name in table.channels.columns if name not in known]
    named = [name for name in names if words_of(name).quantity == "time"]
    facts = [_facts(0, table, name, table.channels[name], leads=False) for name in named if named.count(name) == 1]
    return [fact for fact in facts if fact.rising and quantity_of(fact.unit) in (("time",) if fact.unit else (None,))]


def _facts(index: int, table: LoggedTable, name: str, raw: pd.Series[Any], *, leads: bool) -> ChannelFacts:
    words = words_of(name)
    stated = table.units.get(name, "").strip()
    dates = pd.api.types.is_datetime64_any_dtype(raw.dtype)
    values = np.empty(0) if dates else _numbers(raw)
    finite = values[np.isfinite(values)]
    stamps = stamps_to_datetimes(raw.dropna()).astype(np.int64) if dates else finite
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
        rising=len(steps) > 2 and bool((steps > 0.0).any()) and float(np.mean(steps >= 0.0)) >= RISING_SHARE,
        step=float(np.median(steps)) if len(steps) else math.nan,
        mean_step=float(stamps[-1] - stamps[0]) / len(steps) if len(steps) else math.nan,
        counts=len(steps) > 2 and float(np.mean(steps == 1.0)) >= RISING_SHARE,
        leads=leads,
        text=next((cell for cell in raw if isinstance(cell, str)), "") if raw.dtype.kind == "O" else "",
    )


def _numbers(raw: pd.Series[Any]) -> Array:
    if raw.dtype.kind in "mc" or pd.api.types.is_bool_dtype(raw.dtype):
        return np.empty(0)
    return np.asarray(pd.to_numeric(raw, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan))

"""Rate how well the channels of a logged file fit each column and each unit, and choose those that fit best."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import LOAD_FORCE, PRESSURES, QUANTITIES, SAMPLE_COLUMNS, TIME
from cylinder_friction.recordings.formats.cells import NEVER_FALLS, way_of
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.mapping.channel_words import Words, words_of
from cylinder_friction.recordings.mapping.units import column_scale, electrical, quantity_of
from cylinder_friction.recordings.timeline.timestamps import stamps_to_datetimes


@dataclass(frozen=True)
class ChannelFacts:
    """What names, units and values show about one channel."""

    table: int  # Index of its table in the file
    table_name: str
    name: str
    words: Words
    unit: str  # Unit that the file or the name states; empty without one
    stated_by: str  # Source of the unit, ``file`` or ``name``; empty without a unit
    dates: bool  # Whether its values are dates
    # low, high: Least and greatest finite value; NaN if there are none
    low: float
    high: float
    rising: bool  # Whether values or dates rise and hardly ever fall; a coarse clock may repeat them for some rows
    step: float  # Median step between two rows [its unit, dates in ns]
    mean_step: float  # Mean step from the first to the last row [its unit, dates in ns]
    counts: bool  # Whether every step is exactly 1
    leads: bool  # Whether it is the first channel of its table
    text: str  # Its first cell that is not a number; empty if there is none

    def described(self) -> str:
        """Describe its values in words."""
        if self.dates:
            return "dates"
        return "no numbers" if math.isnan(self.low) else f"values {self.low:.4g} to {self.high:.4g}"


def facts_of(tables: Sequence[LoggedTable]) -> list[ChannelFacts]:
    """Collect the facts of every channel that a mapping can name: its name must be unique in its table."""
    return [
        _facts(index, table, str(name), table.channels[name], leads=name == table.channels.columns[0])
        for index, table in enumerate(tables)
        for name in table.channels.columns
        if (table.channels.columns == name).sum() == 1
    ]


def clocks_of(table: LoggedTable, known: Collection[str] = ()) -> list[ChannelFacts]:
    """Find the channels of a table that are time by name, unit and values, besides those ``known`` to be time."""
    names = [str(name) for name in table.channels.columns if name not in known]
    named = [name for name in names if words_of(name).quantity == "time"]
    facts = [_facts(0, table, name, table.channels[name], leads=False) for name in named if named.count(name) == 1]
    return [fact for fact in facts if fact.rising and quantity_of(fact.unit) in (("time",) if fact.unit else (None,))]


def _facts(index: int, table: LoggedTable, name: str, raw: pd.Series[Any], *, leads: bool) -> ChannelFacts:
    words = words_of(name)
    stated = table.units.get(name, "").strip()
    dates = pd.api.types.is_datetime64_any_dtype(raw.dtype)
    numbers = np.empty(0) if dates else _numbers(raw)
    finite = numbers[np.isfinite(numbers)]
    stamps = stamps_to_datetimes(raw.dropna()).astype(np.int64) if dates else finite
    steps = np.diff(stamps)
    return ChannelFacts(
        table=index,
        table_name=table.name,
        name=name,
        words=words,
        unit=stated or words.unit,
        stated_by="name" if words.unit and stated in ("", words.unit) else ("file" if stated else ""),
        dates=bool(dates),
        low=float(finite.min()) if len(finite) else math.nan,
        high=float(finite.max()) if len(finite) else math.nan,
        rising=len(steps) > 2 and way_of(stamps) == 1,
        step=float(np.median(steps)) if len(steps) else math.nan,
        mean_step=float(stamps[-1] - stamps[0]) / len(steps) if len(steps) else math.nan,
        counts=len(steps) > 2 and float(np.mean(steps == 1.0)) >= NEVER_FALLS,
        leads=leads,
        text=next((cell for cell in raw if isinstance(cell, str)), "") if raw.dtype.kind == "O" else "",
    )


def _numbers(raw: pd.Series[Any]) -> Array:
    if raw.dtype.kind in "mc" or pd.api.types.is_bool_dtype(raw.dtype):
        return np.empty(0)
    return np.asarray(pd.to_numeric(raw, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan))


LIKELY_UNITS = {
    "time": (("s", 1e-5, 0.5), ("ms", 0.05, 500.0), ("us", 20.0, 1e6), ("100ns", 200.0, 1e7), ("d", 1e-10, 5e-6)),
    "pressure": (
        ("bar", 1.0, 700.0),
        ("Pa", 1e5, 7e7),
        ("kPa", 100.0, 7e4),
        ("psi", 15.0, 1e4),
        ("MPa", 0.1, 70.0),
        ("mbar", 1e3, 7e5),
    ),
    "length": (("m", 0.01, 2.0), ("mm", 2.0, 5000.0), ("in", 1.0, 100.0), ("cm", 1.0, 300.0)),
    "force": (("N", 100.0, 5e6), ("kN", 0.1, 5000.0)),
    "temperature": (("°C", -40.0, 120.0), ("°F", -40.0, 250.0)),
}
"""Units of each quantity, likeliest first, each with bounds of the greatest value on a common cylinder.

For time they bound the step, for length the travel. The pressures of one file share a unit, which all must fit.
"""

GREATEST_PRESSURE_PA = 7e7  # Pressure on the piston that gives the greatest credible force of a cylinder [Pa]


def usual_unit(column: str) -> str:
    return LIKELY_UNITS[QUANTITIES[column]][0][0] if QUANTITIES[column] != "length" else "mm"


Ranked = Sequence[tuple[ChannelFacts, float]]

SIDES = dict(zip(PRESSURES, (1, 2), strict=True))
EVEN_SHARE = 0.01
"""Largest difference between median and mean step of an even clock, as a share."""


def ranked_channels(column: str, facts: Sequence[ChannelFacts], clock_given: bool) -> Ranked:
    """List the channels that could fill a column with their scores, best first; equal ones in the file's order."""
    scores = [
        (channel, _time_score(channel, clock_given) if column == TIME else _score(column, channel)) for channel in facts
    ]
    return sorted(((channel, score) for channel, score in scores if score > 0.0), key=lambda entry: -entry[1])


def _score(column: str, channel: ChannelFacts) -> float:
    """Rate how well a channel fits a column; 0 or less if it does not fit."""
    quantity, words = QUANTITIES[column], channel.words
    measures = quantity_of(channel.unit) if channel.unit else None
    signal = electrical(channel.unit) is not None
    if channel.dates or not channel.low <= channel.high or (channel.unit and measures != quantity and not signal):
        return 0.0
    named = words.quantity == quantity
    # Any force may be in newtons, so only the name shows that it is a load.
    if not named and (measures != quantity or column == LOAD_FORCE):
        return 0.0
    if not named and words.quantity is not None:
        return 0.5
    side = SIDES.get(column)
    if side is not None and words.side not in (0, side):
        return 0.0
    score = 3.0 * named + 2.0 * (measures == quantity) + 2.0 * (side is not None and words.side == side)
    score += words.at_cylinder - words.at_valve - 1.0 * signal - 2.0 * (channel.low == channel.high)
    score -= 6.0 * words.wanted_value
    if column == LOAD_FORCE:
        score += words.carried
    return score


def _time_score(channel: ChannelFacts, clock_given: bool) -> float:
    """Rate how well a channel fits time. A row counter is not time, nor is any channel that happens to rise.

    Without a name or unit of time, only the first channel of a table may be time, if it rises evenly. A channel that is
    named time and steps by 1 is time if the unit of time is given.
    """
    named = channel.words.quantity == "time"
    if channel.dates:
        return 6.0 + named if channel.mean_step else 0.0
    if not channel.rising or (channel.unit and quantity_of(channel.unit) != "time"):
        return 0.0
    counts_rows = channel.counts and not channel.unit and not (named and clock_given)
    if channel.words.quantity not in (None, "time", "temperature") or counts_rows:
        return 0.0
    even = abs(channel.step - channel.mean_step) <= EVEN_SHARE * channel.mean_step
    if not (named or channel.unit or (channel.leads and even)):
        return 0.0
    return 1.0 + 4.0 * named + 2.0 * bool(channel.unit)


def fitting_units(column: str, channels: Sequence[ChannelFacts], cylinder: Cylinder | None = None) -> list[str]:
    """List the units that the values of all these channels fit, likeliest first; empty if they fit none."""
    quantity, greatest = QUANTITIES[column], np.inf
    sizes = {
        "time": [each.step or each.mean_step for each in channels],
        "length": [each.high - each.low for each in channels],
        "temperature": [each.high for each in channels],
    }.get(quantity, [max(abs(each.low), abs(each.high)) for each in channels])
    if cylinder is not None and quantity in ("length", "force"):
        greatest = 1.05 * cylinder.stroke_m if quantity == "length" else GREATEST_PRESSURE_PA * cylinder.piston_area_m2
    size = max(sizes)
    ticks = quantity == "time" and all("tick" in each.name.casefold() for each in channels)
    return [
        unit
        for unit, low, high in LIKELY_UNITS[quantity]
        if low <= size <= high
        and (not ticks or unit in ("ms", "100ns"))
        and (greatest == np.inf or size * column_scale(column, unit) <= greatest)
    ]


def channels_of_one_cylinder(ranked: dict[str, Ranked]) -> dict[str, ChannelFacts]:
    """Choose pressures and position of the cylinder that fits best; cylinders differ in the rest of the names.

    If no cylinder has all three, the best channel of each column is returned.
    """
    groups: dict[tuple[str, ...], dict[str, tuple[ChannelFacts, float]]] = {}
    for column in SAMPLE_COLUMNS:
        for channel, score in ranked[column]:
            group = groups.setdefault(channel.words.rest, {})
            if channel not in [taken for taken, _ in group.values()]:
                group.setdefault(column, (channel, score))
    whole = [group for group in groups.values() if len(group) == len(SAMPLE_COLUMNS)]
    if whole:
        best = max(whole, key=lambda group: sum(score for _, score in group.values()))
        return {column: best[column][0] for column in SAMPLE_COLUMNS}
    chosen: dict[str, ChannelFacts] = {}
    for column in SAMPLE_COLUMNS:
        take_first_free(column, ranked, chosen)
    return chosen


def take_first_free(column: str, ranked: dict[str, Ranked], chosen: dict[str, ChannelFacts]) -> None:
    """Add a column's best channel that fills no other column."""
    free = [channel for channel, _ in ranked[column] if channel not in chosen.values()]
    if free:
        chosen[column] = free[0]


def stamps_of(ranked: Ranked, chosen: dict[str, ChannelFacts]) -> dict[str, ChannelFacts]:
    """Find the time channel of each column: the best one in its table."""
    stamps: dict[str, ChannelFacts] = {}
    for column, channel in chosen.items():
        free = (time for time, _ in ranked if time.table == channel.table and time not in chosen.values())
        if (best := next(free, None)) is not None:
            stamps[column] = best
    return stamps

"""Guess a first mapping of a log from names, units and values."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    LOAD_FORCE,
    OIL_TEMPERATURE,
    POSITION,
    PRESSURES,
    QUANTITIES,
    SAMPLE_COLUMNS,
    TIME,
)
from cylinder_friction.recordings.formats.cells import NEVER_FALLS, way_of
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.mapping.channel_mapping import (
    ANOTHER_UNIT,
    electrical,
    known_units,
    of_stroke,
    quantity_of,
    stated_rate,
    stated_reference,
    to_column_unit,
    unit_in_name,
    units_agree,
)
from cylinder_friction.recordings.mapping.channel_words import Words, words_of
from cylinder_friction.recordings.recording import RecordingError

COARSE = 0.4  # Factor on the score of a clock whose stamps repeat, so that a finer clock with a unit has the steps
NEARLY = 3.0  # Largest distance from the best score of candidates that are also named
BELOW_ZERO = 0.05  # Share of its travel beyond which a position below zero does not count from the retracted end
MOST_TAGS, LEAST_RECURRENCE = 1000, 10
"""Most different names, and least mean number of rows per name, of a column that names channels."""
_ABSOLUTE = re.compile(r"absolut(?!e? ?(?:value|enc))|(?<![^\W_])abs(?![^\W_]|\(|\.? ?enc)", re.IGNORECASE)
_VALUES = re.compile(r"val|wert|messwert|reading|data", re.IGNORECASE)
LIKELY_UNITS = {
    "time": (("s ms us 100ns ns d", 2e-5, 0.5), ("min h", 4e-4, 0.029)),
    "pressure": (("bar Pa kPa psi MPa mbar", 1e5, 7e7),),
    "length": (("mm m in cm", 0.006, 5.0),),
    "force": (("N kN", 100.0, 5e6),),
    "temperature": (("°C °F", -40.0, 120.0),),
}
"""Units of each quantity, likeliest first, with bounds of the greatest value on a common cylinder in the column's unit.

For time they bound the step, for length the travel. The pressures of one file share a unit, which all must fit.
"""
GREATEST_PRESSURE_PA = 7e7  # Pressure on the piston that gives the greatest credible force of a cylinder [Pa]
SIDES = dict(zip(PRESSURES, (1, 2), strict=True))
STATE_RATE = "state the rate of the rows: --unit time=200Hz, or time_s: {rate_hz: 200} in the mapping"
EVEN_SHARE = 0.01  # Largest difference between median and mean step of an even clock, as a share


@dataclass(frozen=True)
class ChannelFacts:
    """What names, units and values show about one channel."""

    table: int  # Index of its table in the file
    table_name: str
    name: str
    words: Words
    unit: str  # Unit that the file or the name states; empty without one
    dates: bool  # Whether its values are dates
    count: int  # Number of its finite values or dates
    # low, high: Least and greatest finite value; NaN if there are none
    low: float
    high: float
    rising: bool  # Whether values or dates rise and hardly ever fall; a coarse clock may repeat them for some rows
    step: float  # Median step between two rows [its unit, dates in ns]
    mean_step: float  # Mean step from the first to the last row [its unit, dates in ns]
    counts: bool  # Whether every step is exactly 1
    bare: bool  # Whether it is whole numbers without a unit; a rate in the header shows that they are ms
    leads: bool  # Whether it is the first channel of its table
    text: str  # Its first cell that is not a number; empty if there is none

    def described(self) -> str:
        if self.dates:
            return "dates"
        return "no numbers" if math.isnan(self.low) else f"values {self.low:.4g} to {self.high:.4g}"


Ranked = Sequence[tuple[ChannelFacts, float]]
"""Channels with their scores for a column, best first; equal ones in the file's order."""


def facts_of(tables: Sequence[LoggedTable]) -> list[ChannelFacts]:
    """Collect the facts of every channel that a mapping can name: its name must be unique in its table."""
    return [_facts(index, table, name) for index, table in enumerate(tables) for name in _unique_names(table)]


def clocks_of(table: LoggedTable, known: Collection[str]) -> list[ChannelFacts]:
    """Find the channels of a table that are dates, or time by name and unit, besides those ``known`` to be time."""
    others = [name for name in _unique_names(table) if name not in known]
    timed = (name for name in others if table.channels[name].dtype.kind == "M" or words_of(name).quantity == "time")
    facts = (_facts(0, table, name) for name in timed)
    return [fact for fact in facts if fact.rising and quantity_of(fact.unit) == ("time" if fact.unit else None)]


def _unique_names(table: LoggedTable) -> list[str]:
    return [str(name) for name, count in Counter(table.channels.columns).items() if count == 1]


def _facts(index: int, table: LoggedTable, name: str) -> ChannelFacts:
    raw, words, stated = table.channels[name], words_of(name), table.units.get(name, "").strip()
    if dates := raw.dtype.kind == "M":
        finite, stamps = np.empty(0), raw.dropna().to_numpy("datetime64[ns]").astype(np.int64)
    else:
        numbers = pd.to_numeric(raw, errors="coerce").to_numpy(np.float64)
        finite = stamps = numbers[np.isfinite(numbers)]
    steps = np.diff(stamps)
    step, unit, own = float(np.median(steps)) if len(steps) else math.nan, stated or words.unit, unit_in_name(name)
    if stated and own and quantity_of(own) == quantity_of(stated) and not units_agree(stated, own):
        unit = f"{stated} or {own}"  # which is no known unit
    in_ms = table.rate_hz is not None and abs(1e-3 * step * table.rate_hz - 1.0) <= EVEN_SHARE
    return ChannelFacts(
        table=index,
        table_name=table.name,
        name=name,
        words=words,
        unit=unit,
        dates=dates,
        count=len(stamps),
        low=float(finite.min()) if len(finite) else math.nan,
        high=float(finite.max()) if len(finite) else math.nan,
        rising=len(steps) > 2 and way_of(stamps) == 1,
        step=step,
        mean_step=float(stamps[-1] - stamps[0]) / len(steps) if len(steps) else math.nan,
        counts=len(steps) > 2 and float(np.mean(steps == 1.0)) >= NEVER_FALLS,
        bare=not (dates or unit or in_ms) and bool((np.abs(finite - np.rint(finite)) < 1e-6).all()),
        leads=name == table.channels.columns[0],
        text=next((cell for cell in raw if isinstance(cell, str)), "") if raw.dtype.kind == "O" else "",
    )


def usual_unit(column: str) -> str:
    return LIKELY_UNITS[QUANTITIES[column]][0][0].split()[0]


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
    score += words.preference - 1.0 * signal - 2.0 * (channel.low == channel.high)
    return score + (column == LOAD_FORCE) * words.carried


def time_score(channel: ChannelFacts, clock_given: bool) -> float:
    """Rate how well a channel fits time. A row counter is not time, nor is any channel that happens to rise.

    Without a name or unit of time, only the first channel of a table may be time, if it rises evenly. A channel that is
    named time and steps by 1 is time if the unit of time is given. A part of the second, which begins anew, is not.
    """
    named = channel.words.quantity == "time"
    coarse = COARSE if channel.step == 0.0 else 1.0
    if channel.dates:
        return coarse * (6.0 + named) if channel.mean_step else 0.0
    if not channel.rising or (channel.unit and quantity_of(channel.unit) != "time"):
        return 0.0
    counts_rows = channel.counts and not channel.unit and not (named and clock_given)
    if channel.words.quantity not in (None, "time", "temperature") or counts_rows:
        return 0.0
    even = abs(channel.step - channel.mean_step) <= EVEN_SHARE * channel.mean_step
    if not (named or (channel.unit and channel.mean_step > 0.5 * channel.step) or (channel.leads and even)):
        return 0.0
    return coarse * (1.0 + (1.0 if channel.bare else 4.0) * named + 2.0 * bool(channel.unit))


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
    size = np.array(max(sizes))
    ticks = quantity == "time" and all("tick" in each.name.casefold() for each in channels)
    fitting = [
        unit
        for units, low, high in LIKELY_UNITS[quantity]
        for unit in units.split()
        if low <= to_column_unit(size, unit, column) <= min(high, greatest) and (not ticks or unit in ("ms", "100ns"))
    ]
    # A count may be of 10 ms or 100 us just as well. Ticks of 100 ns are .NET's.
    may_be_other = quantity == "time" and any(each.bare for each in channels) and not (ticks and fitting == ["100ns"])
    return [*fitting, ANOTHER_UNIT] if fitting and may_be_other else fitting


def channels_of_one_cylinder(ranked: dict[str, Ranked]) -> dict[str, ChannelFacts]:
    """Choose pressures and position with equal other words that fit best; none if no cylinder has all three."""
    groups: dict[tuple[str, ...], dict[str, tuple[ChannelFacts, float]]] = {}
    for column in SAMPLE_COLUMNS:
        for channel, score in ranked[column]:
            group = groups.setdefault(channel.words.rest, {})
            if channel not in [taken for taken, _ in group.values()]:
                group.setdefault(column, (channel, score))
    whole = [group for group in groups.values() if len(group) == len(SAMPLE_COLUMNS)]
    best = max(whole, key=lambda group: sum(score for _, score in group.values()), default={})
    return {column: best[column][0] for column in SAMPLE_COLUMNS if column in best}


@dataclass(frozen=True)
class GuessedColumn:
    """The guessed source of a column."""

    column: str
    channel: ChannelFacts | None  # The best guess; None if nothing fits
    # Its mapping as in a file, with an empty unit for dates, or a given rate in place of a time channel; else empty
    entry: dict[str, Any] = field(default_factory=dict)
    # reasons, checks: Reasons for the guess, and what the user should check, one sentence each
    reasons: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()
    others: tuple[ChannelFacts, ...] = ()  # Other channels that could be meant, best first
    names: tuple[str, ...] = ()  # Names of the guess and of those others that fit as well
    fitting: Sequence[str] | None = None  # Units that the values fit; None if the unit is stated or given

    @property
    def known(self) -> bool:
        """Whether the user need not state anything more about it; a percentage is of the stroke."""
        unit = self.entry.get("unit", "")
        return bool(self.entry) and (electrical(unit) is None or of_stroke(self.column, unit))

    @property
    def doubtful(self) -> bool:
        """Whether its values do not determine its unit; friction does not depend on temperature."""
        return self.fitting is not None and len(self.fitting) != 1 and self.column != OIL_TEMPERATURE


@dataclass(frozen=True)
class GuessedMapping:
    """A first mapping."""

    path: Path
    columns: dict[str, GuessedColumn]  # Guess of each column, the required ones first
    unused: tuple[ChannelFacts, ...]  # Channels that fill no column

    def to_dict(self) -> dict[str, Any]:
        """Return each column's guess, reasons and checks as JSON-compatible values."""
        return {
            name: {
                "channel": each.channel.name,
                "unit": each.entry["unit"],
                "reasons": list(each.reasons),
                "check": [*each.checks, *(f"{other.name!r} could be meant, too" for other in each.others)],
            }
            for name, each in self.columns.items()
            if each.channel is not None
        }


@np.errstate(over="ignore", invalid="ignore")  # damaged files may contain numbers near the limit of a float
def guess_mapping(
    tables: Sequence[LoggedTable], path: Path, cylinder: Cylinder | None = None, units: Mapping[str, str] | None = None
) -> GuessedMapping:
    """Guess a mapping of a file, as far as names, units and values determine one.

    The cylinder excludes units with which values exceed its stroke or force. ``units`` states units by quantity, for
    channels whose unit the file does not state; for time, a rate of the rows such as ``200 Hz`` is also allowed.
    """
    facts = facts_of(tables)
    units = units or {}
    rate_hz = stated_rate(units.get("time", ""))
    clock_given = "time" in units and rate_hz is None
    ranked: dict[str, Ranked] = {}
    for column in QUANTITIES:
        scores = [(each, time_score(each, clock_given) if column == TIME else _score(column, each)) for each in facts]
        ranked[column] = sorted((each for each in scores if each[1] > 0.0), key=lambda each: -each[1])
    chosen = channels_of_one_cylinder(ranked)

    def take_first_free(*columns: str) -> None:
        for column in columns:
            free = [channel for channel, _ in ranked[column] if channel not in chosen.values()]
            if free:
                chosen.setdefault(column, free[0])

    take_first_free(*SAMPLE_COLUMNS)
    take_first_free(*(() if any(column in chosen for column in SIDES) else (DRIVE_FORCE,)), LOAD_FORCE, OIL_TEMPERATURE)
    # A drive force replaces pressures if none was found.
    driven_by = (DRIVE_FORCE,) if DRIVE_FORCE in chosen else PRESSURES
    wanted = [TIME, *driven_by, POSITION, *(column for column in (LOAD_FORCE, OIL_TEMPERATURE) if column in chosen)]
    chosen = {column: channel for column, channel in chosen.items() if column in wanted}
    _refuse_repeated(tables, complete=all(column in chosen for column in wanted[1:]))
    why = "" if rate_hz else _time_unknown(ranked[TIME], facts)
    if POSITION not in chosen:
        _refuse_row_per_tag(tables, [time for time, _ in ranked[TIME]])
    stamps: dict[str, ChannelFacts] = {}
    for column, channel in chosen.items() if not (rate_hz or why) else ():
        free = [time for time, _ in ranked[TIME] if time.table == channel.table and time not in chosen.values()]
        stamps |= {column: _clock_of(channel, facts, free)} if free else {}
    time = next((stamps[column] for column in (*SAMPLE_COLUMNS, DRIVE_FORCE, *stamps) if column in stamps), None)
    if time is not None:
        chosen[TIME] = time
    elif not chosen and ranked[TIME] and not (rate_hz or why):
        chosen[TIME] = ranked[TIME][0][0]
    used = {id(channel) for channel in (*chosen.values(), *stamps.values())}
    columns = {column: _guessed(column, chosen, used, ranked[column], facts, cylinder, units) for column in wanted}
    if TIME not in chosen:
        rate_hz = rate_hz or tables[0].rate_hz
        entry, checks = {"rate_hz": rate_hz} if rate_hz else {}, (why,) if why else columns[TIME].checks
        columns[TIME] = GuessedColumn(TIME, None, entry, checks=checks)
    counts = Counter(channel.name for channel in facts)
    for column, channel in chosen.items():
        if column != TIME and counts[channel.name] > 1:
            columns[column].entry["table"] = channel.table_name
        if column in stamps and stamps[column].name != chosen[TIME].name:
            columns[column].entry["time"] = stamps[column].name
    return GuessedMapping(path, columns, tuple(channel for channel in facts if id(channel) not in used))


def _clock_of(channel: ChannelFacts, facts: Sequence[ChannelFacts], clocks: Sequence[ChannelFacts]) -> ChannelFacts:
    """Choose a channel's clock: the one beside it if clocks and channels are in turn, else the one as long as it."""
    there = [each for each in facts if each.table == channel.table]
    if [(each in clocks) == (there[0] in clocks) for each in there] == [True, False] * (len(there) // 2):
        return there[there.index(channel) ^ 1]
    found = min(clocks, key=lambda time: abs(time.count - channel.count))
    at = there.index(channel)  # without a clock before it, the last one stamps it if clocks are behind their channels
    nearest = next(each for each in [*there[:at][::-1], *there[:at:-1]] if each in clocks)
    differ = (nearest.unit, nearest.count) == (found.unit, found.count) and abs(nearest.low - found.low) > found.step
    if differ and there.index(nearest) - there.index(found) > 1:  # each may stamp the channels behind it
        raise RecordingError(
            f"{found.name!r} and {nearest.name!r} are two clocks that differ, and nothing shows which one stamps "
            f"{channel.name!r}; give a mapping whose columns name their own as time, or export one of the two"
        )
    return found


def _refuse_repeated(tables: Sequence[LoggedTable], complete: bool) -> None:
    """Refuse columns of one name, one of which may be needed; if the guess is not ``complete``, also unknown ones."""
    for table in tables:
        for name, count in Counter(map(str, table.channels.columns)).items():
            words = words_of(name)
            measures = words.quantity or quantity_of(table.units.get(name, words.unit)) or ("" if complete else "time")
            if count > 1 and words.side >= 0 and measures in ("time", "pressure", "length"):
                problem = f"{count} columns have the name {name!r}, so that no mapping can name one of them"
                raise RecordingError(f"{problem}; give each a name of its own in the file")


def _time_unknown(ranked: Ranked, facts: Sequence[ChannelFacts]) -> str:
    """State why no channel is accepted as time: first one named time that cannot be read; empty if one is."""
    if ranked and (ranked[0][0].dates or ranked[0][0].unit or ranked[0][0].words.quantity == "time"):
        return ""
    unread = (each for each in facts if each.words.quantity == "time" and each.text and math.isnan(each.low))
    if unreadable := next(unread, None):
        return (
            f"{unreadable.name!r} is named like time, but its cells cannot be read, such as {unreadable.text[:40]!r}; "
            f"expected dates, times of day, durations or numbers; correct them, or {STATE_RATE}"
        )
    count = next((each for each in facts if each.counts and not each.unit), None)
    if count is None or ranked:
        return ""
    return (
        f"{count.name!r} steps by exactly 1, so that it may count rows, and not time; {STATE_RATE}; or, if it is a "
        "clock, its unit: --unit time=ms, or unit: ms in the mapping"
    )


def _refuse_row_per_tag(tables: Sequence[LoggedTable], clocks: Sequence[ChannelFacts]) -> None:
    """Refuse a table with one row per value, which has a column of recurring names and a column of values."""
    for table in tables:
        for tags, cells in table.channels.items():
            names = list(dict.fromkeys(cell for cell in cells if isinstance(cell, str)))
            values = [str(name) for name in table.channels if _VALUES.search(str(name)) and name != tags]
            if not 2 <= len(names) <= MOST_TAGS or len(cells) < LEAST_RECURRENCE * len(names) or not values:
                continue
            finest = max((clock.name for clock in clocks), key=lambda name: table.channels[name].nunique(), default="")
            pivot = f"pivot(index={finest!r}, columns={tags!r}, values={values[0]!r})"
            raise RecordingError(
                f"holds one row per value: {tags!r} names {', '.join(map(repr, names[:4]))} in turn, and {values[0]!r} "
                f"holds their values; expected one column per channel; pivot it, in Python pandas.read_csv(...).{pivot}"
                ".to_csv('log.csv'), or let the logger write a column per channel"
            )


def _guessed(
    column: str,
    chosen: Mapping[str, ChannelFacts],
    used: Collection[int],
    ranked: Ranked,
    facts: Sequence[ChannelFacts],
    cylinder: Cylinder | None,
    units: Mapping[str, str],
) -> GuessedColumn:
    channel = chosen.get(column)
    if channel is None:
        return GuessedColumn(column, None, checks=_in_another_unit(column, facts))
    own = next(score for other, score in ranked if other is channel)
    free = [each for each in ranked if id(each[0]) not in used and (column != TIME or each[0].table == channel.table)]
    others = tuple(other for other, score in free if score >= own - NEARLY)
    names = (channel.name, *(other.name for other, score in free if score >= own))
    pair = [chosen[name] for name in PRESSURES if name in chosen] if column in SIDES else []
    reasons, checks = [_meaning(column, channel, pair)], _meaning_checks(column, channel, pair)
    unit, fitting, given = channel.unit, None, units.get(QUANTITIES[column])
    if channel.dates:
        unit, reasons = "", [*reasons, "holds dates"]
    elif unit or given is not None:
        unit, stated = (unit, "as stated") if unit else (str(given), "as given")
        reasons += [f"unit {unit} {stated}", channel.described()]
    else:
        alike = pair or [channel]
        fitting = fitting_units(column, [each for each in alike if not each.unit], cylinder)
        stated_units = [each.unit for each in alike if each.unit in fitting]
        unit, *more = sorted(fitting, key=lambda unit: unit not in stated_units) or [usual_unit(column)]
        also = (
            f"; {' or '.join(more)} would fit too" if more else "" if fitting else "; the values fit none of the usual"
        )
        reasons.append(f"{size_in_words(column, channel)}{f' fit {unit}' if fitting else f'; {unit} is usual'}")
        checks.append(f"the unit is stated nowhere{also}")
    if column in SIDES and _ABSOLUTE.search(channel.name) and stated_reference(unit) is None and not electrical(unit):
        unit = f"{unit} abs"
        checks.append("its name means absolute pressure, so that 1.01325 bar are subtracted")
    entry = {"channel": channel.name, "unit": unit}
    return GuessedColumn(column, channel, entry, tuple(reasons), tuple(checks), others, names, fitting)


def _in_another_unit(column: str, facts: Sequence[ChannelFacts]) -> tuple[str, ...]:
    """State which channel is named like a column, but in a unit of another quantity or one that is not known."""
    quantity, sides = QUANTITIES[column], (0, SIDES.get(column, 0))
    like = (each for each in facts if each.words.quantity == quantity and each.words.side in sides and each.unit)
    other = next((each for each in like if quantity_of(each.unit) != quantity), None)
    words = f"; expected {known_units(quantity)}; name the channel with its right unit, or rescale it in the file"
    return (f"{other.name!r} states the unit {other.unit!r}, which is none of {quantity}{words}",) if other else ()


def size_in_words(column: str, channel: ChannelFacts) -> str:
    return f"steps of {channel.step or channel.mean_step:.4g}" if column == TIME else channel.described()


def _meaning(column: str, channel: ChannelFacts, pair: Sequence[ChannelFacts]) -> str:
    """State why a channel was chosen for a column."""
    quantity, side = QUANTITIES[column].replace("length", "position"), SIDES.get(column)
    if side is not None and channel.words.side == side:
        pressure = "pressure, " if channel.words.quantity == "pressure" else ""
        return f"name means {pressure}{('piston', 'rod')[side - 1]} side"
    if any(each.words.side for each in pair):
        return f"the other pressure is the {('rod', 'piston')[SIDES[column] - 1]} side's"
    if channel.words.quantity == QUANTITIES[column]:
        return f"name means {quantity}"
    return "values rise steadily" if column == TIME else f"unit is one of {quantity}"


def _meaning_checks(column: str, channel: ChannelFacts, pair: Sequence[ChannelFacts]) -> list[str]:
    if column in SIDES and not any(each.words.side for each in pair):
        return ["which side it is was guessed from the order of the channels; swap the two if it is the other"]
    if column == DRIVE_FORCE:
        return ["no pressures were found, so the force stands in; it must be positive towards extension"]
    if column == POSITION and channel.low < -BELOW_ZERO * (channel.high - channel.low):
        return ["it falls below 0: write sign -1 if it counts down, and as offset its reading with the rod in"]
    return ["it must be positive when it resists extension"] if column == LOAD_FORCE else []

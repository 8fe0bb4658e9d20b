"""Guess a first mapping of a file from names, units and values, with reasons."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

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
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.mapping.channel_facts import (
    SIDES,
    ChannelFacts,
    Ranked,
    facts_of,
    fitting_units,
    ranked_channels,
    usual_unit,
)
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.mapping.units import (
    electrical,
    of_stroke,
    stated_rate,
)
from cylinder_friction.recordings.recording import RecordingError

SIDE_WORDS = {1: "piston side", 2: "rod side"}

NEARLY = 3.0  # Largest distance from the best score of candidates that are also named

BELOW_ZERO = 0.05
"""Share of its travel beyond which a position below zero shows that it does not count from the retracted end."""

MOST_TAGS, LEAST_RECURRENCE = 1000, 10
"""Most different names, and least mean number of rows per name, of a column that names channels."""
_VALUES = re.compile(r"val|wert|messwert|reading|data", re.IGNORECASE)


@dataclass(frozen=True)
class GuessedColumn:
    """The guessed source of a column."""

    column: str
    channel: ChannelFacts | None  # The best guess; None if nothing fits
    unit: str = ""  # Unit of that channel; empty for dates
    # reasons, checks: Reasons for the guess, and what the user should check, one sentence each
    reasons: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()
    others: tuple[ChannelFacts, ...] = ()  # Other channels that could be meant, best first
    fitting: tuple[str, ...] | None = None  # Units that the values fit; None if the unit is stated or given
    rate_hz: float | None = None  # Rate of the rows, if it is given in place of a time channel [Hz]

    @property
    def known(self) -> bool:
        """Whether the user need not state anything more about it; a percentage is of the stroke."""
        if self.channel is None:
            return self.rate_hz is not None
        return electrical(self.unit) is None or of_stroke(self.column, self.unit)


@dataclass(frozen=True)
class GuessedMapping:
    """A first mapping."""

    path: Path
    columns: dict[str, GuessedColumn]  # Guess of each column, the required ones first
    unused: tuple[ChannelFacts, ...]  # Channels that fill no column
    ambiguous: frozenset[str] = frozenset()  # Names of channels that occur in several tables
    stamps: dict[str, ChannelFacts] = field(default_factory=dict)  # Time channel of each column that has one

    def mapped(self, column: str) -> ChannelMapping:
        """Make the mapping of a column with a guessed channel, or of time with a given rate."""
        guessed = self.columns[column]
        if guessed.rate_hz is not None:
            return ChannelMapping(rate_hz=guessed.rate_hz)
        assert guessed.channel is not None
        table, time = self.place_of(column)
        return ChannelMapping(guessed.channel.name, guessed.unit, table=table, time=time)

    def place_of(self, column: str) -> tuple[str, str]:
        """Return the table and the time channel that a column's mapping must name; empty if not needed."""
        channel, stamp, main = self.columns[column].channel, self.stamps.get(column), self.columns[TIME].channel
        several = channel is not None and column != TIME and channel.name in self.ambiguous
        own = stamp is not None and main is not None and stamp.name != main.name
        return channel.table_name if channel and several else "", stamp.name if stamp and own else ""

    def to_dict(self) -> dict[str, Any]:
        """Return each column's guess, reasons and checks as JSON-compatible values."""
        return {
            name: {
                "channel": each.channel.name,
                "unit": each.unit,
                "reasons": list(each.reasons),
                "check": [*each.checks, *(f"{other.name!r} could be meant, too" for other in each.others)],
            }
            for name, each in self.columns.items()
            if each.channel is not None
        }


@np.errstate(over="ignore", invalid="ignore")  # damaged files may contain numbers near the limit of a float
def guess_mapping(
    tables: Sequence[LoggedTable],
    path: Path,
    cylinder: Cylinder | None = None,
    units: Mapping[str, str] | None = None,
) -> GuessedMapping:
    """Guess a mapping of a file, as far as names, units and values determine one.

    Args:
        tables: The tables of the file, with all channels loaded.
        path: Path of the file.
        cylinder: The recorded cylinder, to exclude units with which values exceed its stroke or force. None: any.
        units: Units by quantity, for channels whose unit the file does not state. For time, a rate of the rows such as
            ``200 Hz`` is also allowed.
    """
    facts = facts_of(tables)
    rate_hz = stated_rate((units or {}).get("time", ""))
    clock_given = "time" in (units or {}) and rate_hz is None
    ranked = {column: ranked_channels(column, facts, clock_given) for column in QUANTITIES}
    chosen = _of_one_cylinder(ranked)
    forces = (LOAD_FORCE,) if any(column in chosen for column in SIDES) else (DRIVE_FORCE, LOAD_FORCE)
    for column in (*forces, OIL_TEMPERATURE):
        _take_first_free(column, ranked, chosen)
    # A drive force replaces pressures if none was found.
    driven_by = (DRIVE_FORCE,) if DRIVE_FORCE in chosen else PRESSURES
    wanted = [TIME, *driven_by, POSITION, *(column for column in (LOAD_FORCE, OIL_TEMPERATURE) if column in chosen)]
    chosen = {column: channel for column, channel in chosen.items() if column in wanted}
    why = "" if rate_hz else _time_unknown(ranked[TIME], facts)
    if POSITION not in chosen:
        _refuse_row_per_tag(tables, [time for time, _ in ranked[TIME]])
    stamps = {} if rate_hz or why else _stamps(ranked[TIME], chosen)
    time = next((stamps[column] for column in (*SAMPLE_COLUMNS, DRIVE_FORCE, *stamps) if column in stamps), None)
    if time is not None:
        chosen[TIME] = time
    elif not chosen and ranked[TIME] and not (rate_hz or why):
        chosen[TIME] = ranked[TIME][0][0]
    used = {id(channel) for channel in (*chosen.values(), *stamps.values())}
    columns = {column: _guessed(column, chosen, ranked[column], cylinder, units or {}) for column in wanted}
    if TIME not in chosen:
        columns[TIME] = GuessedColumn(TIME, None, rate_hz=rate_hz, checks=(why,) if why else ())
    return GuessedMapping(
        path=path,
        columns=columns,
        unused=tuple(channel for channel in facts if id(channel) not in used),
        ambiguous=frozenset(name for name, count in Counter(channel.name for channel in facts).items() if count > 1),
        stamps=stamps,
    )


def _time_unknown(ranked: Ranked, facts: Sequence[ChannelFacts]) -> str:
    """State why no channel is accepted as time, and what to do; empty if one is.

    A channel that is named time but cannot be read is reported before channels that only rise.
    """
    if ranked and (ranked[0][0].dates or ranked[0][0].unit or ranked[0][0].words.quantity == "time"):
        return ""
    rate = "state the rate of the rows: --unit time=200Hz, or time_s: {rate_hz: 200} in the mapping"
    unread = (each for each in facts if each.words.quantity == "time" and each.text and math.isnan(each.low))
    if unreadable := next(unread, None):
        return (
            f"{unreadable.name!r} is named like time, but its cells cannot be read, such as {unreadable.text[:40]!r}; "
            f"expected dates, times of day, durations or numbers; correct them, or {rate}"
        )
    count = next((each for each in facts if each.counts and not each.unit), None)
    if count is None or ranked:
        return ""
    return (
        f"{count.name!r} steps by exactly 1, so that it may count rows, and not time; {rate}; or, if it is a clock, "
        "its unit: --unit time=ms, or unit: ms in the mapping"
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


def _of_one_cylinder(ranked: dict[str, Ranked]) -> dict[str, ChannelFacts]:
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
        _take_first_free(column, ranked, chosen)
    return chosen


def _take_first_free(column: str, ranked: dict[str, Ranked], chosen: dict[str, ChannelFacts]) -> None:
    free = [channel for channel, _ in ranked[column] if channel not in chosen.values()]
    if free:
        chosen[column] = free[0]


def _stamps(ranked: Ranked, chosen: dict[str, ChannelFacts]) -> dict[str, ChannelFacts]:
    """Find the time channel of each column: the best one in its table."""
    stamps: dict[str, ChannelFacts] = {}
    for column, channel in chosen.items():
        free = (time for time, _ in ranked if time.table == channel.table and time not in chosen.values())
        if (best := next(free, None)) is not None:
            stamps[column] = best
    return stamps


def _guessed(
    column: str,
    chosen: Mapping[str, ChannelFacts],
    ranked: Ranked,
    cylinder: Cylinder | None,
    units: Mapping[str, str],
) -> GuessedColumn:
    channel = chosen.get(column)
    if channel is None:
        return GuessedColumn(column, None, others=tuple(other for other, _ in ranked))
    taken = {id(other) for other in chosen.values()}
    least = next(score for other, score in ranked if other is channel) - NEARLY
    others = tuple(
        other
        for other, score in ranked
        if id(other) not in taken and score >= least and not (column == TIME and other.table != channel.table)
    )
    guess = _with_unit(GuessedColumn(column, channel, others=others), channel, chosen, cylinder, units)
    reasons, checks = (_meaning(column, channel), *guess.reasons), (*_meaning_checks(column, channel), *guess.checks)
    return replace(guess, reasons=reasons, checks=checks)


def _meaning(column: str, channel: ChannelFacts) -> str:
    """State why a channel was chosen for a column."""
    quantity = QUANTITIES[column].replace("length", "position")
    side = SIDES.get(column)
    if side is not None and channel.words.side == side:
        return f"name means {'pressure, ' if channel.words.quantity == 'pressure' else ''}{SIDE_WORDS[side]}"
    if channel.words.quantity == QUANTITIES[column]:
        return f"name means {quantity}"
    return "values rise steadily" if column == TIME else f"unit is one of {quantity}"


def _meaning_checks(column: str, channel: ChannelFacts) -> list[str]:
    if column in SIDES and channel.words.side == 0:
        return ["which side it is was guessed from the order of the channels; swap the two if it is the other"]
    if column in SIDES and channel.words.side_word == "head":
        return ["head is the rod side in most catalogues, but the piston side in some"]
    if column == DRIVE_FORCE:
        return ["no pressures were found, so the force stands in; it must be positive towards extension"]
    if column == POSITION and channel.low < -BELOW_ZERO * (channel.high - channel.low):
        return [
            "it falls below 0: write sign -1 if it counts down, and as offset what its sensor reads with the rod in"
        ]
    if column == LOAD_FORCE:
        return ["it must be positive when it resists extension"]
    return []


def _with_unit(
    guess: GuessedColumn,
    channel: ChannelFacts,
    chosen: Mapping[str, ChannelFacts],
    cylinder: Cylinder | None,
    units: Mapping[str, str],
) -> GuessedColumn:
    """Add the unit, its reasons and checks, and all fitting units if it is stated nowhere."""
    column, given = guess.column, units.get(QUANTITIES[guess.column])
    if channel.dates:
        return replace(guess, reasons=("holds dates",))
    if channel.unit or given is not None:
        unit, stated = (channel.unit, f"from the {channel.stated_by}") if channel.unit else (str(given), "as given")
        return replace(guess, unit=unit, reasons=(f"unit {unit} {stated}", channel.described()))
    alike = [chosen[name] for name in PRESSURES if name in chosen] if column in SIDES else [channel]
    fitting = fitting_units(column, [each for each in alike if not each.unit], cylinder)
    stated_units = [each.unit for each in alike if each.unit in fitting]
    first, *more = sorted(fitting, key=lambda unit: unit not in stated_units) or [usual_unit(column)]
    also = f"; {' or '.join(more)} would fit too" if more else "" if fitting else "; the values fit none of the usual"
    what = f"steps of {channel.step:.4g}" if column == TIME else channel.described()
    reason = f"{what} fit {first}" if fitting else f"{what}; {first} is usual"
    checks = (f"the unit is stated nowhere{also}",)
    return replace(guess, unit=first, reasons=(reason,), checks=checks, fitting=tuple(fitting))

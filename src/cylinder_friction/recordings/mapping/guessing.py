"""A first mapping of a file that nobody has described yet: guesses from names, units and values, with their reasons."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from cylinder_friction.arrays import Array
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
from cylinder_friction.recordings.epochs import epoch_of
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.mapping.channel_facts import ChannelFacts, facts_of
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.mapping.units import (
    column_scale,
    electrical,
    of_stroke,
    quantity_of,
    stated_rate,
    to_column_unit,
)
from cylinder_friction.recordings.recording import RecordingError

Ranked = Sequence[tuple[ChannelFacts, float]]

SIDES = dict(zip(PRESSURES, (1, 2), strict=True))
SIDE_WORDS = {1: "piston side", 2: "rod side"}

NEARLY = 3.0  # candidates within this distance of the best score are named beside it

BELOW_ZERO = 0.05
"""A position that falls below zero by more than this share of its travel does not count from the retracted end."""

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
"""Units of each quantity, likeliest first, and the bounds of the greatest value on a common cylinder.

For time of the step, for length of the travel. The pressures of one file share a unit, so all must fit it together.
"""

GREATEST_PRESSURE_PA = 7e7  # no force of a cylinder exceeds that of this pressure on its piston

PLAUSIBLE = {
    "pressure": (2e4, 7e7, "bar", 1e5, "greatest pressure"),
    "length": (2e-3, 20.0, "mm", 1e-3, "travel"),
    "force": (1.0, 2e7, "N", 1.0, "greatest force"),
}
"""Least and greatest for a cylinder, in the column's unit; the unit of messages and its scale; and the name."""

EVEN_SHARE = 0.01
"""The median step of an even clock differs from the mean step by no more than this share."""

AREA_RATIOS = (0.5, 0.7, 0.9)  # A2 over A1, which is not known yet: the sign must be the same for all of them

MOST_TAGS, LEAST_RECURRENCE = 1000, 10
"""Names of channels in a column: at most so many, each so many times."""
_VALUES = re.compile(r"val|wert|messwert|reading|data", re.IGNORECASE)

STROKE_SHARE = 0.02
"""Steps over which direction is taken are this share of the travel, so that noise does not count as motion."""


@dataclass(frozen=True)
class GuessedColumn:
    """Where a column may come from."""

    column: str
    channel: ChannelFacts | None  # The best guess; None if nothing fits
    unit: str = ""  # Of that channel; empty where it holds dates
    sign: int = 1
    # reasons, checks: For the guess, and what the user should look at, one sentence each
    reasons: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()
    others: tuple[ChannelFacts, ...] = ()  # Other channels that could be meant, best first
    fitting: tuple[str, ...] | None = None  # Units that the values fit; None where the unit is stated or given
    alternatives: tuple[str, ...] = ()  # What other files call the channel
    rate_hz: float | None = None  # Of time, if it is given in place of a channel

    @property
    def known(self) -> bool:
        """Whether nothing about it is left to be stated; a percentage is of the stroke."""
        if self.channel is None:
            return self.rate_hz is not None
        return electrical(self.unit) is None or of_stroke(self.column, self.unit)


@dataclass(frozen=True)
class GuessedMapping:
    """A first mapping."""

    path: Path
    columns: dict[str, GuessedColumn]  # By column, those that a recording needs first
    unused: tuple[ChannelFacts, ...]  # Channels that no column took
    ambiguous: frozenset[str] = frozenset()  # Names of channels that occur in several tables
    stamps: dict[str, ChannelFacts] = field(default_factory=dict)  # Time channel of each column that has one

    def mapped(self, column: str) -> ChannelMapping:
        """Return the mapping of a column for which a channel was found, or of time whose rate was given."""
        guessed = self.columns[column]
        if guessed.rate_hz is not None:
            return ChannelMapping(rate_hz=guessed.rate_hz)
        assert guessed.channel is not None
        table, time = self.place_of(column)
        return ChannelMapping(
            guessed.channel.name, guessed.unit, guessed.sign, table, time, alternatives=guessed.alternatives
        )

    def place_of(self, column: str) -> tuple[str, str]:
        """Return which table and which time channel a mapping must name for a column; empty if it need not."""
        channel, stamp, main = self.columns[column].channel, self.stamps.get(column), self.columns[TIME].channel
        several = channel is not None and column != TIME and channel.name in self.ambiguous
        own = stamp is not None and main is not None and stamp.name != main.name
        return channel.table_name if channel and several else "", stamp.name if stamp and own else ""

    def to_dict(self) -> dict[str, Any]:
        """Return the guess of every column with its reasons, and what to check, as JSON-compatible values."""
        return {
            name: {
                "channel": each.channel.name,
                "unit": each.unit,
                "sign": each.sign,
                "reasons": list(each.reasons),
                "check": [*each.checks, *(f"{other.name!r} could be meant, too" for other in each.others)],
            }
            for name, each in self.columns.items()
            if each.channel is not None
        }


@np.errstate(over="ignore", invalid="ignore")  # a damaged file may hold numbers at the limit of the representable
def guess_mapping(
    tables: Sequence[LoggedTable],
    path: Path,
    cylinder: Cylinder | None = None,
    units: Mapping[str, str] | None = None,
) -> GuessedMapping:
    """Return a first mapping of a file, as far as names, units and values determine one.

    Args:
        tables: The file's, with all channels loaded.
        path: Of the file.
        cylinder: Whose recording it is: units that exceed its stroke or force are left out. None: any.
        units: Units by quantity, for channels whose unit the file does not state; for time also the rate of the rows,
            ``200 Hz``.
    """
    facts = facts_of(tables)
    rate_hz = stated_rate((units or {}).get("time", ""))
    clock_given = "time" in (units or {}) and rate_hz is None
    ranked = {column: _ranked(column, facts, clock_given) for column in QUANTITIES}
    chosen = _of_one_cylinder(ranked)
    forces = (LOAD_FORCE,) if any(column in chosen for column in SIDES) else (DRIVE_FORCE, LOAD_FORCE)
    for column in (*forces, OIL_TEMPERATURE):
        _take_first_free(column, ranked, chosen)
    # A force stands in where no pressure was found.
    driven_by = (DRIVE_FORCE,) if DRIVE_FORCE in chosen else PRESSURES
    wanted = [TIME, *driven_by, POSITION, *(column for column in (LOAD_FORCE, OIL_TEMPERATURE) if column in chosen)]
    chosen = {column: channel for column, channel in chosen.items() if column in wanted}
    why = "" if rate_hz else _time_unknown(ranked[TIME], facts)
    if POSITION not in chosen:
        _refuse_row_per_tag(tables, [time for time, _ in ranked[TIME]])
    stamps = {} if rate_hz or why else _stamps(ranked[TIME], chosen, facts)
    time = next((stamps[column] for column in (*SAMPLE_COLUMNS, DRIVE_FORCE, *stamps) if column in stamps), None)
    if time is not None:
        chosen[TIME] = time
    elif not chosen and ranked[TIME] and not (rate_hz or why):
        chosen[TIME] = ranked[TIME][0][0]
    sign = position_sign(chosen)
    used = {id(channel) for channel in (*chosen.values(), *stamps.values())}
    columns = {
        column: _guessed(column, chosen, ranked[column], sign, _unit(column, chosen, cylinder, units or {}))
        for column in wanted
    }
    if TIME not in chosen:
        columns[TIME] = GuessedColumn(TIME, None, rate_hz=rate_hz, checks=(why,) if why else ())
    return GuessedMapping(
        path=path,
        columns=columns,
        unused=tuple(channel for channel in facts if id(channel) not in used),
        ambiguous=frozenset(name for name, count in Counter(channel.name for channel in facts).items() if count > 1),
        stamps=stamps,
    )


def _ranked(column: str, facts: Sequence[ChannelFacts], clock_given: bool) -> Ranked:
    """Return the channels that could fill a column, with their scores, best first, then in the file's order."""
    scores = [
        (channel, _time_score(channel, clock_given) if column == TIME else _score(column, channel)) for channel in facts
    ]
    return sorted(((channel, score) for channel, score in scores if score > 0.0), key=lambda entry: -entry[1])


def _score(column: str, channel: ChannelFacts) -> float:
    """Return how well a channel fits a column; 0 or less if not at all."""
    quantity, words = QUANTITIES[column], channel.words
    measures = quantity_of(channel.unit) if channel.unit else None
    signal = electrical(channel.unit) is not None
    if channel.dates or not channel.low <= channel.high or (channel.unit and measures != quantity and not signal):
        return 0.0
    named = words.quantity == quantity
    # Any force may be in newtons: only a name makes it a load.
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
    if not signal:
        score -= 1.5 * bool(
            suspicion(column, channel.unit or (fitting_units(column, [channel]) or [_usual(column)])[0], channel)
        )
    return score


def _time_score(channel: ChannelFacts, clock_given: bool) -> float:
    """Return how well a channel fits time. Rows that are counted are no time, nor is any channel that happens to rise.

    Without a name or a unit of time only the first channel of a table may be time, if it rises evenly. A channel that
    is named time and steps by 1 is time if the unit of time is given.
    """
    named = channel.words.quantity == "time"
    if channel.dates:
        return 6.0 + named if channel.mean_step else 0.0
    if not channel.rising or (channel.unit and quantity_of(channel.unit) != "time"):
        return 0.0
    if channel.words.quantity not in (None, "time", "temperature") or _counts_rows(channel, named and clock_given):
        return 0.0
    even = abs(channel.step - channel.mean_step) <= EVEN_SHARE * channel.mean_step
    if not (named or channel.unit or (channel.leads and even)):
        return 0.0
    return 1.0 + 4.0 * named + 2.0 * bool(channel.unit)


def _counts_rows(channel: ChannelFacts, unit_given: bool) -> bool:
    return channel.counts and not channel.unit and not unit_given


def _time_unknown(ranked: Ranked, facts: Sequence[ChannelFacts]) -> str:
    """Return why no channel may be taken for time, and what to do; empty if one may.

    What is named time but cannot be read comes before channels that only rise.
    """
    if ranked and (ranked[0][0].dates or ranked[0][0].unit or ranked[0][0].words.quantity == "time"):
        return ""
    rate = "state the rate of the rows: --unit time=200Hz, or time_s: {rate_hz: 200} in the mapping"
    unread = next(
        (each for each in facts if each.words.quantity == "time" and each.text and each.low != each.low), None
    )
    if unread is not None:
        return (
            f"{unread.name!r} is named like time, but its cells cannot be read, such as {unread.text[:40]!r}; expected "
            f"dates, times of day, durations or numbers; correct them, or {rate}"
        )
    count = next((each for each in facts if each.counts and not each.unit), None)
    if count is None or ranked:
        return ""
    return (
        f"{count.name!r} steps by exactly 1, so that it may count rows, and not time; {rate}; or, if it is a clock, "
        "its unit: --unit time=ms, or unit: ms in the mapping"
    )


def _refuse_row_per_tag(tables: Sequence[LoggedTable], clocks: Sequence[ChannelFacts]) -> None:
    """Refuse a table with one row per value: a column of names that recur, and a column of values."""
    for table in tables:
        for place, tags in enumerate(map(str, table.channels.columns)):
            cells = table.channels.iloc[:, place]
            names = list(dict.fromkeys(filter(_is_text, cells))) if cells.dtype.kind == "O" else []
            values = [str(name) for name in table.channels if _VALUES.search(str(name)) and str(name) != tags]
            if not 2 <= len(names) <= MOST_TAGS or len(cells) < LEAST_RECURRENCE * len(names) or not values:
                continue
            finest = max((clock.name for clock in clocks), key=lambda name: table.channels[name].nunique(), default="")
            pivot = f"pivot(index={finest!r}, columns={tags!r}, values={values[0]!r})"
            raise RecordingError(
                f"holds one row per value: {tags!r} names {', '.join(map(repr, names[:4]))} in turn, and {values[0]!r} "
                f"holds their values; expected one column per channel; pivot it, in Python pandas.read_csv(...).{pivot}"
                ".to_csv('log.csv'), or let the logger write a column per channel"
            )


def _is_text(cell: Any) -> bool:
    return isinstance(cell, str)


def _of_one_cylinder(ranked: dict[str, Ranked]) -> dict[str, ChannelFacts]:
    """Return pressures and position of the cylinder whose channels fit best; cylinders differ in the rest of the name.

    Where no cylinder has all three, the best of each column.
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


def _stamps(ranked: Ranked, chosen: dict[str, ChannelFacts], facts: Sequence[ChannelFacts]) -> dict[str, ChannelFacts]:
    """Return the time channel of each column: the best of its table, or the last one before it where they alternate.

    They alternate where a table has several time channels of one kind, each followed by channels of its rate.
    """
    free = [channel for channel, _ in ranked if channel not in chosen.values()]
    stamps: dict[str, ChannelFacts] = {}
    for column, channel in chosen.items():
        best = [time for time in free if time.table == channel.table]
        named = [time for time in best if time.words.quantity == "time" and time.dates == best[0].dates]
        table = [other for other in facts if other.table == channel.table]
        behind = {id(time) for time, other in pairwise(table) if other not in named}
        if len(named) > 1 and table[0] in named and all(id(time) in behind for time in named):
            best = [other for other in table[: table.index(channel)] if other in named][::-1]
        if best:
            stamps[column] = best[0]
    return stamps


def _guessed(
    column: str, chosen: dict[str, ChannelFacts], ranked: Ranked, position: tuple[int, str], unit: "_GuessedUnit"
) -> GuessedColumn:
    channel = chosen.get(column)
    if channel is None:
        return GuessedColumn(column, None, others=tuple(other for other, _ in ranked))
    taken = {id(other) for other in chosen.values()}
    least = next(score for other, score in ranked if other is channel) - NEARLY
    sign, why = position if column == POSITION else (1, "")
    return GuessedColumn(
        column=column,
        channel=channel,
        unit=unit.unit,
        sign=sign,
        reasons=(_meaning(column, channel), *unit.reasons),
        checks=(*_meaning_checks(column, channel), *unit.checks, *((why,) if why else ())),
        others=tuple(
            other
            for other, score in ranked
            if id(other) not in taken and score >= least and not (column == TIME and other.table != channel.table)
        ),
        fitting=unit.fitting,
    )


def _meaning(column: str, channel: ChannelFacts) -> str:
    """Return why a channel was taken for a column."""
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
        return ["it falls below 0; state as offset what the sensor reads with the rod in"]
    if column == LOAD_FORCE:
        return ["it must be positive when it resists extension"]
    return []


@dataclass(frozen=True)
class _GuessedUnit:
    unit: str = ""
    reasons: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()
    fitting: tuple[str, ...] | None = None


def _unit(
    column: str, chosen: Mapping[str, ChannelFacts], cylinder: Cylinder | None, units: Mapping[str, str]
) -> _GuessedUnit:
    """Return the unit, the reasons for it, what to check about it, and all that fit where it is stated nowhere."""
    channel, given = chosen.get(column), units.get(QUANTITIES[column])
    if channel is None or channel.dates:
        return _GuessedUnit(reasons=("holds dates",))
    if column == TIME and not channel.unit and (epoch := epoch_of(channel.values)) is not None:
        return _GuessedUnit(epoch.unit, (f"counts {epoch.counted} since {epoch.since}",), fitting=(epoch.unit,))
    if channel.unit or given is not None:
        unit = channel.unit or str(given)
        doubt = "" if electrical(unit) else suspicion(column, unit, channel)
        stated = f"from the {channel.stated_by}" if channel.unit else "as given"
        return _GuessedUnit(unit, (f"unit {unit} {stated}", channel.described()), (doubt,) if doubt else ())
    alike = [chosen[name] for name in PRESSURES if name in chosen] if column in SIDES else [channel]
    fitting = fitting_units(column, [each for each in alike if not each.unit], cylinder)
    stated_units = [each.unit for each in alike if each.unit in fitting]
    first, *others = sorted(fitting, key=lambda unit: unit not in stated_units) or [_usual(column)]
    also = (
        f"; {' or '.join(others)} would fit too" if others else "" if fitting else "; the values fit none of the usual"
    )
    what = f"steps of {channel.step:.4g}" if column == TIME else channel.described()
    reason = f"{what} fit {first}" if fitting else f"{what}; {first} is usual"
    return _GuessedUnit(first, (reason,), (f"the unit is stated nowhere{also}",), tuple(fitting))


def _usual(column: str) -> str:
    return LIKELY_UNITS[QUANTITIES[column]][0][0] if QUANTITIES[column] != "length" else "mm"


def fitting_units(column: str, channels: Sequence[ChannelFacts], cylinder: Cylinder | None = None) -> list[str]:
    """Return the units that the values of all these channels fit, likeliest first; empty if they fit none."""
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


def suspicion(column: str, unit: str, channel: ChannelFacts) -> str:
    """Return why a unit can hardly be right, or nothing."""
    if QUANTITIES[column] not in PLAUSIBLE:
        return ""
    least, greatest, shown_in, scale, what = PLAUSIBLE[QUANTITIES[column]]
    with np.errstate(over="ignore"):
        low, high = to_column_unit(np.array([channel.low, channel.high]), unit, column).tolist()
    size = high - low if QUANTITIES[column] == "length" else max(abs(low), abs(high))
    if least <= size <= greatest:
        return ""
    return f"{unit} would make the {what} {size / scale:.3g} {shown_in}; is that the unit?"


def position_sign(chosen: dict[str, ChannelFacts]) -> tuple[int, str]:
    """Return 1, or -1 with a sentence for the user where the position seems to count the other way.

    Friction takes work and gives none: with F = P1 - r·P2, less a cubic of position (any load that position alone
    decides), the residual must have the sign of the direction of motion.
    """
    known = [chosen[column] for column in SAMPLE_COLUMNS if column in chosen]
    if len(known) < len(SAMPLE_COLUMNS) or len({(channel.table, len(channel.values)) for channel in known}) > 1:
        return 1, ""
    if known[0].unit != known[1].unit or any(electrical(channel.unit) is not None for channel in known[:2]):
        return 1, ""
    finite = np.isfinite([channel.values for channel in known]).all(axis=0)
    first, second, position = (channel.values[finite] for channel in known)
    if not all(_force_with_direction(first - ratio * second, position) < 0.0 for ratio in AREA_RATIOS):
        return 1, ""
    pushes = "the pressures push against the motion, so that friction would drive the piston"
    if known[2].high > -known[2].low:  # counted the other way, all of it would lie before the retracted end
        return 1, (
            f"{pushes}: the two pressures are swapped, or the sign of both is reversed, or the position counts from "
            "the extended end; then write sign -1, and as offset what its sensor reads with the rod in"
        )
    return -1, f"sign -1 because {pushes}; it is 1 if the two pressures are swapped instead"


def _force_with_direction(force: Array, position: Array) -> float:
    """Return the part of a force that changes sign with the direction of motion, 0 where it is not significant."""
    travel = float(np.ptp(position)) if len(position) else 0.0
    if travel == 0.0:
        return 0.0
    # The rows at which the position has moved on by a step since the last such row.
    levels = np.floor((position - position.min()) / (STROKE_SHARE * travel))
    rows = np.concatenate([[0], np.flatnonzero(np.diff(levels) != 0.0) + 1])
    direction = np.sign(np.diff(position[rows]))
    middle = (rows[:-1] + rows[1:]) // 2
    if min((direction > 0).sum(), (direction < 0).sum()) < 5:
        return 0.0
    scaled = (position[middle] - position.min()) / travel
    columns = np.column_stack([np.ones_like(scaled), scaled, scaled**2, scaled**3, direction])
    solution = np.linalg.lstsq(columns, force[middle], rcond=None)[0]
    residual = force[middle] - columns @ solution
    uncertainty = float(np.std(residual)) / np.sqrt(len(residual))
    return float(solution[-1]) if abs(solution[-1]) > 4.0 * uncertainty else 0.0

"""A first mapping of a file that nobody has described yet: guesses from names, units and values, with their reasons."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.columns import DRIVE_FORCE, QUANTITIES
from cylinder_friction.recordings.mapping.channel_facts import ChannelFacts, facts_of
from cylinder_friction.recordings.mapping.fitting_units import fitting_units, suspicion
from cylinder_friction.recordings.mapping.sign_guess import position_sign
from cylinder_friction.recordings.mapping.unit_spelling import electrical
from cylinder_friction.recordings.mapping.units import quantity_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.recordings.formats.logged_table import LoggedTable

LOAD_FORCE, OIL_TEMPERATURE = "load_force_n", "oil_temperature_c"
TOGETHER = ("pressure_1_pa", "pressure_2_pa", "position_m")
"""Columns that must be of one cylinder."""

SIDES = {"pressure_1_pa": 1, "pressure_2_pa": 2}

NEARLY = 3.0
"""Candidates within so much of the best one's score are named beside it."""

BELOW_ZERO = 0.05
"""A position that falls below zero by more than this share of its travel does not count from the rod in."""

SIDE_WORDS = {1: "piston side", 2: "rod side"}


@dataclass(frozen=True)
class GuessedColumn:
    """Where a column may come from.

    Attributes:
        column: Of the recording.
        channel: The best guess; None if nothing fits.
        unit: Of that channel; empty where it holds dates.
        sign: 1 or -1.
        reasons: For the guess, one sentence each.
        checks: What the user should look at, one sentence each.
        others: Other channels that could be meant, best first.
        needed: Whether a recording is none without it.
    """

    column: str
    channel: ChannelFacts | None
    unit: str = ""
    sign: int = 1
    reasons: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()
    others: tuple[ChannelFacts, ...] = ()
    needed: bool = True


@dataclass(frozen=True)
class GuessedMapping:
    """A first mapping.

    Attributes:
        path: Of the file.
        columns: By column, those that a recording needs first.
        unused: Channels that no column took.
        several_tables: Whether a channel's name may not be enough to find it.
        stamps: Time channel of each table that has one, by the table's place in the file.
    """

    path: Path
    columns: dict[str, GuessedColumn]
    unused: tuple[ChannelFacts, ...]
    several_tables: bool = False
    stamps: dict[int, ChannelFacts] = field(default_factory=dict)


@np.errstate(over="ignore", invalid="ignore")  # a broken file may hold numbers at the limit of what there is
def guess_mapping(tables: Sequence[LoggedTable], path: Path) -> GuessedMapping:
    """Return a first mapping of a file, as far as names, units and values tell.

    Args:
        tables: What the file holds, all channels loaded.
        path: Of the file.
    """
    facts = facts_of(tables)
    ranked = {column: _ranked(column, facts) for column in QUANTITIES}
    chosen = _of_one_cylinder(ranked)
    forces = (LOAD_FORCE,) if any(column in chosen for column in SIDES) else (DRIVE_FORCE, LOAD_FORCE)
    for column in (*forces, OIL_TEMPERATURE):
        free = [channel for channel, _ in ranked[column] if channel not in chosen.values()]
        if free:
            chosen[column] = free[0]
    wanted = _columns_for(chosen)
    chosen = {column: channel for column, channel in chosen.items() if column in wanted}
    stamps = _stamps(ranked["time_s"], chosen)
    main = next((chosen[column].table for column in (*TOGETHER, DRIVE_FORCE) if column in chosen), None)
    time = stamps.get(main) if main is not None else next(iter(stamps.values()), None)
    if time is not None:
        chosen["time_s"] = time
    sign = position_sign(chosen)
    columns = {column: _guessed(column, chosen, ranked[column], needed, sign) for column, needed in wanted.items()}
    used = {id(channel) for channel in (*chosen.values(), *stamps.values())}
    return GuessedMapping(
        path=path,
        columns=columns,
        unused=tuple(channel for channel in facts if id(channel) not in used),
        several_tables=len({channel.table for channel in facts}) > 1,
        stamps=stamps,
    )


def _columns_for(chosen: dict[str, ChannelFacts]) -> dict[str, bool]:
    """Return the columns to write, and whether each is needed: a force stands in where no pressure was found."""
    driven_by = (DRIVE_FORCE,) if DRIVE_FORCE in chosen else tuple(SIDES)
    needed = dict.fromkeys(("time_s", *driven_by, "position_m"), True)
    return needed | {column: False for column in (LOAD_FORCE, OIL_TEMPERATURE) if column in chosen}


def _ranked(column: str, facts: Sequence[ChannelFacts]) -> list[tuple[ChannelFacts, float]]:
    """Return the channels that could fill a column, with their scores, best first, then in the file's order."""
    scores = [(channel, _score(column, channel)) for channel in facts]
    return sorted(((channel, score) for channel, score in scores if score > 0.0), key=lambda entry: -entry[1])


def _score(column: str, channel: ChannelFacts) -> float:
    """Return how well a channel fits a column; 0 or less if not at all."""
    quantity, words = QUANTITIES[column], channel.words
    if column == "time_s":
        return _time_score(channel)
    measures = quantity_of(channel.unit) if channel.unit else None
    signal = electrical(channel.unit) is not None
    if channel.dates or not channel.low <= channel.high or (channel.unit and measures != quantity and not signal):
        return 0.0
    named = words.quantity == quantity
    if not named and measures != quantity:
        return 0.0
    if not named and column == LOAD_FORCE:
        return 0.0  # any force may be in newtons
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
        score -= 1.5 * bool(suspicion(column, channel.unit or fitting_units(column, channel)[0], channel))
    return score


def _time_score(channel: ChannelFacts) -> float:
    named = channel.words.quantity == "time"
    if channel.dates:
        return 6.0 + named
    if not channel.rising or (channel.unit and quantity_of(channel.unit) != "time"):
        return 0.0
    if channel.words.quantity not in (None, "time", "temperature"):
        return 0.0
    return 1.0 + 4.0 * named + 2.0 * (quantity_of(channel.unit) == "time" if channel.unit else 0)


def _of_one_cylinder(ranked: dict[str, list[tuple[ChannelFacts, float]]]) -> dict[str, ChannelFacts]:
    """Return pressures and position of the cylinder whose channels fit best; cylinders differ in the rest of the name.

    Where no cylinder has all three, the best of each column.
    """
    groups: dict[tuple[str, ...], dict[str, tuple[ChannelFacts, float]]] = {}
    for column in TOGETHER:
        for channel, score in ranked[column]:
            group = groups.setdefault(channel.words.rest, {})
            if channel not in [taken for taken, _ in group.values()]:
                group.setdefault(column, (channel, score))
    whole = [group for group in groups.values() if len(group) == len(TOGETHER)]
    if whole:
        best = max(whole, key=lambda group: sum(score for _, score in group.values()))
        return {column: best[column][0] for column in TOGETHER}
    chosen: dict[str, ChannelFacts] = {}
    for column in TOGETHER:
        free = [channel for channel, _ in ranked[column] if channel not in chosen.values()]
        if free:
            chosen[column] = free[0]
    return chosen


def _stamps(ranked: Sequence[tuple[ChannelFacts, float]], chosen: dict[str, ChannelFacts]) -> dict[int, ChannelFacts]:
    """Return the best time channel of each table that another column comes from, or of every table if none does."""
    tables = {channel.table for channel in chosen.values()} or {channel.table for channel, _ in ranked}
    best: dict[int, ChannelFacts] = {}
    for channel, _ in ranked:
        if channel.table in tables and channel not in chosen.values():
            best.setdefault(channel.table, channel)
    return best


def _guessed(
    column: str,
    chosen: dict[str, ChannelFacts],
    ranked: Sequence[tuple[ChannelFacts, float]],
    needed: bool,
    position: tuple[int, str],
) -> GuessedColumn:
    channel = chosen.get(column)
    if channel is None:
        return GuessedColumn(column, None, others=tuple(other for other, _ in ranked), needed=needed)
    taken = [other for other in chosen.values() if other is not channel]
    scores = {id(other): score for other, score in ranked}
    others = tuple(
        other
        for other, score in ranked
        if other is not channel
        and not any(other is one for one in taken)
        and score >= scores[id(channel)] - NEARLY
        and not (column == "time_s" and other.table != channel.table)
    )
    unit, reasons, checks = _unit(column, channel)
    sign, why = position if column == "position_m" else (1, "")
    return GuessedColumn(
        column=column,
        channel=channel,
        unit=unit,
        sign=sign,
        reasons=(*_said(column, channel), *reasons),
        checks=(*_meaning_checks(column, channel), *checks, *((why,) if why else ())),
        others=others,
        needed=needed,
    )


def _said(column: str, channel: ChannelFacts) -> list[str]:
    """Return what the name tells of the column."""
    quantity = QUANTITIES[column].replace("length", "position")
    side = SIDES.get(column)
    if side is not None and channel.words.side == side:
        return [f"name says {'pressure, ' if channel.words.quantity == 'pressure' else ''}{SIDE_WORDS[side]}"]
    if channel.words.quantity == QUANTITIES[column]:
        return [f"name says {quantity}"]
    return ["values rise steadily"] if column == "time_s" else [f"unit is one of {quantity}"]


def _meaning_checks(column: str, channel: ChannelFacts) -> list[str]:
    if column in SIDES and channel.words.side == 0:
        return ["which side it is was guessed from the order of the channels; swap the two if it is the other"]
    if column in SIDES and channel.words.side_word == "head":
        return ["head is the rod side in most catalogues, but the piston side in some"]
    if column == DRIVE_FORCE:
        return ["no pressures were found, so the force stands in; it must be positive towards extension"]
    if column == "position_m" and channel.low < -BELOW_ZERO * (channel.high - channel.low):
        return ["it falls below 0; state as offset what the sensor reads with the rod in"]
    if column == LOAD_FORCE:
        return ["it must be positive when it resists extension"]
    return []


def _unit(column: str, channel: ChannelFacts) -> tuple[str, list[str], list[str]]:
    """Return the unit, the reasons for it, and what to check about it."""
    if channel.dates:
        return "", ["holds dates"], []
    if electrical(channel.unit) is not None:
        return channel.unit, [f"{channel.stated_by} says {channel.unit}", channel.described()], []
    if channel.unit:
        doubt = suspicion(column, channel.unit, channel)
        return (
            channel.unit,
            [f"{channel.stated_by} says {channel.unit}", channel.described()],
            [doubt] if doubt else [],
        )
    first, *alternatives = fitting_units(column, channel)
    also = f"; {' or '.join(alternatives)} would fit too" if alternatives else ""
    what = f"steps of {channel.step:.4g}" if column == "time_s" else channel.described()
    return first, [f"{what} fit {first}"], [f"the unit is stated nowhere{also}"]

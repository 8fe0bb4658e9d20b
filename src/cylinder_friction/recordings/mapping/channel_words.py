"""Interpret a channel's name: its quantity, its side of the piston, its place of measurement, its unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from cylinder_friction.recordings.mapping.channel_mapping import electrical, quantity_of, unit_in_name

TIME_NAMES = ("time", "t", "time_s", "timestamp", "timestamps", "zeit", "x_value", "name", "channel name")
"""Whole names of time channels, in lower case. X_Value is used by LabVIEW, Name by the TwinCAT Scope, Channel name by
DAQExpress."""


@dataclass(frozen=True)
class Vocabulary:
    """Separate words, and stems that may be part of a longer (German) word."""

    words: frozenset[str]
    stems: tuple[str, ...] = ()

    def rank(self, token: str) -> int:
        """Rate a match: 0 for none, 1 for one or two letters, 2 for a whole word."""
        if any(stem in token for stem in self.stems):
            return 2
        if token in self.words:
            return 2 if len(token) > 2 else 1
        return 0


def _words(words: str, stems: str = "") -> Vocabulary:
    return Vocabulary(frozenset(words.split()), tuple(stems.split()))


QUANTITY_WORDS = {
    "pressure": _words("p pr press pres", "druck pressure pression 压力 давлен"),
    "time": _words(
        "t time date datum seconds secs sek clock ticks",
        "zeit timestamp datetime elapsed sekunde mitternacht 时间 время",
    ),
    "temperature": _words("temp", "temperatur"),
    "length": _words(
        "x s xp pos weg hub stroke travel disp lage lvdt laser",
        "position displacement stellung wegauf 位移 перемещен положен",
    ),
    "friction": _words("", "friction reibung reibkraft"),  # computed elsewhere, so that it is no load
    "force": _words("f fx fz load last", "force kraft loadcell kraftmess"),
    "other": _words("v u vel speed acc", "velocity geschwindigkeit beschleunigung acceleration spannung voltage strom"),
}
"""Words for each quantity. If words of equal rank name two quantities, the first quantity is taken."""

PISTON_SIDE = _words("1 a cap bore blind bottom", "piston kolben boden fondello 无杆 поршнев")
ROD_SIDE = _words("2 b rod ring gland tige stelo", "stange annul ringseit ringraum rodside 有杆 штоков")
EITHER_SIDE = _words("head end side port chamber", "seite kammer")
"""Words that show no side alone. Either end is called the head, so that the name of the other pressure decides."""
ELSEWHERE = _words("s t 0 ls sys pump tank supply return system", "versorg pumpe speise rücklauf ruecklauf")
WANTED_VALUE = _words("ref set soll cmd sp target demand command", "sollw setpoint reference vorgabe consigne 指令")
AT_VALVE = _words("valve dcv", "ventil")
AT_CYLINDER = _words("cyl zyl", "cylinder zylinder")
CARRIED = _words("load last", "loadcell payload nutzlast")

_TOKEN = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+|\d+|[^\W\d_A-Za-zÄÖÜäöüß]+")
_ENDING = re.compile(r"^(?P<name>.*[^\s_.-])[\s_.-]+(?P<unit>[^\W\d_]+)$", re.DOTALL)
_BRACKETS = re.compile(r"[\[【［][^\]】］]*[\]】］]|[(（][^)）]*[)）]|/\s*\S+$")


@dataclass(frozen=True)
class Words:
    """The meaning of a name."""

    quantity: str | None  # Quantity; ``other`` for one that recordings do not contain, None if unknown
    side: int  # 1 for the piston side, 2 for the rod side, 0 if unknown, -1 for a pressure elsewhere
    unit: str  # Unit at the end of the name, as in ``jib_x_m``; empty without one
    preference: float  # Above 0 if it is measured at the cylinder; below 0 at a valve, and more so for a set point
    carried: bool  # Whether a force is called a load
    rest: tuple[str, ...]  # All other words of the name, in which the cylinders of one machine differ


@cache
def words_of(name: str) -> Words:
    """Interpret a channel's name."""
    bracketed = unit_in_name(name)
    plain, unit = (_BRACKETS.sub(" ", name), bracketed) if bracketed is not None else _without_unit(name)
    tokens = _tokens(plain)
    folded = [token.casefold() for token in tokens]
    whole = len(plain) > 1 and plain.strip().casefold() in TIME_NAMES
    quantity = "time" if whole else _quantity(tokens)
    if not unit and quantity in (None, "time") and len(last := folded[-1] if folded else "") > 1:
        counted = last == "ticks" or (len(folded) > 1 and folded[-2].isdecimal())  # of any length, such as 64us
        unit = last if quantity_of(last) == "time" and not counted else ""  # elapsedMillis
    vocabularies = ((2, ROD_SIDE), (1, PISTON_SIDE), (-1, ELSEWHERE))
    # A letter counts before a digit, which may be the number of a cylinder or an input.
    ranked = ((side, words.rank(token) - 0.5 * token.isdecimal()) for side, words in vocabularies for token in folded)
    # Single letters and digits show a side only beside a word for pressure, or alone in bar; a lone P is the supply.
    pressure = quantity == "pressure" or (len(tokens) == 1 and quantity_of(unit) == "pressure")
    sides = [(rank, side) for side, rank in ranked if rank == 2 or (rank > 0.0 and pressure)]
    wanted = any(WANTED_VALUE.rank(token) or token.endswith(("ref", "soll")) for token in folded)
    known = (*QUANTITY_WORDS.values(), PISTON_SIDE, ROD_SIDE, EITHER_SIDE, AT_VALVE, AT_CYLINDER)
    return Words(
        quantity=quantity,
        side=-1 if tokens == ["P"] else max(sides, key=lambda each: each[0], default=(0, 0))[1],
        unit=unit,
        preference=any(map(AT_CYLINDER.rank, folded)) - any(map(AT_VALVE.rank, folded)) - 6.0 * wanted,
        carried=any(map(CARRIED.rank, folded)),
        rest=tuple(token for token in folded if not any(vocabulary.rank(token) for vocabulary in known)),
    )


def _tokens(name: str) -> list[str]:
    """Split a name into words. ``PA`` and ``Pa`` are split into pressure and port, ``pa`` only as the whole name."""
    found = [str(word) for word in _TOKEN.findall(name)]
    ports = ("PA", "PB", "Pa", "Pb", *(("pa", "pb") if len(found) == 1 else ()))
    return [part for word in found for part in (word if word in ports else [word])]


def _without_unit(name: str) -> tuple[str, str]:
    """Split the unit off a name that ends with one, if it fits the rest of the name; return both."""
    match = _ENDING.match(name)
    if match is None or match["unit"] == "pA":  # the pressure at port A
        return name, ""
    unit, tokens = match["unit"], _tokens(match["name"])
    named, measures = _quantity(tokens), quantity_of(unit)
    words = QUANTITY_WORDS.get(measures or "", Vocabulary(frozenset()))  # of a path, which may name two quantities
    fits = any(words.rank(token.casefold()) for token in tokens) or (measures and named is None and len(unit) > 1)
    if fits or (electrical(unit) is not None and named not in (None, "other")):
        return match["name"], unit
    return name, ""


def _quantity(tokens: Sequence[str]) -> str | None:
    best, found, place = 0, None, 0
    for quantity, vocabulary in QUANTITY_WORDS.items():
        for index, word in enumerate(tokens):
            # A lone t is time, a lone T is temperature. Of two letters the first one counts: ``x_p`` is a position.
            lone = word == "T"
            rank = int(quantity == "temperature") if lone else vocabulary.rank(word.casefold())
            if rank > best or (rank == best == 1 and index < place):
                best, found, place = rank, quantity, -1 if lone else index
    return found

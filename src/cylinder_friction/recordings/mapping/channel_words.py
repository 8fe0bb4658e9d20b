"""What the name of a channel says, in the words that loggers and their users have for a cylinder's signals."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylinder_friction.recordings.formats.unit_names import unit_in_name
from cylinder_friction.recordings.mapping.unit_spelling import electrical
from cylinder_friction.recordings.mapping.units import quantity_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence


@dataclass(frozen=True)
class Vocabulary:
    """Words that stand alone, and stems that may be part of a longer (German) word."""

    words: frozenset[str]
    stems: tuple[str, ...] = ()

    def rank(self, token: str) -> int:
        """Return 0 for no hit, 1 for a letter or two, 2 for a whole word."""
        if any(stem in token for stem in self.stems):
            return 2
        if token in self.words:
            return 2 if len(token) > 2 else 1
        return 0


def _words(words: str, stems: str = "") -> Vocabulary:
    return Vocabulary(frozenset(words.split()), tuple(stems.split()))


QUANTITY_WORDS = {
    "pressure": _words("p pr press pres", "druck pressure"),
    "time": _words("t time date datum seconds secs sek clock", "zeit timestamp datetime"),
    "temperature": _words("temp", "temperatur"),
    "length": _words("x s xp pos weg hub stroke travel disp lage lvdt laser", "position displacement stellung wegauf"),
    "force": _words("f fx fz load last", "force kraft loadcell kraftmess friction reibung"),
    "other": _words("v u vel speed acc", "velocity geschwindigkeit beschleunigung acceleration spannung voltage strom"),
}
"""Words for each quantity; the first quantity wins where two are named in words of equal length."""

PISTON_SIDE = _words("1 a cap bore blind bottom", "piston kolben boden")
ROD_SIDE = _words("2 b rod ring head gland", "stange annul ringseit ringraum rodside")
ELSEWHERE = _words("s t 0 ls sys pump tank supply return system", "versorg pumpe speise rücklauf ruecklauf")
WANTED_VALUE = _words("ref set soll cmd sp target demand command", "sollw setpoint reference vorgabe")
AT_VALVE = _words("valve", "ventil")
AT_CYLINDER = _words("cyl zyl", "cylinder zylinder")
CARRIED = _words("load last", "loadcell payload nutzlast")

_TOKEN = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+|\d+|[^\W\d_A-Za-zÄÖÜäöüß]+")
_ENDING = re.compile(r"^(?P<name>.*[^\s_.-])[\s_.-]+(?P<unit>[^\W\d_]+)$", re.DOTALL)
_BRACKETS = re.compile(r"\[[^\]]*\]|\([^)]*\)|/\s*\S+$")


@dataclass(frozen=True)
class Words:
    """What a name says.

    Attributes:
        quantity: Which quantity, ``other`` for one that a recording does not hold, None if it does not say.
        side: 1 for the piston side, 2 for the rod side, 0 if it does not say, -1 for a pressure elsewhere.
        unit: Unit that the name itself ends in, for example of ``jib_x_m``; empty if none.
        wanted_value: Whether it is a set point.
        at_valve, at_cylinder: Where it is measured.
        carried: Whether a force is called a load.
        rest: What else the name says: cylinders of one machine differ here.
        side_word: The word that told the side.
    """

    quantity: str | None
    side: int
    unit: str
    wanted_value: bool
    at_valve: bool
    at_cylinder: bool
    carried: bool
    rest: tuple[str, ...]
    side_word: str


def words_of(name: str) -> Words:
    """Return what a channel's name says."""
    bracketed = unit_in_name(name)
    plain, unit = (_BRACKETS.sub(" ", name), bracketed) if bracketed is not None else _without_unit(name)
    tokens = _tokens(plain)
    folded = [token.casefold() for token in tokens]
    quantity = _quantity(tokens)
    side, side_word = _side(folded, quantity)
    wanted = any(_hit(WANTED_VALUE, token) or token.endswith(("ref", "soll")) for token in folded)
    known = (*QUANTITY_WORDS.values(), PISTON_SIDE, ROD_SIDE, AT_VALVE, AT_CYLINDER)
    return Words(
        quantity=quantity,
        side=side,
        unit=unit,
        wanted_value=wanted,
        at_valve=any(_hit(AT_VALVE, token) for token in folded),
        at_cylinder=any(_hit(AT_CYLINDER, token) for token in folded),
        carried=any(_hit(CARRIED, token) for token in folded),
        rest=tuple(token for token in folded if not any(_hit(vocabulary, token) for vocabulary in known)),
        side_word=side_word,
    )


def _tokens(name: str) -> list[str]:
    """Return the words of a name; ``PA`` is a pressure and a port, ``pa`` only where the name says nothing else."""
    found = [str(word) for word in _TOKEN.findall(name)]
    alone = len(found) == 1
    split = [
        list(word) if word in ("PA", "PB") or (alone and word.casefold() in ("pa", "pb")) else [word] for word in found
    ]
    return [word for words in split for word in words]


def _without_unit(name: str) -> tuple[str, str]:
    """Return a name without a unit at its end, and that unit, if it fits what stands before it."""
    match = _ENDING.match(name)
    if match is None:
        return name, ""
    unit, said = match["unit"], _quantity(_tokens(match["name"]))
    measures = quantity_of(unit)
    fits = measures is not None and (measures == said or (said is None and len(unit) > 1))
    if fits or (electrical(unit) is not None and said not in (None, "other")):
        return match["name"], unit
    return name, ""


def _quantity(tokens: Sequence[str]) -> str | None:
    best, found = 0, None
    for quantity, vocabulary in QUANTITY_WORDS.items():
        for word in tokens:
            # A lone t is time, a lone T is temperature.
            lone = word == "T"
            rank = int(quantity == "temperature") if lone else vocabulary.rank(word.casefold())
            if rank > best or (rank == best == 1 and _before(word, tokens, found)):
                best, found = rank, quantity
    return found


def _before(token: str, tokens: Sequence[str], found: str | None) -> bool:
    """Return whether a letter comes before the one that ``found`` was read from: ``x_p`` is a position."""
    vocabulary = QUANTITY_WORDS[found or "other"]
    others = [index for index, other in enumerate(tokens) if vocabulary.rank(other.casefold()) == 1]
    return bool(others) and tokens.index(token) < others[0]


def _side(tokens: Collection[str], quantity: str | None) -> tuple[int, str]:
    """Return the side and its word; letters and digits tell one only behind a word for pressure."""
    for side, vocabulary in ((2, ROD_SIDE), (1, PISTON_SIDE), (-1, ELSEWHERE)):
        for token in tokens:
            rank = vocabulary.rank(token)
            if rank == 2 or (rank == 1 and quantity == "pressure"):
                return side, token
    return 0, ""


def _hit(vocabulary: Vocabulary, token: str) -> bool:
    return vocabulary.rank(token) > 0

"""Units as FMI defines them: exponents of the SI base units, and what a host may show instead."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """A unit.

    Attributes:
        exponents: Of the SI base units, by FMI's names of them.
        shown_as: Display unit and its factor: value in it = factor x value in this unit.
    """

    exponents: dict[str, int]
    shown_as: tuple[str, float] | None = None


UNITS = {
    "s": Unit({"s": 1}),
    "Pa": Unit({"kg": 1, "m": -1, "s": -2}, ("bar", 1e-5)),
    "m": Unit({"m": 1}, ("mm", 1e3)),
    "N": Unit({"kg": 1, "m": 1, "s": -2}, ("kN", 1e-3)),
}

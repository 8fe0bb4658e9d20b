"""Units where a header states them: 'P1 [bar]', 'P1 (bar)', 'P1 / bar', or a line of their own."""

from __future__ import annotations

import re

_KNOWN = frozenset(
    unit.strip()
    for line in (
        "s, sec, second, seconds, ms, us, µs, μs, ns, min, h",
        "pa, hpa, kpa, mpa, bar, mbar, psi, psig, psia, atm, kg/cm²",
        "m, dm, cm, mm, um, µm, μm, nm, in, inch, ft, mil",
        "n, kn, mn, un, µn, lbf, lb, lbs, kip, kgf, kg, t, g",
        "v, mv, uv, µv, a, ma, ua, hz, khz, mhz, °c, degc, deg_c, celsius, c, k, °f, degf, f",
        "m/s, mm/s, m/s², m/s2, m/s^2, mm/s², g/s, rpm, 1/min, 1/s, u/min, min-1, rad/s, °/s, rad, deg, °, %",
        "l/min, lpm, l/s, m³/s, cm³/s, nm, n·m, n*m, w, kw, j, ohm, ω",
        "counts, count, cnt, digits, digit, bit, bits, lsb, raw, -",
    )
    for unit in line.split(",")
)
"""Units in use, in small letters."""
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[\s*(?P<unit>[^\[\]]*?)\s*\]$")
_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\(\s*(?P<unit>[^()]*?)\s*\)$")
_DIVIDED = re.compile(r"^(?P<name>\S+?\s*/\s*|.*\S (?:in|/) )(?P<unit>\S+)$")
_DATE_PATTERN = re.compile(r"^(?=.*([dmyjths])\1)[dmyjths]+(?:[-/.:, ]+[dmyjthsfz0]+)+$", re.IGNORECASE)
"""What stands in the place of a unit above dates: 'dd.mm.yyyy hh:mm:ss', 'TT.MM.JJJJ hh:mm'."""
_PORTS = frozenset("abptxyckfgh")
"""Single letters in parentheses that name a port or an axis sooner than a unit: 'pressure (A)'."""


def looks_like_unit(text: str) -> bool:
    return text.casefold() in _KNOWN


def unit_in_name(name: str) -> str | None:
    """Return the unit that a header cell states, or None.

    What stands in square brackets is taken at its word, unless it is an index such as ``axis[1]``; what stands in
    parentheses or behind a stroke only if it is a unit in use, for it may be a remark.
    """
    match = _BRACKETS.match(name)
    if match and match["unit"] and not match["unit"].isdigit():
        return match["unit"]
    for pattern in (_PARENTHESES, _DIVIDED):
        match = pattern.match(name)
        if match and looks_like_unit(match["unit"]) and match["unit"].casefold() not in _PORTS:
            return match["unit"]
    return None


def units_in_line(cells: list[str]) -> list[str] | None:
    """Return the units of a line that holds nothing else; None if it is no such line.

    Where a cell is empty, or is the format of the dates below it, its unit is ''.
    """
    units = []
    for cell in cells:
        bare = cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell
        if _DATE_PATTERN.match(bare) and not looks_like_unit(bare):
            bare = cell = ""
        if bare and bare == cell and not looks_like_unit(bare):
            return None
        units.append(bare)
    return units if any(units) else None

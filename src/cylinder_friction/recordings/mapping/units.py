"""Convert loggers' units (``[Bar]``, ``degC``, ``kp/cm²``, ``barg``) to SI units, gauge pressure and °C."""

import math
import re
import unicodedata
from functools import cache
from typing import Literal

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import POSITION, QUANTITIES
from cylinder_friction.recordings.recording import RecordingError

_SPELLINGS: dict[str, dict[float | tuple[float, float], str]] = {
    "time": {
        1.0: "s sec secs second seconds sek sekunde sekunden", 1e-3: "ms msec", 1e-6: "us μs usec", 1e-9: "ns",
        1e-7: "100ns ticks", 60.0: "min minute minutes minuten", 3600.0: "h hr hour hours std", 86400.0: "d day",
    },
    "pressure": {
        1.0: "Pa N/m2", 1e3: "kPa kN/m2", 1e6: "MPa N/mm2", 1e5: "bar", 1e2: "mbar hPa",
        6894.757293168362: "psi lbf/in2 lb/in2", 6894757.293168361: "ksi",
        98066.5: "kgf/cm2 kg/cm2 kp/cm2 at", 101325.0: "atm",
    },
    "length": {
        1.0: "m meter metre", 1e-3: "mm", 1e-2: "cm", 1e-6: "um μm micron",
        0.0254: "in inch inches zoll", 0.3048: "ft", 2.54e-5: "mil thou",
    },
    # A load cell may display the mass that hangs on it; the force is its weight.
    "force": {
        1.0: "N newton", 1e-6: "uN μN", 10.0: "daN", 1e3: "kN",
        4.4482216152605: "lbf lb lbs", 4448.2216152605: "kip kips",
        9.80665: "kgf kp kg", 9806.65: "tf t",
    },
    "temperature": {
        1.0: "°C degC gradC C celsius", (1.0, -273.15): "K kelvin", (5.0 / 9.0, -160.0 / 9.0): "°F degF F fahrenheit",
    },
}  # fmt: skip
"""Spellings of the units of each quantity, separated by blanks, by their factor (and offset) to the column's unit.

Upper and lower case are equivalent, and so are ``cm²``, ``cm2`` and ``cm^2``.
"""
_CONVERSIONS = {
    quantity: {
        name.casefold(): scale if isinstance(scale, tuple) else (scale, 0.0)
        for scale, names in spellings.items()
        for name in names.split()
    }
    for quantity, spellings in _SPELLINGS.items()
}

_SIGNALS = {
    "V": "V volt volts", "mV": "mV", "mA": "mA", "μA": "μA uA", "%": "%",
    "count": "count counts cnt cnts digit digits lsb raw inc increments",
}  # fmt: skip
ELECTRICAL = {name.casefold(): signal for signal, names in _SIGNALS.items() for name in names.split()}
"""Electrical signals, which need the sensor's range. A is left out, because it often names a port."""

OTHER_QUANTITIES = {
    "m/s", "mm/s", "cm/s", "in/s", "m/s2", "mm/s2", "m/min", "l/min", "lpm", "gpm", "l/s", "m3/s", "cm3/s", "mm2/s",
    "rpm", "1/min", "u/min", "rad/s", "°/s", "rad", "deg", "°", "%", "nm", "n·m", "n*m", "w", "kw", "hz", "khz", "a",
}  # fmt: skip
"""Units of other quantities that loggers record, in lower case."""

_RARE = "psig psia kg/cm² dm g mN uN μN uV μV MHz deg_c m/s² m/s^2 mm/s² g/s 1/s min-1 J ohm Ω m³/s cm³/s bit bits -"
KNOWN = frozenset().union(*_CONVERSIONS.values(), ELECTRICAL, OTHER_QUANTITIES, _RARE.casefold().split())
"""All known units, in lower case."""

_PORTS = frozenset("ABCFGHKPTXY")
"""Single letters that more probably name a port or an axis than a unit: 'pressure (A)'."""
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[\s*(?P<unit>[^\[\]]*?)\s*\]$")
_IN_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\(\s*(?P<unit>[^()]*?)\s*\)$")
_DIVIDED = re.compile(r"^(?P<name>\S+?\s*/\s*|.*\S (?:in|/) )(?P<unit>\S+)$")
_BRACKETS = {"[": "]", "(": ")", "{": "}", "<": ">"}
_REFERENCE = re.compile(r"(?P<unit>.+?)[ _,.-]*\(?(?:(?P<absolute>a|abs|absolute?)|g|gauge|rel|relativ|ü)\.?\)?", re.I)


@cache
def bare(unit: str) -> str:
    """Strip brackets, quotes and blanks from a unit, and replace ``cm²`` by ``cm2`` and ``℃`` by ``°C``."""
    text = unicodedata.normalize("NFKC", unit).strip().strip("\"'").strip()
    while len(text) > 1 and _BRACKETS.get(text[0]) == text[-1]:
        text = text[1:-1].strip()
    return text


def _squeezed(text: str) -> str:
    return "".join(text.split()).casefold().replace("^", "").replace("**", "")


def electrical(unit: str) -> str | None:
    """Return V, mV, mA, μA, count or % if a unit is a sensor's signal; else None."""
    return ELECTRICAL.get(_squeezed(bare(unit)))


def of_stroke(column: str, unit: str) -> bool:
    """Check whether a column is a percentage of the stroke."""
    return column == POSITION and electrical(unit) == "%"


@cache
def conversion(unit: str, quantity: str) -> tuple[float, float] | None:
    """Look up scale and offset to the column's unit; None if the unit does not measure this quantity."""
    text, known = bare(unit), _CONVERSIONS[quantity]
    found = known.get(_squeezed(text))
    if found is None and quantity == "pressure" and (match := _REFERENCE.fullmatch(text)):
        return known.get(_squeezed(match["unit"]))
    return found


@cache
def quantity_of(unit: str) -> str | None:
    """Find the quantity of a recording that a unit measures; None if there is none."""
    return next((quantity for quantity in _CONVERSIONS if conversion(unit, quantity) is not None), None)


@cache
def stated_reference(unit: str) -> Literal["gauge", "absolute"] | None:
    """Read the reference that a unit of pressure includes: ``bara``, ``psi(g)``; None if it includes none."""
    text, known = bare(unit), _CONVERSIONS["pressure"]
    match = _REFERENCE.fullmatch(text)
    if _squeezed(text) in known or match is None or _squeezed(match["unit"]) not in known:
        return None
    return "absolute" if match["absolute"] else "gauge"


def stated_rate(unit: str) -> float | None:
    """Read a rate that is given in place of a unit of time, such as ``200 Hz`` [Hz]; None for a unit."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(k?)hz", unit.strip(), re.IGNORECASE)
    return float(match[1]) * (1e3 if match[2] else 1.0) if match else None


def unit_in_name(name: str) -> str | None:
    """Find the unit in a header cell; None without one.

    Text in square brackets is a unit, unless it is an index such as ``axis[1]``. Text in parentheses or after a slash
    may be a remark, and is a unit only if it is known.
    """
    match = _IN_BRACKETS.match(name)
    if match and match["unit"] and not match["unit"].isdigit():
        return match["unit"]
    for pattern in (_IN_PARENTHESES, _DIVIDED):
        match = pattern.match(name)
        if match and match["unit"].casefold() in KNOWN and match["unit"].upper() not in _PORTS:
            return match["unit"]
    return None


def names_a_unit(text: str) -> bool:
    """Check whether text in a header is meant as a unit; a single capital often names a port, and ``rod`` a side."""
    text = bare(text)
    if len(text) == 1 and text in _PORTS:
        return False
    return electrical(text) is not None or quantity_of(text) is not None or text.casefold() in OTHER_QUANTITIES


def check_unit(column: str, unit: str) -> tuple[float, float]:
    """Return scale and offset to the column's unit; refuse a unit that is unknown or of another quantity."""
    wanted = QUANTITIES[column]
    if wanted == "pressure" and bare(unit) == "mPa":
        raise RecordingError(f"column {column!r}: unit {unit!r} is millipascal; write MPa for megapascal")
    if (found := conversion(unit, wanted)) is not None:
        return found
    if electrical(unit) is not None:
        raise RecordingError(
            f"column {column!r}: unit {unit!r} is a sensor's electrical signal, but the column holds a {wanted}; "
            "state the sensor: {range: [low, high], unit: ..., signal: [low, high]}"
        )
    measured = quantity_of(unit)
    problem = "is not known" if measured is None else f"measures {measured}, but the column holds a {wanted}"
    usual = ", ".join(names.split()[0] for names in _SPELLINGS[wanted].values())
    raise RecordingError(f"column {column!r}: unit {unit!r} {problem}; expected one of {usual}")


def to_column_unit(values: Array, unit: str, column: str) -> Array:
    """Convert values in ``unit`` to the column's unit; return values already in that unit unchanged.

    Temperatures are converted with their zero: 32 °F is 0 °C. Raises as ``check_unit``.
    """
    scale, offset = check_unit(column, unit)
    scaled = values if scale == 1.0 else values * scale
    return scaled if offset == 0.0 else scaled + offset


def column_scale(column: str, unit: str) -> float:
    """Return the factor from ``unit`` to the column's unit for differences: 1 °F is 5/9 °C."""
    return check_unit(column, unit)[0]


@cache
def units_agree(stated: str, configured: str) -> bool:
    """Check whether the unit that a file states for a channel agrees with the configured unit.

    Spelling does not matter (``[Bar]`` and ``bar`` agree), nor does the reference of a pressure. Text that is not a
    known unit (``rod side``, ``A``, ``-``) contradicts nothing.
    """
    quantity, signal = quantity_of(configured), electrical(configured)
    if bare(stated) == bare(configured) or not names_a_unit(stated) or (quantity is None and signal is None):
        return True
    if signal is not None or quantity is None:
        plain = {signal, electrical(stated)} == {"count", "%"}  # both are plain numbers, whose range the sensor states
        return plain or electrical(stated) == signal
    one, two = conversion(stated, quantity), conversion(configured, quantity)
    return one is not None and two is not None and math.isclose(one[0], two[0]) and one[1] == two[1]

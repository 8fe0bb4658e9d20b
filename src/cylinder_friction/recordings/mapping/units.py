"""Units as loggers write them (``[Bar]``, ``degC``, ``kp/cm²``, ``barg``), converted to SI, gauge pressure and °C."""

import math
import re
import unicodedata
from functools import cache
from typing import Literal

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import POSITION, QUANTITIES
from cylinder_friction.recordings.recording import RecordingError

_SPELLINGS: dict[str, dict[float, str]] = {
    "time": {
        1.0: "s sec secs second seconds sek sekunde sekunden", 1e-3: "ms msec", 1e-6: "us μs usec", 1e-9: "ns",
        1e-7: "100ns ticks", 60.0: "min minute minutes minuten", 3600.0: "h hr hour hours std", 86400.0: "d day",
    },
    "pressure": {
        1.0: "Pa N/m2", 1e2: "hPa mbar", 1e3: "kPa kN/m2", 1e6: "MPa N/mm2", 1e5: "bar",
        6894.757293168362: "psi lbf/in2 lb/in2", 6894757.293168361: "ksi",
        98066.5: "kgf/cm2 kg/cm2 kp/cm2 at", 101325.0: "atm",
    },
    "length": {
        1.0: "m meter metre", 1e-2: "cm", 1e-3: "mm", 1e-6: "um μm micron",
        0.0254: "in inch inches zoll", 0.3048: "ft", 2.54e-5: "mil thou",
    },
    # A load cell's display shows what hangs on it: as a force, a mass can only mean its weight.
    "force": {
        1.0: "N newton", 1e-6: "uN μN", 10.0: "daN", 1e3: "kN",
        4.4482216152605: "lbf lb lbs", 4448.2216152605: "kip kips",
        9.80665: "kgf kp kg", 9806.65: "tf t",
    },
}  # fmt: skip
"""Spellings of the units of each quantity, without blanks, by their factor to the column's unit.

Upper and lower case are alike, and so are ``cm²``, ``cm2`` and ``cm^2``.
"""
_TEMPERATURES = {
    (1.0, 0.0): "°C degC gradC C celsius",
    (1.0, -273.15): "K kelvin",
    (5.0 / 9.0, -160.0 / 9.0): "°F degF F fahrenheit",
}
_CONVERSIONS = {
    quantity: {name.casefold(): (factor, 0.0) for factor, names in factors.items() for name in names.split()}
    for quantity, factors in _SPELLINGS.items()
} | {"temperature": {name.casefold(): both for both, names in _TEMPERATURES.items() for name in names.split()}}

USUAL = frozenset(name for names in _CONVERSIONS.values() for name in names)
"""Every spelling of a unit that a column may be converted from, in small letters."""

_SIGNALS = {
    "V": "V volt volts", "mV": "mV", "mA": "mA", "μA": "μA uA", "%": "%",
    "count": "count counts cnt cnts digit digits lsb raw inc increments",
}  # fmt: skip
ELECTRICAL = {name.casefold(): signal for signal, names in _SIGNALS.items() for name in names.split()}
"""Signals of a sensor that mean something only with its range; a lone A is left out, for it mostly names a port."""

OTHER_QUANTITIES = {
    "m/s", "mm/s", "cm/s", "in/s", "m/s2", "mm/s2", "m/min", "l/min", "lpm", "gpm", "l/s", "m3/s", "cm3/s", "mm2/s",
    "rpm", "1/min", "u/min", "rad/s", "°/s", "rad", "deg", "°", "%", "nm", "n·m", "n*m", "w", "kw", "hz", "khz", "a",
}  # fmt: skip
"""What else a logger records of a machine, in small letters."""

COMMON = {
    "time": ("s", "ms", "us", "100ns", "min"),
    "pressure": ("Pa", "kPa", "MPa", "bar", "mbar", "psi", "kgf/cm2"),
    "length": ("m", "mm", "in", "cm", "um"),
    "force": ("N", "kN", "lbf", "kgf", "kip"),
    "temperature": ("°C", "K", "°F"),
}
"""Units to offer in a message; the first is the column's own."""

_RARE = "psig psia kg/cm² dm g mN uN μN uV μV MHz deg_c m/s² m/s^2 mm/s² g/s 1/s min-1 J ohm Ω m³/s cm³/s bit bits -"
KNOWN = frozenset({*USUAL, *ELECTRICAL, *OTHER_QUANTITIES, *_RARE.casefold().split()})
"""Units in use, in small letters."""

_PORTS = frozenset("ABCFGHKPTXY")
"""Single letters that name a port or an axis sooner than a unit: 'pressure (A)'."""
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[\s*(?P<unit>[^\[\]]*?)\s*\]$")
_IN_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\(\s*(?P<unit>[^()]*?)\s*\)$")
_DIVIDED = re.compile(r"^(?P<name>\S+?\s*/\s*|.*\S (?:in|/) )(?P<unit>\S+)$")
_BRACKETS = {"[": "]", "(": ")", "{": "}", "<": ">"}
_REFERENCE = re.compile(r"(?P<unit>.+?)[ _,.-]*\(?(?:(?P<absolute>a|abs|absolute?)|g|gauge|rel|relativ|ü)\.?\)?", re.I)


@cache
def bare(unit: str) -> str:
    """Return a unit's text without brackets, quotes and blanks around it; ``cm²`` is ``cm2``, ``℃`` ``°C``."""
    text = unicodedata.normalize("NFKC", unit).strip().strip("\"'").strip()
    while len(text) > 1 and _BRACKETS.get(text[0]) == text[-1]:
        text = text[1:-1].strip()
    return text


def _squeezed(text: str) -> str:
    return "".join(text.split()).casefold().replace("^", "").replace("**", "")


def electrical(unit: str) -> str | None:
    """Tell V, mV, mA, μA, count or % if a unit is a sensor's signal, else None."""
    return ELECTRICAL.get(_squeezed(bare(unit)))


def of_stroke(column: str, unit: str) -> bool:
    """Return whether a column is a percentage of the stroke."""
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
    """Tell which of a recording's quantities a unit measures; None if none of them."""
    return next((quantity for quantity in _CONVERSIONS if conversion(unit, quantity) is not None), None)


@cache
def stated_reference(unit: str) -> Literal["gauge", "absolute"] | None:
    """Tell the reference that a unit of pressure states itself: ``bara``, ``psi(g)``; None if it states none."""
    text, known = bare(unit), _CONVERSIONS["pressure"]
    match = _REFERENCE.fullmatch(text)
    if _squeezed(text) in known or match is None or _squeezed(match["unit"]) not in known:
        return None
    return "absolute" if match["absolute"] else "gauge"


def stated_rate(unit: str) -> float | None:
    """Read the rate [Hz] that stands in place of a unit of time: ``200 Hz``; None for a unit."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(k?)hz", unit.strip(), re.IGNORECASE)
    return float(match[1]) * (1e3 if match[2] else 1.0) if match else None


def unit_in_name(name: str) -> str | None:
    """Find the unit that a header cell states; None without one.

    What stands in square brackets is taken at its word, unless it is an index such as ``axis[1]``; what stands in
    parentheses or behind a stroke only if it is a unit in use, for it may be a remark.
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
    """Tell whether text in a header is meant as a unit: a lone capital mostly names a port, ``rod`` a side."""
    text = bare(text)
    if len(text) == 1 and text in _PORTS:
        return False
    return electrical(text) is not None or quantity_of(text) is not None or text.casefold() in OTHER_QUANTITIES


def check_unit(column: str, unit: str) -> tuple[float, float]:
    """Return scale and offset to the column's unit; refuse one that is not known or measures something else."""
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
    raise RecordingError(f"column {column!r}: unit {unit!r} {problem}; expected one of {', '.join(COMMON[wanted])}")


def to_column_unit(values: Array, unit: str, column: str) -> Array:
    """Convert values given in ``unit`` to the column's own unit; return values already in it untouched.

    Temperatures are converted with their zero, so 32 °F is 0 °C. Refuses as ``check_unit``.
    """
    scale, offset = check_unit(column, unit)
    scaled = values if scale == 1.0 else values * scale
    return scaled if offset == 0.0 else scaled + offset


def column_scale(column: str, unit: str) -> float:
    """Tell how many of the column's unit one of ``unit`` is, for differences: 1 °F is 5/9 °C."""
    return check_unit(column, unit)[0]


@cache
def units_agree(stated: str, configured: str) -> bool:
    """Tell whether what a file states of its channel agrees with the configuration: the same unit.

    Spellings do not matter (``[Bar]`` and ``bar`` agree), nor does what pressure is counted from. Text that is no unit
    in use (``rod side``, ``A``, ``-``) contradicts nothing.
    """
    quantity, signal = quantity_of(configured), electrical(configured)
    if bare(stated) == bare(configured) or not names_a_unit(stated) or (quantity is None and signal is None):
        return True
    if signal is not None or quantity is None:
        plain = {signal, electrical(stated)} == {"count", "%"}  # numbers either way, whose ends the sensor states
        return plain or electrical(stated) == signal
    one, two = conversion(stated, quantity), conversion(configured, quantity)
    return one is not None and two is not None and math.isclose(one[0], two[0]) and one[1] == two[1]

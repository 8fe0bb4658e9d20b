"""Units as loggers write them (``[Bar]``, ``degC``, ``kp/cm²``, ``barg``), converted to SI, gauge pressure and °C."""

import math
import re
import unicodedata
from decimal import Decimal
from functools import cache
from typing import Any, Literal

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import POSITION, QUANTITIES
from cylinder_friction.recordings.recording import RecordingError

Reference = Literal["gauge", "absolute"]

USUAL: dict[str, dict[str, str]] = {
    "pressure": {
        "Pa": "pascal", "hPa": "hectopascal", "kPa": "kilopascal", "MPa": "megapascal",
        "bar": "bar", "mbar": "millibar", "psi": "psi", "ksi": "ksi", "lbf/in2": "psi", "lb/in2": "psi",
        "kgf/cm2": "kgf/cm**2", "kg/cm2": "kgf/cm**2", "kp/cm2": "kgf/cm**2", "at": "kgf/cm**2", "atm": "atm",
        "N/mm2": "newton/millimeter**2", "N/m2": "pascal", "kN/m2": "kilopascal",
    },
    "length": {
        "m": "meter", "meter": "meter", "metre": "meter", "cm": "centimeter", "mm": "millimeter",
        "um": "micrometer", "μm": "micrometer", "micron": "micrometer",
        "in": "inch", "inch": "inch", "inches": "inch", "zoll": "inch", "ft": "foot", "mil": "thou", "thou": "thou",
    },
    "time": {
        "s": "second", "sec": "second", "secs": "second", "second": "second", "seconds": "second",
        "sek": "second", "sekunde": "second", "sekunden": "second",
        "ms": "millisecond", "msec": "millisecond", "us": "microsecond", "μs": "microsecond", "usec": "microsecond",
        "ns": "nanosecond", "100ns": "tick", "100 ns": "tick", "ticks": "tick",
        "min": "minute", "minute": "minute", "minutes": "minute", "minuten": "minute",
        "h": "hour", "hr": "hour", "hour": "hour", "hours": "hour", "std": "hour", "d": "day", "day": "day",
    },
    "force": {
        "N": "newton", "newton": "newton", "daN": "dekanewton", "kN": "kilonewton", "lbf": "lbf", "kip": "kip",
        "kips": "kip", "kgf": "kgf", "kp": "kgf", "tf": "force_metric_ton",
        # A load cell's display shows what hangs on it; as a force, a mass can only mean its weight.
        "kg": "kgf", "lb": "lbf", "lbs": "lbf", "t": "force_metric_ton",
    },
    "temperature": {
        "°C": "degC", "degC": "degC", "gradC": "degC", "C": "degC", "celsius": "degC",
        "K": "kelvin", "kelvin": "kelvin", "°F": "degF", "degF": "degF", "F": "degF", "fahrenheit": "degF",
    },
}  # fmt: skip
"""Usual spellings of each quantity's units, upper and lower case alike, without blanks; each with pint's own."""

ELECTRICAL = {
    "V": "V", "volt": "V", "volts": "V", "mV": "mV", "mA": "mA", "μA": "μA", "uA": "μA",
    "count": "count", "counts": "count", "cnt": "count", "cnts": "count", "digit": "count", "digits": "count",
    "lsb": "count", "raw": "count", "inc": "count", "increments": "count", "%": "%",
}  # fmt: skip
"""Signals of a sensor that mean something only with its range; a lone A is left out, for it mostly names a port."""

_BY_QUANTITY = {
    quantity: {name.casefold(): known for name, known in names.items()} for quantity, names in USUAL.items()
}

_ELECTRICAL = {name.casefold(): known for name, known in ELECTRICAL.items()}
_PORTS = frozenset("ABCFHKPTXY")
OTHER_QUANTITIES = {
    "m/s", "mm/s", "cm/s", "in/s", "m/s2", "mm/s2", "m/min", "l/min", "lpm", "gpm", "l/s", "m3/s", "cm3/s", "mm2/s",
    "rpm", "1/min", "u/min", "rad/s", "°/s", "rad", "deg", "°", "%", "nm", "n·m", "n*m", "w", "kw", "hz", "khz", "a",
}  # fmt: skip
"""What else a logger records of a machine, in small letters."""

_BRACKETS = {"[": "]", "(": ")", "{": "}", "<": ">"}
_REFERENCE = re.compile(r"(?P<unit>.+?)[ _,.-]*\(?(?:(?P<absolute>a|abs|absolute?)|g|gauge|rel|relativ|ü)\.?\)?", re.I)
_TERM = r"[A-Za-zμ°_]+(?:(?:\*\*|\^)?-?[1-9])?"
_PARSABLE = re.compile(rf"{_TERM}(?:\s?[*/·.]\s?{_TERM})*")


@cache
def bare(unit: str) -> str:
    """Return a unit's text without brackets, quotes and blanks around it; ``cm²`` is ``cm2``, ``℃`` ``°C``."""
    text = unicodedata.normalize("NFKC", unit).strip().strip("\"'").strip()
    while len(text) > 1 and _BRACKETS.get(text[0]) == text[-1]:
        text = text[1:-1].strip()
    return text


def electrical(unit: str) -> str | None:
    """Return V, mV, mA, μA, count or % if a unit is a sensor's signal, else None."""
    return _ELECTRICAL.get(_squeezed(bare(unit)))


def of_stroke(column: str, unit: str) -> bool:
    """Return whether a column is a percentage of the stroke."""
    return column == POSITION and electrical(unit) == "%"


def usual(unit: str, quantity: str) -> str | None:
    """Return pint's spelling of a unit that usually measures this quantity, else None; ``barg`` is bar."""
    text, known = bare(unit), _BY_QUANTITY[quantity]
    found = known.get(_squeezed(text))
    if found is None and quantity == "pressure" and (match := _REFERENCE.fullmatch(text)):
        return known.get(_squeezed(match["unit"]))
    return found


@cache
def stated_reference(unit: str) -> Reference | None:
    """Return the reference that a unit of pressure states itself: ``bara``, ``psi(g)``; None if it states none."""
    text, known = bare(unit), _BY_QUANTITY["pressure"]
    match = _REFERENCE.fullmatch(text)
    if _squeezed(text) in known or match is None or _squeezed(match["unit"]) not in known:
        return None
    return "absolute" if match["absolute"] else "gauge"


def stated_rate(unit: str) -> float | None:
    """Return the rate [Hz] that stands in place of a unit of time: ``200 Hz``; None for a unit."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(k?)hz", unit.strip(), re.IGNORECASE)
    return float(match[1]) * (1e3 if match[2] else 1.0) if match else None


def names_a_unit(text: str) -> bool:
    """Return whether text in a header is meant as a unit: a lone capital mostly names a port, ``rod`` a side."""
    text = bare(text)
    if len(text) == 1 and text in _PORTS:
        return False
    known = electrical(text) is not None or any(usual(text, quantity) is not None for quantity in USUAL)
    return known or text.casefold() in OTHER_QUANTITIES


def parsable(unit: str) -> str | None:
    """Return a unit's text as pint may parse it without harm, powers written out, or None if it is no unit's text."""
    text = bare(unit)
    if len(text) > 40 or not _PARSABLE.fullmatch(text):
        return None
    return re.sub(r"(?<=[A-Za-zμ])(?=-?\d)", "**", text).replace("°", "deg").replace("·", "*")


def _squeezed(text: str) -> str:
    return "".join(text.split()).casefold().replace("^", "").replace("**", "")


COLUMN_UNITS = {"time": "second", "pressure": "pascal", "length": "meter", "force": "newton", "temperature": "degC"}
"""What the columns of each quantity are in."""

COMMON = {
    "time": ("s", "ms", "us", "100ns", "min"),
    "pressure": ("Pa", "kPa", "MPa", "bar", "mbar", "psi", "kgf/cm2"),
    "length": ("m", "mm", "in", "cm", "um"),
    "force": ("N", "kN", "lbf", "kgf", "kip"),
    "temperature": ("°C", "K", "°F"),
}
"""Units to offer in a message; every other unit of the quantity that pint knows will do too."""


SCALES = {
    "pascal": 1.0, "hectopascal": 1e2, "kilopascal": 1e3, "megapascal": 1e6, "bar": 1e5, "millibar": 1e2,
    "meter": 1.0, "centimeter": 1e-2, "millimeter": 1e-3, "micrometer": 1e-6,
    "second": 1.0, "millisecond": 1e-3, "microsecond": 1e-6, "nanosecond": 1e-9, "tick": 1e-7,
    "day": 86400.0, "newton": 1.0, "kilonewton": 1e3, "degC": 1.0,
}  # fmt: skip
"""Factors to the columns' units that pint, a quarter of a second to load, need not be asked for."""


def check_unit(column: str, unit: str) -> None:
    """Refuse a unit that does not exist or does not measure what the column holds."""
    wanted = QUANTITIES[column]
    would_do = f"expected one of {', '.join(COMMON[wanted])}, or another unit of {wanted}"
    if wanted == "pressure" and bare(unit) == "mPa":
        raise RecordingError(f"column {column!r}: unit {unit!r} is millipascal; write MPa for megapascal")
    if _conversion(unit, wanted) is not None:
        return
    if electrical(unit) is not None:
        raise RecordingError(
            f"column {column!r}: unit {unit!r} is a sensor's electrical signal, but the column holds a {wanted}; "
            "state the sensor: {range: [low, high], unit: ..., signal: [low, high]}"
        )
    measured = quantity_of(unit)
    if measured is None:
        raise RecordingError(f"column {column!r}: unit {unit!r} is not known; {would_do}")
    raise RecordingError(
        f"column {column!r}: unit {unit!r} measures {measured}, but the column holds a {wanted}; {would_do}"
    )


def to_column_unit(values: Array, unit: str, column: str) -> Array:
    """Return values given in ``unit`` in the column's own unit; values already in it are returned untouched.

    Temperatures are converted with their zero, so 32 °F is 0 °C. Refuses as ``check_unit``.
    """
    scale, offset = _checked_conversion(unit, column)
    scaled = values if scale == 1.0 else values * scale
    return scaled if offset == 0.0 else scaled + offset


def column_scale(column: str, unit: str) -> float:
    """Return how many of the column's unit one of ``unit`` is, for differences: 1 °F is 5/9 °C."""
    return _checked_conversion(unit, column)[0]


def _checked_conversion(unit: str, column: str) -> tuple[float, float]:
    check_unit(column, unit)
    conversion = _conversion(unit, QUANTITIES[column])
    assert conversion is not None
    return conversion


@cache
def units_agree(stated: str, configured: str) -> bool:
    """Return whether what a file states of its channel agrees with the configuration: the same unit.

    Spellings do not matter (``[Bar]`` and ``bar`` agree), nor does what pressure is counted from. Text that is no unit
    in use (``rod side``, ``A``, ``-``) contradicts nothing.
    """
    quantity, signal = quantity_of(configured), electrical(configured)
    if bare(stated) == bare(configured) or (quantity is None and signal is None):
        return True
    if signal is not None or quantity is None:
        plain = {signal, electrical(stated)} == {"count", "%"}  # numbers either way, whose ends the sensor states
        return plain or electrical(stated) == signal or not names_a_unit(stated)
    one, two = _conversion(stated, quantity), _conversion(configured, quantity)
    if one is None or two is None:
        return not names_a_unit(stated)
    return all(math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) for a, b in zip(one, two, strict=True))


@cache
def quantity_of(unit: str) -> str | None:
    """Return which of a recording's quantities a unit measures; None if none of them."""
    for quantity in COLUMN_UNITS:
        if usual(unit, quantity) is not None:
            return quantity
    if electrical(unit) is not None:
        return None
    return next((quantity for quantity in COLUMN_UNITS if _conversion(unit, quantity) is not None), None)


@cache
def _conversion(unit: str, quantity: str) -> tuple[float, float] | None:
    """Return scale and offset to the quantity's own unit, each the nearest float; None if it is no such unit."""
    known = usual(unit, quantity)
    if known in SCALES:
        return SCALES[known], 0.0
    text = known or parsable(unit)
    if text is None or (quantity == "pressure" and bare(unit) == "mPa"):
        return None
    registry = _registry()
    try:
        parsed, own = registry.Unit(text), registry.Unit(COLUMN_UNITS[quantity])
        if "delta" in text or parsed.dimensionality != own.dimensionality:
            return None
        zero, one = (registry.Quantity(Decimal(value), parsed).to(own).magnitude for value in (0, 1))
    except Exception:  # pint meets free text here, and has a dozen exceptions for what is no unit
        return None
    return float(one - zero), float(zero)


@cache
def _registry() -> Any:
    """Return the one registry, made when the first unit is looked up; decimal, so that no factor is rounded twice."""
    from pint import UnitRegistry

    registry: Any = UnitRegistry(non_int_type=Decimal)
    registry.define("tick = 100 * nanosecond")  # as Windows and .NET count
    return registry

"""How loggers spell units, and the spelling that pint knows: ``[Bar]``, ``degC``, ``Sek``, ``kp/cm²``, ``barg``."""

from __future__ import annotations

import re
import unicodedata
from typing import Literal

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
        "ns": "nanosecond", "min": "minute", "minute": "minute", "minutes": "minute", "minuten": "minute",
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
    "lsb": "count", "raw": "count", "inc": "count", "increments": "count",
}  # fmt: skip
"""Signals of a sensor that mean something only with its range; a lone A is left out, for it mostly names a port."""

_BY_QUANTITY = {
    quantity: {name.casefold(): known for name, known in names.items()} for quantity, names in USUAL.items()
}
_ELECTRICAL = {name.casefold(): known for name, known in ELECTRICAL.items()}
_PORTS = frozenset("ABCFHKPTXY")
_OTHER_QUANTITIES = {
    "m/s", "mm/s", "cm/s", "in/s", "m/s2", "mm/s2", "m/min", "l/min", "lpm", "gpm", "l/s", "m3/s", "cm3/s", "mm2/s",
    "rpm", "1/min", "u/min", "rad/s", "°/s", "rad", "deg", "°", "%", "nm", "n·m", "n*m", "w", "kw", "hz", "khz", "a",
}  # fmt: skip
"""What else a logger records of a machine, in small letters."""

_BRACKETS = {"[": "]", "(": ")", "{": "}", "<": ">"}
_REFERENCE = re.compile(r"(?P<unit>.+?)[ _,.-]*\(?(?:(?P<absolute>a|abs|absolute?)|g|gauge|rel|relativ|ü)\.?\)?", re.I)
_TERM = r"[A-Za-zμ°_]+(?:(?:\*\*|\^)?-?[1-9])?"
_PARSABLE = re.compile(rf"{_TERM}(?:\s?[*/·.]\s?{_TERM})*")


def bare(unit: str) -> str:
    """Return a unit's text without brackets, quotes and blanks around it; ``cm²`` is ``cm2``, ``℃`` ``°C``."""
    text = unicodedata.normalize("NFKC", unit).strip().strip("\"'").strip()
    while len(text) > 1 and _BRACKETS.get(text[0]) == text[-1]:
        text = text[1:-1].strip()
    return text


def electrical(unit: str) -> str | None:
    """Return V, mV, mA, μA or count where a unit is a sensor's signal, else None."""
    return _ELECTRICAL.get(_squeezed(bare(unit)))


def usual(unit: str, quantity: str) -> str | None:
    """Return pint's spelling of a unit that usually measures this quantity, else None; ``barg`` is bar."""
    text, known = bare(unit), _BY_QUANTITY[quantity]
    found = known.get(_squeezed(text))
    if found is None and quantity == "pressure" and (match := _REFERENCE.fullmatch(text)):
        return known.get(_squeezed(match["unit"]))
    return found


def stated_reference(unit: str) -> Reference | None:
    """Return the reference that a unit of pressure states itself: ``bara``, ``psi(g)``; None if it states none."""
    text, known = bare(unit), _BY_QUANTITY["pressure"]
    match = _REFERENCE.fullmatch(text)
    if _squeezed(text) in known or match is None or _squeezed(match["unit"]) not in known:
        return None
    return "absolute" if match["absolute"] else "gauge"


def names_a_unit(text: str) -> bool:
    """Return whether text in a header is meant as a unit: a lone capital mostly names a port, ``rod`` a side."""
    text = bare(text)
    if len(text) == 1 and text in _PORTS:
        return False
    known = electrical(text) is not None or any(usual(text, quantity) is not None for quantity in USUAL)
    return known or text.casefold() in _OTHER_QUANTITIES


def parsable(unit: str) -> str | None:
    """Return a unit's text as pint may parse it without harm, powers written out, or None if it is no unit's text."""
    text = bare(unit)
    if len(text) > 40 or not _PARSABLE.fullmatch(text):
        return None
    return re.sub(r"(?<=[A-Za-zμ])(?=-?\d)", "**", text).replace("°", "deg").replace("·", "*")


def _squeezed(text: str) -> str:
    return "".join(text.split()).casefold().replace("^", "").replace("**", "")

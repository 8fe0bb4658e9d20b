"""Units that loggers write, converted to the ones the project computes in: SI, gauge pressure, degrees Celsius."""

from __future__ import annotations

import math
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, Any

from cylinder_friction.recordings.columns import QUANTITIES
from cylinder_friction.recordings.mapping.unit_spelling import bare, electrical, names_a_unit, parsable, usual
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

COLUMN_UNITS = {"time": "second", "pressure": "pascal", "length": "meter", "force": "newton", "temperature": "degC"}
"""What the columns of each quantity are in."""

COMMON = {
    "time": ("s", "ms", "us", "min"),
    "pressure": ("Pa", "kPa", "MPa", "bar", "mbar", "psi", "kgf/cm2"),
    "length": ("m", "mm", "in", "cm", "um"),
    "force": ("N", "kN", "lbf", "kgf", "kip"),
    "temperature": ("°C", "K", "°F"),
}
"""Units to offer in a message; every other unit of the quantity that pint knows will do too."""


def check_unit(column: str, unit: str) -> None:
    """Refuse a unit that does not exist or does not measure what the column holds.

    Raises:
        RecordingError: The message names the column, the unit and units that would do.
    """
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


def to_column_unit(values: NDArray[np.float64], unit: str, column: str) -> NDArray[np.float64]:
    """Return values given in ``unit`` in the column's own unit; values already in it are returned untouched.

    Temperatures are converted with their zero, so 32 °F is 0 °C.

    Raises:
        RecordingError: As ``check_unit``.
    """
    conversion = _conversion(unit, QUANTITIES[column])
    if conversion is None:
        check_unit(column, unit)
        raise AssertionError(f"{unit!r} passed as a unit of {column!r}")
    scale, offset = conversion
    scaled = values if scale == 1.0 else values * scale
    return scaled if offset == 0.0 else scaled + offset


def column_scale(column: str, unit: str) -> float:
    """Return how many of the column's unit one of ``unit`` is, for differences: 1 °F is 5/9 °C.

    Raises:
        RecordingError: As ``check_unit``.
    """
    check_unit(column, unit)
    conversion = _conversion(unit, QUANTITIES[column])
    assert conversion is not None
    return conversion[0]


def units_agree(stated: str, configured: str) -> bool:
    """Return whether what a file states of its channel agrees with the configuration: the same unit.

    Spellings do not matter (``[Bar]`` and ``bar`` agree), nor does what pressure is counted from. Text that is no unit
    in use (``rod side``, ``A``, ``-``) contradicts nothing.
    """
    quantity, signal = quantity_of(configured), electrical(configured)
    if bare(stated) == bare(configured) or (quantity is None and signal is None):
        return True
    if signal is not None or quantity is None:
        return electrical(stated) == signal or not names_a_unit(stated)
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
    text = usual(unit, quantity) or parsable(unit)
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

    return UnitRegistry(non_int_type=Decimal)

"""Units that loggers write, converted to the ones the project computes in: SI, gauge pressure, degrees Celsius."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Unit:
    """A unit: what it measures, and how many of the project's unit one of it is."""

    quantity: str
    scale: float


UNITS = {
    "Pa": Unit("pressure", 1.0),
    "kPa": Unit("pressure", 1e3),
    "MPa": Unit("pressure", 1e6),
    "bar": Unit("pressure", 1e5),
    "psi": Unit("pressure", 6894.757293168361),
    "m": Unit("length", 1.0),
    "mm": Unit("length", 1e-3),
    "in": Unit("length", 0.0254),
    "s": Unit("time", 1.0),
    "ms": Unit("time", 1e-3),
    "N": Unit("force", 1.0),
    "kN": Unit("force", 1e3),
    "°C": Unit("temperature", 1.0),
}
"""Every known unit by the name it goes by in the configuration."""

QUANTITIES = {
    "time_s": "time",
    "pressure_1_pa": "pressure",
    "pressure_2_pa": "pressure",
    "position_m": "length",
    "load_force_n": "force",
    "oil_temperature_c": "temperature",
}
"""What each column of a recording measures."""


def units_of(quantity: str) -> list[str]:
    """Returns the names of the units that measure a quantity."""
    return [name for name, unit in UNITS.items() if unit.quantity == quantity]


def check_unit(column: str, unit: str) -> None:
    """Refuses a unit that does not exist or does not measure what the column holds.

    Raises:
        RecordingError: The message names the column, the unit and the units that would do.
    """
    wanted = QUANTITIES[column]
    if unit not in UNITS:
        raise RecordingError(
            f"column {column!r}: unit {unit!r} is not known; expected one of {', '.join(units_of(wanted))} "
            f"(all known units: {', '.join(UNITS)})"
        )
    if UNITS[unit].quantity != wanted:
        raise RecordingError(
            f"column {column!r}: unit {unit!r} measures {UNITS[unit].quantity}, but the column holds a {wanted}; "
            f"expected one of {', '.join(units_of(wanted))}"
        )


def to_si(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Returns values given in ``unit`` in the project's unit of the same quantity."""
    return values * UNITS[unit].scale

"""The cylinder's geometry: bore, rod, stroke and moving mass, and the areas that follow from them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Cylinder:
    """A single-rod hydraulic cylinder.

    Side 1 is the piston side (port A), side 2 the rod side (port B); extension is positive.

    Attributes:
        name: What the data sheet calls it.
        bore_diameter_m: Piston diameter [m].
        rod_diameter_m: Rod diameter [m].
        stroke_m: Length of travel [m]; position runs from 0 (retracted) to this.
        moving_mass_kg: Piston, rod and whatever moves rigidly with them [kg].

    Raises:
        ValueError: A length or the mass is not positive, or the rod is as thick as the bore.
    """

    name: str
    bore_diameter_m: float
    rod_diameter_m: float
    stroke_m: float
    moving_mass_kg: float

    def __post_init__(self) -> None:
        for field in ("bore_diameter_m", "rod_diameter_m", "stroke_m", "moving_mass_kg"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"cylinder {self.name!r}: {field} must be a positive number, but got {value!r}")
        if self.rod_diameter_m >= self.bore_diameter_m:
            raise ValueError(
                f"cylinder {self.name!r}: rod_diameter_m must be smaller than bore_diameter_m "
                f"({self.bore_diameter_m} m), but got {self.rod_diameter_m} m"
            )

    @property
    def piston_area_m2(self) -> float:
        """Area that pressure 1 acts on, A1 [m²]."""
        return math.pi / 4.0 * self.bore_diameter_m**2

    @property
    def annulus_area_m2(self) -> float:
        """Area that pressure 2 acts on, A2 = A1 less the rod [m²]."""
        return math.pi / 4.0 * (self.bore_diameter_m**2 - self.rod_diameter_m**2)

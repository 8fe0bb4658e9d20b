"""The cylinder's geometry: bore, rod, stroke, moving mass, and the areas that follow."""

from __future__ import annotations

import math
from dataclasses import dataclass

_LONGEST_M = {"bore_diameter_m": 3.0, "rod_diameter_m": 3.0, "stroke_m": 30.0}
"""No hydraulic cylinder is longer or wider; such a number is almost certainly in millimetres."""


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A single-rod hydraulic cylinder.

    Side 1 is the piston side (port A), side 2 the rod side (port B); extension is positive.

    Attributes:
        name: Its designation, for tables and reports.
        bore_diameter_m: Piston diameter [m].
        rod_diameter_m: Rod diameter [m], smaller than the bore.
        stroke_m: Length of travel [m]; position runs from 0 (retracted) to this.
        moving_mass_kg: Piston, rod and whatever moves rigidly with them [kg].

    Raises:
        ValueError: A value is not a positive number, is too large to be in metres, or the rod is as thick as the bore.

    Example:
        >>> cylinder = cf.Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
        >>> round(1e4 * cylinder.piston_area_m2, 2)
        31.17
    """

    name: str = "cylinder"
    bore_diameter_m: float
    rod_diameter_m: float
    stroke_m: float
    moving_mass_kg: float

    def __post_init__(self) -> None:
        for field in ("bore_diameter_m", "rod_diameter_m", "stroke_m", "moving_mass_kg"):
            value = getattr(self, field)
            if not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
                raise ValueError(f"cylinder {self.name!r}: {field} must be a positive number, but got {value!r}")
            if value > _LONGEST_M.get(field, math.inf):
                raise ValueError(
                    f"cylinder {self.name!r}: {field} must be in metres, at most {_LONGEST_M[field]:g}, but got "
                    f"{value!r}; if that is in millimetres, give {value / 1000.0:g}"
                )
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
        """Area that pressure 2 acts on, A2 = A1 less the rod's cross-section [m²]."""
        return math.pi / 4.0 * (self.bore_diameter_m**2 - self.rod_diameter_m**2)

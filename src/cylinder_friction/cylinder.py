"""The cylinder's geometry: bore, rods, stroke, moving mass, and the areas that follow."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

_LONGEST_M = {"bore_diameter_m": 3.0, "rod_diameter_m": 3.0, "rod_diameter_1_m": 3.0, "stroke_m": 30.0}
"""Largest dimensions of a hydraulic cylinder; a larger number is almost certainly in millimetres."""

ONE_CHAMBER = (
    "friction is computed from the pressures of two chambers, and a plunger has one: log pressure times area as a "
    "force, map it as drive_force_n in place of both pressures, and state the load"
)
"""Why a plunger is refused, and what to do instead."""


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A hydraulic cylinder with two chambers and a rod on one side or on both.

    Side 1 is the piston side (port A), side 2 the rod side (port B); extension is positive. A cylinder with two rods
    has no piston side: there, side 1 is the chamber whose pressure extends it, which you choose.

    Attributes:
        name: Its designation, for tables and reports.
        bore_diameter_m: Piston diameter [m].
        rod_diameter_m: Diameter of the rod on side 2 [m], smaller than the bore.
        stroke_m: Length of travel [m]; position runs from 0 (retracted) to this.
        moving_mass_kg: Mass of piston, rods and everything that moves rigidly with them [kg]. With a load cell or load
            pin, leave out what lies beyond it, as it measures that inertia too: usually piston and rods remain.
        rod_diameter_1_m: Diameter of the rod on side 1 [m], smaller than the bore; 0 without a rod there.

    Raises:
        ValueError: A value is not a positive number, is too large to be in metres, or a rod is as thick as the bore.

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
    rod_diameter_1_m: float = 0.0

    def __post_init__(self) -> None:
        for field in ("bore_diameter_m", "rod_diameter_m", "stroke_m", "moving_mass_kg", "rod_diameter_1_m"):
            value, may_be_zero = getattr(self, field), field == "rod_diameter_1_m"
            number = isinstance(value, int | float) and math.isfinite(value)
            if not number or value < 0.0 or (value == 0.0 and not may_be_zero):
                raise ValueError(
                    f"cylinder {self.name!r}: {field} must be a positive number"
                    f"{', or 0 without a rod on side 1' if may_be_zero else ''}, but got {value!r}"
                )
            if value > _LONGEST_M.get(field, math.inf):
                raise ValueError(
                    f"cylinder {self.name!r}: {field} must be in metres, at most {_LONGEST_M[field]:g}, but got "
                    f"{value!r}; if that is in millimetres, give {value / 1000.0:g}"
                )
        for field in ("rod_diameter_m", "rod_diameter_1_m"):
            if getattr(self, field) >= self.bore_diameter_m:
                raise ValueError(
                    f"cylinder {self.name!r}: {field} must be smaller than bore_diameter_m "
                    f"({self.bore_diameter_m} m), but got {getattr(self, field)} m; {ONE_CHAMBER}"
                )

    def __repr__(self) -> str:
        """State what ``to_dict`` lists: kept results know a cylinder by these words."""
        return f"Cylinder({', '.join(f'{name}={value!r}' for name, value in self.to_dict().items())})"

    @property
    def piston_area_m2(self) -> float:
        """Area that pressure 1 acts on, A1: the bore's less that of a rod on side 1 [m²]."""
        return math.pi / 4.0 * (self.bore_diameter_m**2 - self.rod_diameter_1_m**2)

    @property
    def annulus_area_m2(self) -> float:
        """Area that pressure 2 acts on, A2: the bore's less the rod's cross-section [m²]."""
        return math.pi / 4.0 * (self.bore_diameter_m**2 - self.rod_diameter_m**2)

    def to_dict(self) -> dict[str, str | float]:
        """List the attributes by name, without ``rod_diameter_1_m`` if there is no rod on side 1."""
        return {name: value for name, value in asdict(self).items() if value or name != "rod_diameter_1_m"}

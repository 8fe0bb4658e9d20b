"""Pressure loss in the line between a pressure sensor and its chamber, as stated in a mapping."""

import math
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array

OIL_DENSITY_KG_M3 = 870.0
BAR_PA = 1e5
RECTANGULAR = 1.0 / math.sqrt(3.0)
"""Ratio of standard deviation to half-width of a rectangular distribution (JCGM 100:2008, 4.3.7)."""


@dataclass(frozen=True)
class LineLoss:
    """Pressure loss between a sensor at a valve or block and its chamber, stated at one speed or by a hose's size.

    A loss stated at one speed grows with the square of speed, except for its laminar part; 0 bar states that the sensor
    is at the cylinder's port. The loss of a hose without fittings is computed from its dimensions (laminar: Hagen and
    Poiseuille; turbulent: Blasius). ``ValueError`` if neither or both are stated, or a number is out of range.
    """

    bar: float | None = None  # Loss at ``speed_m_s`` [bar]
    speed_m_s: float = 0.0  # Speed of the piston [m/s]
    laminar_percent: float = 0.0  # Part of the loss that is proportional to speed [%]
    length_m: float = 0.0  # Length of the hose [m]
    bore_mm: float = 0.0  # Inner diameter of the hose [mm]
    oil_mm2_s: float = 0.0  # Kinematic viscosity of the oil during operation [mm²/s]
    uncertainty_percent: float = 20.0  # Largest error of the stated loss [± %]
    area_m2: float = 0.0  # Area of the piston on this side, for the flow in a hose [m²]; set from the cylinder

    def __post_init__(self) -> None:
        hose = (self.length_m, self.bore_mm, self.oil_mm2_s)
        both = any(hose) and (self.bar is not None or self.speed_m_s > 0.0)
        stated = hose if self.bar is None else (self.bar, self.speed_m_s) if self.bar else ()
        if both or not all(0.0 < value < math.inf for value in stated):
            raise ValueError(
                "sensor: line_loss: expected positive bar and speed_m_s, or bar 0, or positive length_m, bore_mm and "
                f"oil_mm2_s, but got { ({name: value for name, value in vars(self).items() if value}) }"
            )
        for name in ("laminar_percent", "uncertainty_percent"):
            if not 0.0 <= getattr(self, name) <= 100.0:
                raise ValueError(f"sensor: line_loss: {name}: expected 0 to 100, but got {getattr(self, name)!r}")

    def in_words(self) -> str:
        unsure = f"± {self.uncertainty_percent:g} %"
        if self.bar is not None:
            return f"{self.bar:g} bar at {self.speed_m_s:g} m/s {unsure}"
        return f"{self.length_m:g} m of {self.bore_mm:g} mm bore {unsure}"

    def lost_pa(self, velocity_m_s: Array) -> Array:
        """Compute how much higher the sensor reads [Pa]; velocity is positive while oil flows to the chamber."""
        if self.bar is not None:
            part, laminar = velocity_m_s / (self.speed_m_s or 1.0), self.laminar_percent / 100.0
            return self.bar * BAR_PA * part * (laminar + (1.0 - laminar) * np.abs(part))
        bore_m, viscosity_m2_s = 1e-3 * self.bore_mm, 1e-6 * self.oil_mm2_s
        flow_m_s = velocity_m_s * self.area_m2 / (0.25 * math.pi * bore_m**2)
        reynolds = np.maximum(np.abs(flow_m_s) * bore_m / viscosity_m2_s, 1e-9)
        factor = np.maximum(64.0 / reynolds, np.where(reynolds > 2300.0, 0.316 * reynolds**-0.25, 0.0))
        return np.asarray(factor * self.length_m / bore_m * 0.5 * OIL_DENSITY_KG_M3 * flow_m_s * np.abs(flow_m_s))

"""Pressure loss in the line between a pressure sensor and its chamber, as stated in a mapping."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import PRESSURES

OIL_DENSITY_KG_M3 = 870.0
BAR_PA = 1e5
RECTANGULAR = 1.0 / math.sqrt(3.0)
"""Ratio of standard deviation to half-width of a rectangular distribution (JCGM 100:2008, 4.3.7)."""
FLOW_SIGNS = dict(zip(PRESSURES, (1.0, -1.0), strict=True))
"""Sign of the piston's velocity while oil flows from the sensor to the chamber, by pressure."""


class LossTerms(NamedTuple):
    """Terms of a line's loss [Pa] over the piston's speed [m/s]."""

    laminar: float  # Times speed
    square: float  # Times its square
    turbulent: float  # Times speed to the power 1.75, if that is more and the flow is turbulent
    turbulent_from_m_s: float


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
    uncertainty_percent: float = 75.0  # Largest error of the stated loss [± %]
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

    def terms(self) -> LossTerms:
        """Express the loss by the terms with which every runtime computes it; all are 0 if nothing is lost."""
        if self.bar is not None:
            lost_pa, laminar, speed_m_s = self.bar * BAR_PA, self.laminar_percent / 100.0, self.speed_m_s or 1.0
            return LossTerms(lost_pa * laminar / speed_m_s, lost_pa * (1.0 - laminar) / speed_m_s**2, 0.0, 0.0)
        bore_m, viscosity_m2_s = 1e-3 * self.bore_mm, 1e-6 * self.oil_mm2_s
        if self.area_m2 == 0.0:
            return LossTerms(0.0, 0.0, 0.0, 0.0)
        faster = self.area_m2 / (0.25 * math.pi * bore_m**2)  # Oil in the hose than the piston
        ratio = OIL_DENSITY_KG_M3 * self.length_m / bore_m
        laminar = 32.0 * ratio * viscosity_m2_s / bore_m * faster
        turbulent = 0.158 * ratio * faster**1.75 * (viscosity_m2_s / bore_m) ** 0.25
        return LossTerms(laminar, 0.0, turbulent, 2300.0 * viscosity_m2_s / (faster * bore_m))

    def lost_pa(self, velocity_m_s: Array) -> Array:
        """Compute how much higher the sensor reads [Pa]; velocity is positive while oil flows to the chamber."""
        terms, speed = self.terms(), np.abs(velocity_m_s)
        lost_pa = terms.laminar * speed + terms.square * speed * speed
        turbulent_pa = terms.turbulent * speed * np.sqrt(speed) * np.sqrt(np.sqrt(speed))
        lost_pa = np.where(speed > terms.turbulent_from_m_s, np.maximum(lost_pa, turbulent_pa), lost_pa)
        return np.asarray(np.sign(velocity_m_s) * lost_pa)

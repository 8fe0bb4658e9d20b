"""Pressure loss in the line between a pressure sensor and its chamber, as stated in a mapping."""

import math
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array

BAR_PA = 1e5
RECTANGULAR = 1.0 / math.sqrt(3.0)
"""Ratio of standard deviation to half-width of a rectangular distribution (JCGM 100:2008, 4.3.7)."""


@dataclass(frozen=True)
class LineLoss:
    """Pressure loss between a sensor at a valve or block and its chamber, stated at one speed of the piston.

    It grows with the square of speed, except for its laminar part.

    Raises:
        ValueError: A number is out of range.
    """

    bar: float  # Loss at ``speed_m_s`` [bar]
    speed_m_s: float  # Speed of the piston [m/s]
    laminar_percent: float = 0.0  # Part of the loss that is proportional to speed [%]
    uncertainty_percent: float = 20.0  # Largest error of the stated loss [± %]

    def __post_init__(self) -> None:
        if not (0.0 < self.bar < math.inf and 0.0 < self.speed_m_s < math.inf):
            raise ValueError(
                f"sensor: line_loss: expected positive bar and speed_m_s, but got {self.bar!r} and {self.speed_m_s!r}"
            )
        for name in ("laminar_percent", "uncertainty_percent"):
            if not 0.0 <= getattr(self, name) <= 100.0:
                raise ValueError(f"sensor: line_loss: {name}: expected 0 to 100, but got {getattr(self, name)!r}")

    @property
    def standard_uncertainty(self) -> float:
        """Standard uncertainty (k = 1) as a share of the loss."""
        return RECTANGULAR * self.uncertainty_percent / 100.0

    def in_words(self) -> str:
        """Describe the loss in words."""
        return f"{self.bar:g} bar at {self.speed_m_s:g} m/s ± {self.uncertainty_percent:g} %"

    def lost_pa(self, velocity_m_s: Array) -> Array:
        """Compute how much higher the sensor's pressure is than its chamber's [Pa], shape ``(n,)``.

        ``velocity_m_s`` is the velocity of the piston, positive while oil flows towards the chamber.
        """
        part, laminar = velocity_m_s / self.speed_m_s, self.laminar_percent / 100.0
        return np.asarray(self.bar * BAR_PA * part * (laminar + (1.0 - laminar) * np.abs(part)))

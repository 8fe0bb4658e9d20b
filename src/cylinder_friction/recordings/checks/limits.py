"""What is plausible for a cylinder, in numbers, and what a check of a recording finds."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from cylinder_friction.recordings.recording import expect
from cylinder_friction.recordings.stated_load import StatedLoad

LoadMode = Literal["none", "measured", "position"]
"""What the cylinder carries: nothing, what ``load_force_n`` measures, or a load that position decides."""


@dataclass(frozen=True, kw_only=True)
class CheckRules:
    """What is plausible for any cylinder."""

    minimum_duration_s: float = 5.0  # A shorter recording is refused [s]
    # A slower one is refused: velocity and its reversals come out of the filters too late [Hz]
    minimum_rate_hz: float = 50.0
    # Beyond any hydraulic cylinder; better that of the cylinder, 1.5 times its rated pressure: nothing else shows for
    # sure that bar were read as MPa [Pa]
    highest_pressure_pa: float = 7e7
    # The higher of the two pressures gets above this once in a recording. To be lowered for pneumatics [Pa].
    least_peak_pressure_pa: float = 2e5
    least_travel: float = 0.01  # Less motion than this share of the stroke is none

    def __post_init__(self) -> None:
        for name in ("minimum_duration_s", "minimum_rate_hz", "highest_pressure_pa"):
            expect(0.0 < getattr(self, name) < math.inf, name, "a positive number", getattr(self, name))
        peak_pa, travel = self.least_peak_pressure_pa, self.least_travel
        expect(0.0 <= peak_pa < math.inf, "least_peak_pressure_pa", "zero or a positive number", peak_pa)
        expect(0.0 <= travel < 1.0, "least_travel", "at least 0 and less than 1", travel)


@dataclass(frozen=True)
class CheckLimits(CheckRules):
    """What is plausible for one cylinder."""

    stroke_m: float  # Length of travel [m]
    # piston_area_m2, annulus_area_m2: A1 and A2; without them the force balance is not checked [m²]
    piston_area_m2: float | None = None
    annulus_area_m2: float | None = None
    load: LoadMode = "none"  # What the cylinder carries, see ``LoadMode``
    steps: Mapping[str, float] = field(default_factory=dict)  # Of the converters behind columns, in the columns' units
    rod_diameter_1_m: float = 0.0  # 0 without a rod on side 1
    stated_load: StatedLoad | None = None  # A constant load in place of what a load cell would measure

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(0.0 < self.stroke_m < math.inf, "stroke_m", "a positive number", self.stroke_m)
        expect(self.load in get_args(LoadMode), "load", "none, measured or position", self.load)
        a1, a2 = self.piston_area_m2, self.annulus_area_m2
        expect((a1 is None) == (a2 is None), "piston_area_m2 and annulus_area_m2", "both or neither", (a1, a2))
        if a1 is not None and a2 is not None:
            bore_m2 = a1 + math.pi / 4.0 * self.rod_diameter_1_m**2
            expected = f"more than 0 and less than the bore's area ({bore_m2} m²)"
            expect(0.0 < a2 < bore_m2, "annulus_area_m2", expected, a2)

    @property
    def areas_m2(self) -> tuple[float, float] | None:
        if self.piston_area_m2 is None or self.annulus_area_m2 is None:
            return None
        return self.piston_area_m2, self.annulus_area_m2


Outcome = Literal["ok", "noted", "repaired", "refused"]
"""Nothing wrong; odd but usable; wrong and repaired; not usable."""


@dataclass(frozen=True)
class Finding:
    """What one check of a recording states."""

    check: str  # Short and stable name of the check, for example ``pressure_stuck``
    outcome: Outcome  # What follows from it
    text: str  # One sentence with its numbers; if something is wrong, also what was expected and what to do


def spoken(column: str, value: float) -> str:
    """Return a value of a column as an engineer writes it: pressures in bar, the rest in the column's own unit."""
    if column.endswith("_pa"):
        return f"{value / 1e5:.4g} bar"
    unit = {"_m": " m", "_n": " N", "_c": " °C"}.get(column[-2:], "")
    return f"{value:.4g}{unit}"

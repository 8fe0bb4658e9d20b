"""Limits of what is plausible for a cylinder, and the findings of a recording's checks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Self, cast, get_args

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import LOAD_FORCE
from cylinder_friction.recordings.line_loss import RECTANGULAR
from cylinder_friction.recordings.recording import Recording, RecordingError, SensorUncertainty, expect


@dataclass(frozen=True)
class StatedLoad:
    """A constant load on the rod, positive if it resists extension."""

    force_n: float  # Load [N]
    within_n: float = 0.0  # Largest error of the load [± N]

    @classmethod
    def parsed(cls, text: str) -> Self:
        """Parse a load written as ``4218`` or ``4218+-40``, in newtons."""
        force, _, within = text.replace("±", "+-").partition("+-")
        try:
            force_n, within_n = float(force), float(within or 0.0)
        except ValueError:
            force_n = within_n = math.nan
        if not (math.isfinite(force_n) and 0.0 <= within_n < math.inf):
            raise RecordingError(
                f"load: got {text!r}, expected none, measured, position, or a constant load in newtons, as 4218+-40"
            )
        return cls(force_n, within_n)

    def in_words(self) -> str:
        return f"{self.force_n:g} ± {self.within_n:g} N, as stated"

    def added(self, recording: Recording) -> Recording:
        """Add the load to a recording as if a load cell read it; refuse a recording with another load."""
        if LOAD_FORCE in recording.columns and np.any(recording.column(LOAD_FORCE) != self.force_n):
            raise RecordingError(
                f"recording {recording.name!r}: a load of {self.force_n:g} N is stated, but {LOAD_FORCE} is "
                "another; leave one out"
            )
        own = SensorUncertainty(RECTANGULAR * self.within_n, 0.0)
        uncertainty = {**recording.metadata.uncertainty, LOAD_FORCE: own}
        loaded = recording.with_columns(load_force_n=np.full(len(recording), self.force_n))
        return loaded.described(load=self.in_words(), uncertainty=uncertainty)


LoadMode = Literal["none", "measured", "position"]
"""Load of the cylinder: none, measured as ``load_force_n``, or a function of position."""
Load = LoadMode | StatedLoad
GivenLoad = str | float | StatedLoad
"""A load as people state it: a ``LoadMode``, ``StatedLoad``, or text or number of newtons; ``load_of`` reads it."""


def load_of(given: GivenLoad) -> Load:
    """Read how the load is known, or the constant load itself, as options, mappings and arguments state it.

    Raises:
        RecordingError: It is neither.

    Example:
        >>> from cylinder_friction.recordings.checks.limits import load_of
        >>> load_of("measured"), load_of("-7848+-40"), load_of(4218)
        ('measured', StatedLoad(force_n=-7848.0, within_n=40.0), StatedLoad(force_n=4218.0, within_n=0.0))
    """
    if isinstance(given, StatedLoad):
        return given
    return cast("LoadMode", given) if given in get_args(LoadMode) else StatedLoad.parsed(str(given))


@dataclass(frozen=True, kw_only=True)
class CheckRules:
    """Limits for any cylinder."""

    minimum_duration_s: float = 5.0  # Shortest recording that is accepted [s]
    # Lowest sample rate that is accepted [Hz]. At a lower one, filters delay velocity and its reversals too much
    minimum_rate_hz: float = 50.0
    # Highest credible pressure [Pa]. The default suits any hydraulic cylinder; better is 1.5 times the rated pressure,
    # because only this limit shows for sure that bar were read as MPa
    highest_pressure_pa: float = 7e7
    # Pressure that the higher of the two must exceed once in a recording [Pa]; lower it for pneumatics
    least_peak_pressure_pa: float = 2e5
    least_travel: float = 0.01  # Least travel of a recording, as a share of the stroke

    def __post_init__(self) -> None:
        for name in ("minimum_duration_s", "minimum_rate_hz", "highest_pressure_pa"):
            expect(0.0 < getattr(self, name) < math.inf, name, "a positive number", getattr(self, name))
        peak_pa, travel = self.least_peak_pressure_pa, self.least_travel
        expect(0.0 <= peak_pa < math.inf, "least_peak_pressure_pa", "zero or a positive number", peak_pa)
        expect(0.0 <= travel < 1.0, "least_travel", "at least 0 and less than 1", travel)


@dataclass(frozen=True)
class CheckLimits(CheckRules):
    """Limits for one cylinder."""

    cylinder: Cylinder
    load: LoadMode = "none"
    steps: Mapping[str, float] = field(default_factory=dict)  # Converter step of each column, in the column's unit
    stated_load: StatedLoad | None = None  # A constant load, used in place of a load cell

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(self.load in get_args(LoadMode), "load", "none, measured or position", self.load)


Outcome = Literal["ok", "noted", "repaired", "refused"]
"""``noted``: odd but usable; ``repaired``: wrong but repaired; ``refused``: not usable."""


@dataclass(frozen=True)
class Finding:
    """The result of one check of a recording."""

    check: str  # Short and stable name of the check, for example ``pressure_stuck``
    outcome: Outcome
    text: str  # One sentence with numbers; if something is wrong, also what was expected and what to do


def spoken(column: str, value: float) -> str:
    """Format a value of a column for people: pressures in bar, others in the column's own unit."""
    if column.endswith("_pa"):
        return f"{value / 1e5:.4g} bar"
    unit = {"_m": " m", "_n": " N", "_c": " °C"}.get(column[-2:], "")
    return f"{value:.4g}{unit}"

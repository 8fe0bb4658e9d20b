"""One row per session of a cylinder: its indicators with uncertainties, and what they depend on beside wear."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

INDICATORS: Mapping[str, tuple[str, str]] = {
    "friction_n": ("N", "half difference of matched strokes: friction without zeros, and without a load by position"),
    "breakaway_n": ("N", "force at which the piston breaks away after rest, mean of both directions"),
    "viscous_n_s_m": ("N s/m", "slope of friction against speed"),
    "half_sum_n": ("N", "half the sum of matched strokes: zeros, asymmetry and load together"),
    "leak_m3_s_pa": ("m³/(s Pa)", "leak past the piston, from the decay of the pressure difference at rest"),
    "profile_n": ("N", "how much friction varies along the stroke: its largest tenth less its smallest"),
}
"""Unit and meaning of each indicator."""

COVARIATES: Mapping[str, str] = {
    "oil_temperature_c": "°C",
    "pressure_1_bar": "bar",
    "pressure_2_bar": "bar",
    "speed_m_s": "m/s",
    "load_n": "N",
    "travel_m": "m",
}
"""Unit of each quantity that changes friction without wear; means over the matched strokes, ``travel_m`` of all."""


@dataclass(frozen=True)
class Indicator:
    """One indicator of one session."""

    value: float | None  # In the unit of ``INDICATORS``; None where the session does not determine it
    # Standard uncertainty (k = 1) from a bootstrap over the session's strokes; sessions differ by more than this
    uncertainty: float | None = None
    why: str = ""  # Why there is no value, or what it is limited by; empty where there is nothing to add


@dataclass(frozen=True)
class HeldLabel:
    """How much of a session's label lies between the bounds of a model that estimated the session."""

    model: str  # SHA-256 of the model
    stated: float  # Share that the bounds state they hold
    share: float | None  # Share of the rows in which bounds count that they hold; None without such rows
    # The same once the part of label less estimate is taken off that does not turn with the direction: a sensor's zero
    # or a load
    share_less_zero: float | None


@dataclass(frozen=True)
class SessionRow:
    """What one session shows of its cylinder."""

    cylinder: str
    session: str
    start: str  # As ``RecordingMetadata.start``; empty where nothing states it
    start_source: str
    duration_s: float
    files: Mapping[str, str]  # SHA-256 of each log, by its path
    indicators: Mapping[str, Indicator]
    covariates: Mapping[str, float | None]  # None where nothing measures it
    # Friction by tenth of the stroke, None where strokes did not pass both ways [N]
    profile_n: tuple[float | None, ...] = ()
    # One stroke each way for the page, ``(position [m], force [N])``, a few dozen points; empty where there is none
    stroke: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    held: HeldLabel | None = None  # None if no model estimated the session

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return what ``to_dict`` gave."""
        indicators = {name: Indicator(**each) for name, each in content["indicators"].items()}
        stroke = {way: tuple((float(x), float(y)) for x, y in points) for way, points in content["stroke"].items()}
        held = None if content.get("held") is None else HeldLabel(**content["held"])
        made = {"indicators": indicators, "profile_n": tuple(content["profile_n"]), "stroke": stroke, "held": held}
        return cls(**{**content, **made})

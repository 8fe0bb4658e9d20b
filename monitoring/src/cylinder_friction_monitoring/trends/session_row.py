"""One row per session of a cylinder: indicators with uncertainties, and the covariates that they depend on."""

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
SHOWN: Mapping[str, tuple[float, str]] = {name: (1.0, unit) for name, (unit, _) in INDICATORS.items()} | {
    "leak_m3_s_pa": (6e11, "l/min at 100 bar")
}
"""Factor and unit in which people read each indicator: in sentences, figures and tables alike."""

COVARIATES: Mapping[str, str] = {
    "oil_temperature_c": "°C",
    "pressure_1_bar": "bar",
    "pressure_2_bar": "bar",
    "speed_m_s": "m/s",
    "load_n": "N",
    "travel_m": "m",
}
"""Unit of each quantity that changes friction without wear: means over matched strokes, ``travel_m`` over all."""


@dataclass(frozen=True)
class Indicator:
    """One indicator of one session."""

    value: float | None  # In the unit of ``INDICATORS``; None if the session does not determine it
    # Standard uncertainty (k = 1) from a bootstrap over strokes; sessions differ by more than this
    uncertainty: float | None = None
    why: str = ""  # Why there is no value, or what limits it


@dataclass(frozen=True)
class HeldLabel:
    """The share of a session's label within a model's bounds."""

    model: str  # SHA-256 of the model
    stated: float  # Share that the bounds should hold
    share: float | None  # Share of the rows in which bounds count; None without such rows
    # The same less a constant force: a sensor's zero or a load
    share_less_zero: float | None


@dataclass(frozen=True)
class SessionRow:
    """A cylinder in one session."""

    cylinder: str
    session: str
    start: str  # As ``RecordingMetadata.start``; empty if nothing states it
    start_source: str
    duration_s: float
    files: Mapping[str, str]  # SHA-256 of each log, by its path
    indicators: Mapping[str, Indicator]
    covariates: Mapping[str, float | None]  # None if nothing measures it
    # Friction by tenth of the stroke, None if strokes did not pass both ways [N]
    profile_n: tuple[float | None, ...] = ()
    # One stroke each way for the page, ``(position [m], force [N])``, a few dozen points; empty without strokes
    stroke: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    held: HeldLabel | None = None  # None if no model estimated the session

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON-compatible values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Restore a row from ``to_dict``."""
        indicators = {name: Indicator(**each) for name, each in content["indicators"].items()}
        stroke = {way: tuple((float(x), float(y)) for x, y in points) for way, points in content["stroke"].items()}
        held = None if content.get("held") is None else HeldLabel(**content["held"])
        made = {"indicators": indicators, "profile_n": tuple(content["profile_n"]), "stroke": stroke, "held": held}
        return cls(**{**content, **made})

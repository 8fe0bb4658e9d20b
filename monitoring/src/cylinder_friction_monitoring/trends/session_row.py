"""The row of one session of a cylinder: indicators with uncertainties, and the covariates that they depend on."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple, Self


class Wording(NamedTuple):
    """Unit and names of an indicator in sentences, figures and tables."""

    unit: str
    name: str  # Short name
    title: str  # Name in a sentence
    factor: float = 1.0  # Factor from the unit in the indicator's name to ``unit``


class Covariate(NamedTuple):
    """A quantity that changes friction without wear."""

    unit: str
    title: str
    least: float  # Smallest change that is reported, in its unit


INDICATORS: Mapping[str, Wording] = {
    "friction_n": Wording("N", "friction", "friction"),
    "breakaway_n": Wording("N", "breakaway", "breakaway force"),
    "viscous_n_s_m": Wording("N s/m", "viscous slope", "viscous slope of friction"),
    "half_sum_n": Wording("N", "half sum", "half sum of the strokes"),
    "leak_m3_s_pa": Wording("l/min at 100 bar", "leak", "leak past the piston (or through the valve)", 6e11),
    "profile_n": Wording("N", "profile", "variation of friction along the stroke"),
}
COVARIATES: Mapping[str, Covariate] = {  # Means over matched strokes; ``travel_m`` is over all
    "oil_temperature_c": Covariate("°C", "oil temperature", 3.0),
    "pressure_1_bar": Covariate("bar", "pressure on the piston side", 1.0),
    "pressure_2_bar": Covariate("bar", "pressure on the rod side", 1.0),
    "speed_m_s": Covariate("m/s", "speed of the strokes", 0.001),
    "load_n": Covariate("N", "load", 20.0),
    "travel_m": Covariate("m", "travel in a session", 0.0),
}


@dataclass(frozen=True)
class Indicator:
    """One indicator of one session."""

    value: float | None  # Value in the unit of the indicator's name; None if the session does not determine it
    # Standard uncertainty (k = 1) from a bootstrap over strokes; sessions differ by more than this
    uncertainty: float | None = None
    why: str = ""  # Why there is no value, or what limits it


@dataclass(frozen=True)
class HeldLabel:
    """The share of a session's label within a model's bounds."""

    model: str  # SHA-256 of the model
    stated: float  # Share that the bounds should contain
    share: float | None  # Share that they contain of the rows that count; None without such rows
    # The same share after a constant force, such as a sensor's zero or a load, is subtracted
    share_less_zero: float | None


@dataclass(frozen=True)
class SessionRow:
    """A cylinder in one session."""

    cylinder: str
    session: str
    start: str  # As ``RecordingMetadata.start``; empty if nothing states it
    start_source: str
    duration_s: float
    indicators: Mapping[str, Indicator]
    covariates: Mapping[str, float | None]  # None if nothing measures it
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
        return cls(**{**content, "indicators": indicators, "stroke": stroke, "held": held})

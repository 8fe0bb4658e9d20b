"""Settings of indicators and of their tests."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from cylinder_friction_monitoring.trends.session_row import INDICATORS

LoadMode = Literal["none", "measured", "position"]  # As in ``estimate_logs``


@dataclass(frozen=True)
class IndicatorPlan:
    """Settings of one session's indicators; a number out of range raises ``ValueError``."""

    load: LoadMode = "none"  # ``measured`` subtracts ``load_force_n``; a load by position shows in the half sum
    slowest_m_s: float = 6e-3  # Lowest speed that is used [m/s]; below it, friction depends on its history
    fastest_m_s: float = 0.3  # Highest speed that is used [m/s]; above it, pressure drops in lines look like friction
    viscous_from_m_s: float = 0.015  # Slowest strokes of the viscous slope, beyond the Stribeck curve [m/s]
    settling_s: float = 0.2  # Time after a start or reversal that does not count [s]
    block_s: float = 0.1  # Duration of a block [s]
    # Largest distance of two strokes that match: in position as a share of the stroke, in speed as a ratio less 1, and
    # in mean pressure as a share of it or in bar, whichever is more
    match_position: float = 0.03
    match_speed: float = 0.5
    match_pressure: float = 0.3
    match_bar: float = 3.0
    least_blocks: int = 10  # Fewest matched blocks that determine friction
    least_strokes: int = 2  # Fewest matched strokes in each direction that determine friction
    # Bulk modulus of the oil [Pa]: the leak is proportional to its inverse, and nothing measures it
    bulk_modulus_pa: float = 1.0e9
    dead_volume_m3: float = 1.2e-4  # Volume of each chamber outside its stroke, hose included [m³]
    bootstrap: int = 200  # Number of resamples of strokes

    def __post_init__(self) -> None:
        _positive(self, exempt=("load",))


@dataclass(frozen=True)
class MonitorPlan:
    """Settings of a cylinder's tests; a number out of range or an unknown indicator raises ``ValueError``."""

    baseline_sessions: int = 90  # Number of sessions in the baseline, during which there is no alarm
    false_alarms_per_year: float = 0.02  # Rate of false alarms of one cylinder, all indicators together
    # Allowed change of an indicator from its baseline in either direction [%]
    limit_percent: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    # Time after which an acknowledged alarm returns, unless the acknowledgement states another [days]
    acknowledged_days: float = 90.0
    # Standard deviation of sessions, as a share, which is assumed until the baseline shows it. The only public
    # measurement, repeated three times on one seal, shows 6 to 13 %
    assumed_scatter: float = 0.13

    def __post_init__(self) -> None:
        _positive(self, exempt=("limit_percent",))
        if self.baseline_sessions < LEAST_BASELINE:
            raise ValueError(f"baseline_sessions must be at least {LEAST_BASELINE}, but got {self.baseline_sessions}")
        if self.false_alarms_per_year > 1.0:
            got = f"{self.false_alarms_per_year}; more alarms than that are not believed"
            raise ValueError(f"false_alarms_per_year must be at most 1, but got {got}")
        for name, percent in self.limit_percent.items():
            if name not in INDICATORS:
                raise ValueError(f"limit_percent: got indicator {name!r}, but expected one of {', '.join(INDICATORS)}")
            if not (math.isfinite(percent) and percent > 0.0):
                raise ValueError(f"limit_percent.{name}: expected a positive number of percent, but got {percent!r}")


LEAST_BASELINE = 30  # Fewest sessions of a baseline that show how much sessions scatter


def _positive(plan: IndicatorPlan | MonitorPlan, exempt: tuple[str, ...]) -> None:
    for name, value in vars(plan).items():
        if name not in exempt and not (math.isfinite(value) and value > 0):
            raise ValueError(f"{type(plan).__name__}: {name} must be a positive number, but got {value!r}")

"""How indicators are made, and how they are tested."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from cylinder_friction_monitoring.trends.session_row import INDICATORS

LoadMode = Literal["none", "measured", "position"]
"""What the cylinder carries, as ``estimate_logs`` takes it."""


@dataclass(frozen=True)
class IndicatorPlan:
    """How one session's indicators are made.

    Raises:
        ValueError: A number is out of its range.
    """

    load: LoadMode = "none"  # ``measured`` takes ``load_force_n`` off; a load by position stays in, in the half sum
    slowest_m_s: float = 6e-3  # Slower rows are left out: there friction depends on its history [m/s]
    fastest_m_s: float = 0.3  # Faster ones are left out: there pressure drops in the lines look like friction [m/s]
    viscous_from_m_s: float = 0.015  # The viscous slope is that of faster strokes, beyond the Stribeck curve [m/s]
    settling_s: float = 0.2  # Time after a start or reversal that does not count [s]
    block_s: float = 0.1  # Duration that is averaged [s]
    # How different two strokes may be and still match: in position as a share of the stroke, in speed as a ratio less
    # 1, and in mean pressure as a share of it, or in bar where that is more
    match_position: float = 0.03
    match_speed: float = 0.5
    match_pressure: float = 0.3
    match_bar: float = 3.0
    least_blocks: int = 10  # Fewer matched blocks do not determine friction
    least_strokes: int = 2  # Neither do fewer strokes in a direction
    # Bulk modulus of the oil, for the leak [Pa]: the leak is proportional to its inverse, and nothing measures it
    bulk_modulus_pa: float = 1.0e9
    dead_volume_m3: float = 1.2e-4  # Oil beside each chamber's stroke, hose included, for the leak [m³]
    bootstrap: int = 200  # Resamples of strokes

    def __post_init__(self) -> None:
        _positive(self, exempt=("load",))


@dataclass(frozen=True)
class MonitorPlan:
    """How a cylinder's indicators are tested.

    Raises:
        ValueError: A number is out of its range, or a limit is set for an indicator that does not exist.
    """

    # Sessions of the baseline: fewer give no alarm, and more are not used
    baseline_sessions: int = 90
    false_alarms_per_year: float = 0.02  # Of one cylinder, all indicators together
    # How far an indicator may move from its baseline, in percent, in the direction in which it moves
    limit_percent: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    # An acknowledged alarm returns after this time, unless the acknowledgement states another [days]
    acknowledged_days: float = 90.0
    # Standard deviation of sessions, as a share, until the baseline shows it: one seal measured three times differs by
    # 6 to 13 % in the only public measurement
    assumed_scatter: float = 0.13
    # A session whose expected value the baseline determines no better than this, in standard deviations of a session,
    # is not tested: its oil, pressure, speed or load is too far from what the baseline holds
    widest: float = 1.0
    # Standard deviations of what is assumed of friction before the baseline shows more, over its level: per kelvin,
    # per bar of mean pressure, per mm/s, and per kN of load
    per_kelvin: float = 0.005
    per_bar: float = 0.02
    per_mm_s: float = 0.01
    per_kn: float = 0.3

    def __post_init__(self) -> None:
        _positive(self, exempt=("limit_percent",))
        if self.baseline_sessions < LEAST_BASELINE:
            raise ValueError(
                f"MonitorPlan: baseline_sessions must be at least {LEAST_BASELINE}, but got {self.baseline_sessions}"
            )
        if self.false_alarms_per_year > 1.0:
            raise ValueError(
                "MonitorPlan: false_alarms_per_year must be at most 1, but got "
                f"{self.false_alarms_per_year}; more alarms than that are not believed"
            )
        for name, percent in self.limit_percent.items():
            if name not in INDICATORS:
                raise ValueError(f"limit_percent: got indicator {name!r}, but expected one of {', '.join(INDICATORS)}")
            if not (math.isfinite(percent) and percent > 0.0):
                raise ValueError(f"limit_percent.{name}: expected a positive number of percent, but got {percent!r}")


LEAST_BASELINE = 30
"""A baseline of fewer sessions does not show how much sessions scatter."""


def _positive(plan: IndicatorPlan | MonitorPlan, exempt: tuple[str, ...]) -> None:
    for name, value in vars(plan).items():
        if name not in exempt and not (math.isfinite(value) and value > 0):
            raise ValueError(f"{type(plan).__name__}: {name} must be a positive number, but got {value!r}")

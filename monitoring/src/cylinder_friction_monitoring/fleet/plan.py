"""A fleet as its owner describes it: the cylinders, and how a log names its cylinder."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pydantic import NonNegativeFloat

from cylinder_friction import Cylinder
from cylinder_friction.recordings.checks.limits import load_of
from cylinder_friction_monitoring.trends.moments import corrected, utc_time
from cylinder_friction_monitoring.trends.plan import IndicatorPlan, LoadMode, MonitorPlan

Late = NonNegativeFloat | Literal["accept"]
"""By how many days a log may come late, or ``accept`` to take late logs as they are dated."""
_NAME = re.compile(r"[^\W_][\w .+-]{0,79}")


@dataclass(frozen=True, kw_only=True)
class Dimensions:
    """Dimensions of a cylinder, as in ``Cylinder``."""

    bore_diameter_m: float
    rod_diameter_m: float
    stroke_m: float
    moving_mass_kg: float
    rod_diameter_1_m: float = 0.0


@dataclass(frozen=True)
class ServiceDay:
    """A day on which somebody changed seals or oil."""

    time: str
    words: str = ""

    def __post_init__(self) -> None:
        utc_time(self.time, "time")


@dataclass(frozen=True)
class FleetCylinder:
    """A cylinder in the fleet file; the guide explains each key."""

    dimensions: Dimensions
    channels: Path | None = None  # Mapping of channels; None guesses it
    model: str = ""  # Folder of a saved estimator, or models:/NAME@ALIAS; empty without a model
    load: str | float | None = None  # As in ``estimate_logs``; None takes the load from the mapping
    names: str | None = None  # Pattern for a log's path with ``condition`` and ``session``; None: one session per log
    units: Mapping[str, str] = field(default_factory=dict)
    sensor_class: float | None = None  # Accuracy of sensors if it is not mapped [± % of full scale]
    bulk_modulus_pa: float = IndicatorPlan.bulk_modulus_pa
    dead_volume_m3: float = IndicatorPlan.dead_volume_m3
    limit_percent: Mapping[str, float] = field(default_factory=dict)
    baseline_sessions: int = 90
    false_alarms_per_year: float = 0.02
    acknowledged_days: float = MonitorPlan.acknowledged_days
    services: tuple[ServiceDay, ...] = ()
    starts: Mapping[str, str] = field(default_factory=dict)  # Session or pattern: its start, or days to add
    late: Late = 3.0
    about: str = ""  # Shown on demand, such as the cylinder's place, or what a demonstration simulates

    def __post_init__(self) -> None:
        self.cylinder("this")  # refuse impossible dimensions
        self.monitor_plan()
        self.indicator_plan("none")
        if self.load is not None:
            load_of(self.load)
        for session, stated in self.starts.items():
            corrected("", stated, f"starts: {session}")

    def indicator_plan(self, load: LoadMode) -> IndicatorPlan:
        """Return the settings of its indicators."""
        return IndicatorPlan(load=load, bulk_modulus_pa=self.bulk_modulus_pa, dead_volume_m3=self.dead_volume_m3)

    def monitor_plan(self) -> MonitorPlan:
        """Return the settings of its tests."""
        rates = self.baseline_sessions, self.false_alarms_per_year
        return MonitorPlan(*rates, dict(self.limit_percent), self.acknowledged_days)

    def cylinder(self, name: str) -> Cylinder:
        """Return its geometry."""
        return Cylinder(name=name, **vars(self.dimensions))


@dataclass(frozen=True)
class Assignment:
    """How a log names its cylinder: by a folder, a pattern in its path or first 64 KiB, or a table (CSV)."""

    by: Literal["folder", "pattern", "table", "field"] = "folder"
    pattern: str | None = None
    table: Path | None = None

    def __post_init__(self) -> None:
        needs = {"pattern": "pattern", "field": "pattern", "table": "table"}.get(self.by)
        for name in ("pattern", "table"):
            if (getattr(self, name) is not None) != (name == needs):
                raise ValueError(f"by: {self.by} {'needs' if name == needs else 'takes no'} {name}")
        if self.pattern is not None:
            try:
                groups = re.compile(self.pattern).groupindex
            except re.error as error:
                raise ValueError(f"pattern: {self.pattern!r} is not a regular expression: {error}") from None
            if "cylinder" not in groups:
                raise ValueError(f"pattern: {self.pattern!r} has no group (?P<cylinder>...)")


@dataclass(frozen=True)
class Fleet:
    """All cylinders of a fleet, by name."""

    cylinders: Mapping[str, FleetCylinder]
    assign: Assignment = Assignment()
    database: str = ""  # Address (postgresql://...); empty for an SQLite file in the folder of results

    def __post_init__(self) -> None:
        if wrong := [name for name in self.cylinders if not _NAME.fullmatch(name)]:
            raise ValueError(
                f"cylinders: got the name {wrong[0]!r}, expected letters, digits, blanks and . _ + -, at most 80, "
                "beginning with a letter or digit: files are named after it"
            )
        lower = [name.casefold() for name in self.cylinders]
        if same := [name for name in self.cylinders if lower.count(name.casefold()) > 1]:
            raise ValueError(f"cylinders: {' and '.join(same)} differ by case alone; their files would be one")
        if not self.cylinders:
            raise ValueError("cylinders: expected at least one")

"""What a participant of the benchmark is: how it is made, what may be tuned in it, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator

Value = float | int | str
Family = Literal["baseline", "analytical", "related work", "modern"]
Teacher = Literal["recordings", "twin"]


@dataclass(frozen=True)
class Range:
    """Numbers that tuning may choose from, both ends included."""

    low: float
    high: float
    logarithmic: bool = False
    integer: bool = False

    def __post_init__(self) -> None:
        if not self.low <= self.high or (self.logarithmic and self.low <= 0.0):
            raise ValueError(f"expected low <= high, above 0 if logarithmic, but got {self}")


@dataclass(frozen=True)
class OneOf:
    """Values that tuning may choose from."""

    values: tuple[Value, ...]


@dataclass(frozen=True)
class Making:
    """What a participant is made from.

    Attributes:
        cylinder: Its areas and moving mass.
        inputs: The columns that the task lets it see.
        seed: Of everything random in it.
        effort: Share of the full training it may spend, in (0, 1]; each model says what it cuts.
        choice: One value for each name in its ``space``.
    """

    cylinder: Cylinder
    inputs: tuple[str, ...]
    seed: int
    effort: float
    choice: Mapping[str, Value]


def needs_only_position(inputs: tuple[str, ...]) -> bool:
    """Return whether a model that needs no more than the position can be made."""
    return "position_m" in inputs


def needs_raw_pressures(inputs: tuple[str, ...]) -> bool:
    """Return whether both raw pressures are there, besides the position."""
    return {"pressure_1_pa", "pressure_2_pa", "position_m"} <= set(inputs)


@dataclass(frozen=True)
class RosterEntry:
    """One participant.

    Attributes:
        name: In files and tables.
        title: In words.
        family: Where it stands in the leaderboard's legend.
        source: Author and year.
        make: Returns it, not yet fitted.
        space: What is tuned, and where.
        first: The first thing that is tried: the source's or our own best guess; a value for each name in ``space``.
        can: Whether it can be made from given inputs.
        teacher: Whether it learns from the task's recordings, or from the simulated twin's true friction.
        chosen: What the source leaves open, and what was taken.
    """

    name: str
    title: str
    family: Family
    source: str
    make: Callable[[Making], FrictionEstimator]
    space: Mapping[str, Range | OneOf] = field(default_factory=dict)
    first: Mapping[str, Value] = field(default_factory=dict)
    can: Callable[[tuple[str, ...]], bool] = needs_only_position
    teacher: Teacher = "recordings"
    chosen: str = ""

    def __post_init__(self) -> None:
        if set(self.space) != set(self.first):
            raise ValueError(
                f"{self.name}: space has {sorted(self.space)}, but first has {sorted(self.first)}; expected equal names"
            )

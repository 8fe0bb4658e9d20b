"""What a check of a recording found."""

from dataclasses import dataclass
from typing import Literal, Self

Outcome = Literal["ok", "noted", "repaired", "refused"]
"""Nothing wrong; odd but usable; wrong and repaired; not usable."""


@dataclass(frozen=True)
class Finding:
    """One check of one recording."""

    check: str  # Short and stable name of the check, for example ``pressure_stuck``
    outcome: Outcome  # What follows from it
    text: str  # One sentence with its numbers; where something is wrong also what was expected and what to do

    @classmethod
    def of(cls, check: str, passed: bool, text: str, refusal: str) -> Self:
        """Return an ``ok`` finding with ``text`` if the check was passed, else a refusal with ``refusal``."""
        return cls(check, "ok", text) if passed else cls(check, "refused", refusal)


def spoken(column: str, value: float) -> str:
    """Return a value of a column as an engineer writes it: pressures in bar, the rest in the column's own unit."""
    if column.endswith("_pa"):
        return f"{value / 1e5:.4g} bar"
    unit = {"_m": " m", "_n": " N", "_c": " °C"}.get(column[-2:], "")
    return f"{value:.4g}{unit}"

"""What a check of a recording found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Outcome = Literal["ok", "noted", "repaired", "refused"]
"""Nothing wrong; odd but usable; wrong and put right; not usable."""


@dataclass(frozen=True)
class Finding:
    """One check of one recording.

    Attributes:
        check: Short and stable name of the check, for example ``pressure_stuck``.
        outcome: What follows from it.
        text: One sentence with its numbers; where something is wrong also what was expected and what to do.
    """

    check: str
    outcome: Outcome
    text: str


def spoken(column: str, value: float) -> str:
    """Return a value of a column as an engineer says it: pressures in bar, the rest in the column's own unit."""
    if column.endswith("_pa"):
        return f"{value / 1e5:.4g} bar"
    for suffix, unit in ((("_m",), "m"), (("_n",), "N"), (("_c",), "°C")):
        if column.endswith(suffix):
            return f"{value:.4g} {unit}"
    return f"{value:.4g}"

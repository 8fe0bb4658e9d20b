"""A load that position decides: a table over position, looked up in each step as if a load cell had measured it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numba
import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import LOAD_FORCE

FIRST, PER_METRE, TABLE = range(3)
"""In what a step takes: the first position [m], places of the table a metre, then the loads [N]."""


@dataclass(frozen=True, eq=False)
class PositionLoad:
    """The load at evenly spaced positions; in straight lines between them, held beyond the ends.

    Raises:
        ValueError: The positions are not in order, or there are fewer than two loads, or one is not finite.
    """

    # Where the load is known: first and last position [m]
    first_m: float
    last_m: float
    load_n: Array  # Positive where it resists extension, shape ``(places,)`` [N]
    uncertainty_n: Array  # Standard uncertainty of each (k = 1), shape ``(places,)`` [N]

    def __post_init__(self) -> None:
        if not self.first_m < self.last_m:
            raise ValueError(f"expected positions in order, but got {self.first_m!r} and {self.last_m!r} m")
        if self.load_n.ndim != 1 or len(self.load_n) < 2 or self.load_n.shape != self.uncertainty_n.shape:
            raise ValueError(
                "expected at least two loads and as many uncertainties, but got shapes "
                f"{self.load_n.shape} and {self.uncertainty_n.shape}"
            )
        if not (np.isfinite(self.load_n).all() and np.isfinite(self.uncertainty_n).all()):
            raise ValueError("expected finite loads and uncertainties, but got NaN or infinity")

    def packed(self) -> Array:
        """Return what a step takes, see ``FIRST``, ``PER_METRE`` and ``TABLE``."""
        per_metre = (len(self.load_n) - 1) / (self.last_m - self.first_m)
        return np.concatenate([[self.first_m, per_metre], self.load_n])

    def at(self, position_m: Array) -> Array:
        """Return the load at positions [N], both of shape ``(n,)``: bit for bit what a step takes."""
        return np.asarray(_loads_at(self.packed(), np.ascontiguousarray(position_m, dtype=np.float64)))

    def in_words(self) -> str:
        """Return the load in one sentence, for whoever reads an exported model."""
        return (
            f"a load of {self.load_n.min():.0f} to {self.load_n.max():.0f} N, which position decides between "
            f"{self.first_m:.4g} and {self.last_m:.4g} m, known to {self.uncertainty_n.max():.3g} N (standard "
            "uncertainty), is taken off"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        return {
            "range_m": [self.first_m, self.last_m],
            "load_n": self.load_n.tolist(),
            "standard_uncertainty_n": self.uncertainty_n.tolist(),
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        """Return what ``to_dict`` gave."""
        first_m, last_m = content["range_m"]
        return cls(first_m, last_m, np.array(content["load_n"]), np.array(content["standard_uncertainty_n"]))


def channel_names(inputs: tuple[str, ...], load: PositionLoad | None) -> tuple[str, ...]:
    """Return what filters take: the inputs, and a load that position decides."""
    return inputs if load is None else (*inputs, LOAD_FORCE)


@numba.njit(cache=True)
def load_at(packed: Array, position_m: float) -> float:
    """Return the load at a position [N] of ``PositionLoad.packed``."""
    last = packed.shape[0] - TABLE - 1
    place = min(max((position_m - packed[FIRST]) * packed[PER_METRE], 0.0), float(last))
    index = min(int(place), last - 1)
    below = packed[TABLE + index]
    return float(below + (place - index) * (packed[TABLE + index + 1] - below))


@numba.njit(cache=True)
def _loads_at(packed: Array, position_m: Array) -> Array:
    loads_n = np.empty(position_m.shape[0])
    for row in range(position_m.shape[0]):
        loads_n[row] = load_at(packed, position_m[row])
    return loads_n

"""A load that depends on positions: a table over them, read in each step in place of a load cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, NamedTuple, Self

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.columns import LOAD_FORCE, POSITION
from cylinder_friction.recordings.recording import Recording

MOST_AXES = 3


def _load_table() -> ModuleType:
    from cylinder_friction.realtime import load_table  # Numba: labels need not wait for it

    return load_table


class LoadAxis(NamedTuple):
    """One position on which a load depends, and the range in which the load is known."""

    column: str
    first_m: float
    last_m: float


@dataclass(frozen=True, eq=False)
class PositionLoad:
    """The load at evenly spaced positions, interpolated linearly between them and constant beyond the ends.

    Raises:
        ValueError: The positions are not in order, or there are fewer than two loads along one, or one is not finite.
    """

    # First and last position at which the load is known [m]
    first_m: float
    last_m: float
    # Positive if it resists extension [N], shape ``(places,)``, and with ``others`` one more axis for each of them
    load_n: Array
    uncertainty_n: Array  # Standard uncertainty of each (k = 1), of the loads' shape [N]
    others: tuple[LoadAxis, ...] = ()  # Further positions that the load depends on, at most two
    known: Mask | None = None  # True at places with a known load, of the loads' shape; None: all

    def __post_init__(self) -> None:
        for axis in self.axes:
            if not axis.first_m < axis.last_m:
                raise ValueError(f"expected positions in order, but got {axis.first_m!r} and {axis.last_m!r} m")
        shape = self.load_n.shape
        fits = len(shape) == len(self.axes) <= MOST_AXES and min(shape) >= 2
        if not fits or not shape == self.uncertainty_n.shape == (shape if self.known is None else self.known.shape):
            raise ValueError(
                f"expected at least two loads along each of {len(self.axes)} positions (at most {MOST_AXES}) and as "
                f"many uncertainties, but got shapes {shape} and {self.uncertainty_n.shape}"
            )
        if not (np.isfinite(self.load_n).all() and np.isfinite(self.uncertainty_n).all()):
            raise ValueError("expected finite loads and uncertainties, but got NaN or infinity")

    @property
    def axes(self) -> tuple[LoadAxis, ...]:
        """All positions that the load depends on, that of the piston first."""
        return (LoadAxis(POSITION, self.first_m, self.last_m), *self.others)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of these positions in a recording."""
        return tuple(axis.column for axis in self.axes)

    def packed(self, columns: Sequence[str] | None = None) -> Array:
        """Pack the load for a step whose samples have these columns; by default only the positions' columns.

        If the load is unknown at some places, marks follow the loads: one for an unknown place, zero for a known one.
        """
        width = _load_table().NUMBERS
        columns, numbers = self.columns if columns is None else columns, np.zeros(3 * width)
        for number, (axis, places) in enumerate(zip(self.axes, self.load_n.shape, strict=True)):
            per_metre = (places - 1) / (axis.last_m - axis.first_m)
            of_axis = columns.index(axis.column), axis.first_m, per_metre, places
            numbers[width * number : width * number + len(of_axis)] = of_axis
        unknown = [] if self.known is None or self.known.all() else [~self.known.ravel()]
        return np.concatenate([[len(self.axes)], numbers, self.load_n.ravel(), *unknown])

    def at(self, positions_m: Array) -> Array:
        """Interpolate the load at positions [N], shape ``(n,)``, with the same bits as in a step.

        ``positions_m`` has shape ``(n, positions)``, or ``(n,)`` if the load depends on one.
        """
        rows = np.ascontiguousarray(np.reshape(positions_m, (len(positions_m), -1)), dtype=np.float64)
        return np.asarray(_load_table().loads_at(self.packed(), rows))

    def of(self, recording: Recording) -> Array:
        """Interpolate the load at each row of a recording [N], shape ``(n,)``."""
        return self.at(recording.samples(self.columns))

    def knows(self, recording: Recording) -> Mask:
        """Mark the rows of a recording at which the load is known, shape ``(n,)``."""
        rows = recording.samples(self.columns)
        inside = [(rows[:, k] >= axis.first_m) & (rows[:, k] <= axis.last_m) for k, axis in enumerate(self.axes)]
        return np.asarray(np.logical_and.reduce(inside) & ~_load_table().loads_unknown_at(self.packed(), rows))

    def in_words(self) -> str:
        """Describe the load in one sentence, for the readers of an exported model."""
        known = np.ones(self.load_n.shape, dtype=np.bool_) if self.known is None else self.known
        load_n, between = self.load_n[known], f"{self.first_m:.4g} and {self.last_m:.4g} m"
        for axis in self.others:
            between += f", and {axis.column} between {axis.first_m:.4g} and {axis.last_m:.4g} m"
        part = "" if known.all() else f" (in {100.0 * known.mean():.0f} % of that area; elsewhere it is not known)"
        low, high = f"{load_n.min():z.0f}", f"{load_n.max():z.0f}"
        load = f"{low} N" if low == high else f"{low} to {high} N, which position decides"
        return (
            f"a load of {load} between {between}{part}, "
            f"known to {self.uncertainty_n[known].max():.3g} N (standard uncertainty), is taken off"
        )

    def to_dict(self) -> dict[str, Any]:
        """List the content as JSON-compatible values."""
        content: dict[str, Any] = {
            "range_m": [self.first_m, self.last_m],
            "load_n": self.load_n.tolist(),
            "standard_uncertainty_n": self.uncertainty_n.tolist(),
        }
        content |= {"others": [list(axis) for axis in self.others]} if self.others else {}
        return content | ({} if self.known is None else {"known": self.known.tolist()})

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        """Return what ``to_dict`` gave."""
        first_m, last_m = content["range_m"]
        loads = np.array(content["load_n"]), np.array(content["standard_uncertainty_n"])
        others, known = content.get("others", ()), content.get("known")
        known = None if known is None else np.array(known, dtype=np.bool_)
        return cls(first_m, last_m, *loads, tuple(LoadAxis(*axis) for axis in others), known)


def channel_names(inputs: tuple[str, ...], load: PositionLoad | None) -> tuple[str, ...]:
    """List the channels of filters: the inputs, and a load that position decides."""
    return inputs if load is None else (*inputs, LOAD_FORCE)

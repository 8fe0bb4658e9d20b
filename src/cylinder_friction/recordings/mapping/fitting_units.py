"""Which unit a cylinder's signal may be in, by its values, and whether a stated unit can be right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.columns import QUANTITIES
from cylinder_friction.recordings.mapping.units import to_column_unit

if TYPE_CHECKING:
    from cylinder_friction.recordings.mapping.channel_facts import ChannelFacts

TRIED = {
    "time": (("s", 1e-5, 0.5), ("ms", 0.05, 500.0), ("us", 20.0, 1e6)),
    "pressure": (
        ("bar", 1.0, 700.0),
        ("Pa", 7e4, 7e7),
        ("kPa", 7e3, 7e4),
        ("psi", 15.0, 1e4),
        ("MPa", 0.1, 70.0),
    ),
    "length": (("m", 0.01, 2.0), ("mm", 2.0, 5000.0), ("in", 1.0, 100.0), ("cm", 1.0, 300.0)),
    "force": (("N", 100.0, 5e6), ("kN", 0.1, 5000.0)),
    "temperature": (("°C", -40.0, 120.0), ("°F", -40.0, 250.0)),
}
"""Units of each quantity, likeliest first, and between what the greatest value lies with a common cylinder.

For time it is the step, for length the travel.
"""

PLAUSIBLE = {
    "pressure": (2e4, 7e7, "bar", 1e5, "greatest pressure"),
    "length": (2e-3, 20.0, "mm", 1e-3, "travel"),
    "force": (1.0, 2e7, "N", 1.0, "greatest force"),
}
"""Least and greatest for a cylinder, in the column's unit; how to write it; and what it is."""


def size_of(column: str, channel: ChannelFacts) -> float:
    """Return the number by which a unit is judged: the step of time, the travel, or the greatest value."""
    if column == "time_s":
        return channel.step
    if QUANTITIES[column] == "length":
        return channel.high - channel.low
    if QUANTITIES[column] == "temperature":
        return channel.high
    return max(abs(channel.low), abs(channel.high))


def fitting_units(column: str, channel: ChannelFacts) -> list[str]:
    """Return the units that the values fit, likeliest first; the column's usual one if they fit none."""
    size = size_of(column, channel)
    tried = TRIED[QUANTITIES[column]]
    return [unit for unit, low, high in tried if low <= size <= high] or [tried[0][0]]


def suspicion(column: str, unit: str, channel: ChannelFacts) -> str:
    """Return why a unit can hardly be right, or nothing."""
    limits = PLAUSIBLE.get(QUANTITIES[column])
    if limits is None:
        return ""
    least, greatest, shown_in, scale, what = limits
    with np.errstate(over="ignore"):
        low, high = to_column_unit(np.array([channel.low, channel.high]), unit, column).tolist()
    size = high - low if QUANTITIES[column] == "length" else max(abs(low), abs(high))
    if least <= size <= greatest:
        return ""
    return f"{unit} would make the {what} {size / scale:.3g} {shown_in}; is that the unit?"

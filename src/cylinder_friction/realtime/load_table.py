"""The table of a load over positions as a step takes it: packed into one array, and looked up in compiled code."""

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.realtime.compiled import compiled, compiled_part

COLUMN, FIRST, PER_METRE, PLACES, NUMBERS = range(5)
"""In what a step takes, of each axis: the sample's place of its position, the first one [m], places a metre, places."""
TABLE = 1 + 3 * NUMBERS
"""In what a step takes: the number of axes, three times ``NUMBERS`` numbers of an axis, then the loads [N]."""


@compiled_part
def _place(axis: Array, sample: Array) -> tuple[int, float]:
    """Find the place below a position along an axis, and which part of the way to the next it is."""
    last = axis[PLACES] - 1.0
    place = min(max((sample[int(axis[COLUMN])] - axis[FIRST]) * axis[PER_METRE], 0.0), last)
    index = min(int(place), int(last) - 1)
    return index, place - index


@compiled_part
def _between(table: Array, at: int, part: float) -> float:
    below = table[at]
    return float(below + part * (table[at + 1] - below))


@compiled_part
def _on_plane(table: Array, at: int, width: int, part: float, further: int, rest: float) -> float:
    """Return the value between four of a plane, ``part`` of the way from row to row, ``rest`` from column to column."""
    below = _between(table, at + further, rest)
    return float(below + part * (_between(table, at + width + further, rest) - below))


@compiled_part
def table_at(packed: Array, sample: Array, table: Array) -> float:
    """Interpolate a table of ``PositionLoad.packed`` at a sample's positions."""
    axes = int(packed[0])
    index, part = _place(packed[1:], sample)
    if axes == 1:
        return _between(table, index, part)
    second, second_part = _place(packed[1 + NUMBERS :], sample)
    width = int(packed[1 + NUMBERS + PLACES])
    if axes == 2:
        return _on_plane(table, index * width, width, part, second, second_part)
    third, third_part = _place(packed[1 + 2 * NUMBERS :], sample)
    depth = int(packed[1 + 2 * NUMBERS + PLACES])
    at = index * width * depth + second * depth
    below = _on_plane(table, at, depth, second_part, third, third_part)
    above = _on_plane(table, at + width * depth, depth, second_part, third, third_part)
    return float(below + part * (above - below))


@compiled_part
def places_of(packed: Array) -> int:
    """Return how many loads ``PositionLoad.packed`` holds."""
    count = 1
    for axis in range(int(packed[0])):
        count *= int(packed[1 + axis * NUMBERS + PLACES])
    return count


@compiled
def load_at(packed: Array, sample: Array) -> float:
    """Return the load at a sample's positions [N] of ``PositionLoad.packed``."""
    return table_at(packed, sample, packed[TABLE:])


@compiled
def load_unknown(packed: Array, sample: Array) -> bool:
    """Return whether the load is unknown: more than half of what lies around a sample's positions in the table."""
    start = TABLE + places_of(packed)
    return packed.shape[0] > start and table_at(packed, sample, packed[start:]) > 0.5


@compiled
def loads_at(packed: Array, samples: Array) -> Array:
    """Return the load at each sample's positions [N] of ``PositionLoad.packed``, shape ``(n,)``."""
    loads_n = np.empty(samples.shape[0])
    for row in range(samples.shape[0]):
        loads_n[row] = load_at(packed, samples[row])
    return loads_n


@compiled
def loads_unknown_at(packed: Array, samples: Array) -> Mask:
    """Return at which samples' positions the load is unknown, shape ``(n,)``."""
    unknown = np.empty(samples.shape[0], dtype=np.bool_)
    for row in range(samples.shape[0]):
        unknown[row] = load_unknown(packed, samples[row])
    return unknown

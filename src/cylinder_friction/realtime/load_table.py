"""The table of a load over positions in a step: packed into one array, and looked up in compiled code."""

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.machine_code import compiled, compiled_part

COLUMN, FIRST, PER_METRE, PLACES, NUMBERS = range(5)
"""Places in an axis of a packed load: index of its position in the sample, first position [m], places per metre,
places.
"""
TABLE = 1 + 3 * NUMBERS
"""Start of the loads [N] in a packed load, behind the number of axes and ``NUMBERS`` numbers of each of three axes."""


@compiled_part
def _place(axis: Array, sample: Array) -> tuple[int, float]:
    """Find the place below a position along an axis, and the position's fraction of the way to the next place."""
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
    """Interpolate between four values of a plane: ``part`` of the way between rows, ``rest`` between columns."""
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
    """Count the loads in ``PositionLoad.packed``."""
    count = 1
    for axis in range(int(packed[0])):
        count *= int(packed[1 + axis * NUMBERS + PLACES])
    return count


@compiled
def load_at(packed: Array, sample: Array) -> float:
    """Look up the load at a sample's positions [N] in ``PositionLoad.packed``."""
    return table_at(packed, sample, packed[TABLE:])


@compiled
def load_unknown(packed: Array, sample: Array) -> bool:
    """Check whether the load is unknown: the interpolated mark of unknown places is above one half."""
    start = TABLE + places_of(packed)
    return packed.shape[0] > start and table_at(packed, sample, packed[start:]) > 0.5


@compiled
def loads_at(packed: Array, samples: Array) -> Array:
    """Look up the load at each sample's positions [N] in ``PositionLoad.packed``, shape ``(n,)``."""
    loads_n = np.empty(samples.shape[0])
    for row in range(samples.shape[0]):
        loads_n[row] = load_at(packed, samples[row])
    return loads_n


@compiled
def loads_unknown_at(packed: Array, samples: Array) -> Mask:
    """Mark the samples at whose positions the load is unknown, shape ``(n,)``."""
    unknown = np.empty(samples.shape[0], dtype=np.bool_)
    for row in range(samples.shape[0]):
        unknown[row] = load_unknown(packed, samples[row])
    return unknown

"""The quantities that explain friction of steady sliding, such as speed and pressure, standardised for a fit.

Only the mean of both pressures, weighted by their areas, explains friction. A single pressure contains friction itself,
since the label is the difference of both. With a measured load, the load shows how the mean divides between them.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.polynomial import legendre

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks
from cylinder_friction.recordings.columns import LOAD_FORCE, OIL_TEMPERATURE, PRESSURE_1, PRESSURES, REFERENCE_C

POSITION_ORDER = 12
"""Order of the polynomial in position, which describes ripple of the bore that strokes do not average out."""
LEAST_OWN_SHARE = 0.02
"""Least share of the mean pressure's variance that the direction must not explain. With less, as behind a servo valve,
pressure is left out of friction: it would explain the difference between the directions, and with it the zeros."""
_NOTHING = 1e6


@dataclass(frozen=True)
class FrictionQuantities:
    """What explains friction beside the direction, with the scales of the fit; the constant is no quantity."""

    cylinder: Cylinder
    inputs: tuple[str, ...]  # Columns beside velocity and position that explain friction
    position_range_m: tuple[float, float]
    # Of each quantity: mean and standard deviation by which it is standardised, smallest and largest value
    means: tuple[float, ...]
    deviations: tuple[float, ...]
    lowest: tuple[float, ...]
    highest: tuple[float, ...]

    @classmethod
    def of(cls, blocks: SlidingBlocks, cylinder: Cylinder, columns: Collection[str]) -> Self:
        """Choose those of ``columns`` that the blocks have, and find the scales."""
        common = set(columns).intersection(blocks.columns)
        inputs = tuple(sorted(common if common.issuperset(PRESSURES) else common.difference(PRESSURES)))
        quantities = _quantities(blocks, inputs, cylinder)
        deviations, rounding = quantities.std(axis=0), 1e-9 * np.abs(quantities).max(axis=0)
        deviations = np.where(deviations > rounding, deviations, 1.0)
        if PRESSURE_1 in inputs:  # Of pressures that hardly vary, noise would explain the label, which holds it too
            deviations[:2] = np.maximum(deviations[:2], quantities[:, :2].mean(axis=0))
        if LOAD_FORCE in inputs:  # A load that hardly varies must explain nothing, or it would absorb the zeros
            place = 3 + 2 * (PRESSURE_1 in inputs)
            deviations[place : place + 2] = np.maximum(deviations[place : place + 2], blocks.level_n)
        if PRESSURE_1 in inputs and _own_share(quantities[:, 0], blocks.direction) < LEAST_OWN_SHARE:
            deviations[[0, 1, *([-5, -4] if OIL_TEMPERATURE in inputs else [])]] *= _NOTHING
        position_m = blocks.columns["position_m"]
        found = (quantities.mean(axis=0), deviations, quantities.min(axis=0), quantities.max(axis=0))
        range_m = (float(position_m.min()), float(position_m.max()))
        return cls(cylinder, inputs, range_m, *(tuple(each.tolist()) for each in found))

    @property
    def speed_place(self) -> int:
        """Index of the speed among the quantities."""
        return 2 if PRESSURE_1 in self.inputs else 0

    @property
    def even_places(self) -> list[int]:
        """Indices, among the columns of ``explaining``, of the terms of asymmetry: constant, pressure, load."""
        pressure = [1] if PRESSURE_1 in self.inputs else []
        return [0, *pressure, *([self.speed_place + 4] if LOAD_FORCE in self.inputs else [])]

    def explaining(self, blocks: SlidingBlocks) -> Array:
        """Compute constant, standardised quantities and polynomials in position, shape ``(blocks, columns)``."""
        standard = (_quantities(blocks, self.inputs, self.cylinder) - np.array(self.means)) / np.array(self.deviations)
        first, last = self.position_range_m
        along = np.clip((2.0 * blocks.columns["position_m"] - first - last) / max(last - first, 1e-12), -1.0, 1.0)
        return np.hstack([np.ones((len(standard), 1)), standard, legendre.legvander(along, POSITION_ORDER)[:, 1:]])


def _quantities(blocks: SlidingBlocks, inputs: Collection[str], cylinder: Cylinder) -> Array:
    """Compute the quantities, shape ``(blocks, quantities)``; mean pressure first."""
    of = blocks.columns
    speed = np.abs(of["velocity_m_s"])
    fast = np.log(np.maximum(speed, 1e-12))
    pressure: list[Array] = []
    if PRESSURE_1 in inputs:
        areas = np.array([cylinder.piston_area_m2, cylinder.annulus_area_m2])
        mean = areas @ np.stack([of[name] for name in PRESSURES]) / areas.sum()
        pressure = [mean, np.sqrt(np.maximum(mean, 0.0))]
    load = [of[LOAD_FORCE], np.abs(of[LOAD_FORCE])] if LOAD_FORCE in inputs else []
    quantities = [*pressure, speed, fast, fast**2, *load]
    if OIL_TEMPERATURE in inputs:
        warm = of[OIL_TEMPERATURE] - REFERENCE_C
        quantities += [warm, warm**2, *(warm * each for each in (*pressure, speed, fast, fast**2))]
    return np.column_stack(quantities)


def _own_share(values: Array, direction: Array) -> float:
    """Compute the share of a quantity's variance that the direction does not explain."""
    ways = [values[direction == sign] for sign in (1.0, -1.0)]
    return sum(float(way.var()) * len(way) for way in ways if len(way)) / max(float(values.var()) * len(values), 1e-300)

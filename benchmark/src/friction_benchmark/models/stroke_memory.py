"""Mean force balance of the strokes so far, out and in: it separates a sensor's offset from friction.

Friction changes sign with the direction, an offset does not: the sum of the mean force balance out and in is twice the
offset, as far as friction is equal in both. How far it is, a network can learn from rigs whose friction is known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array

MEMORY_NAMES = (
    "stroke_sum",
    "stroke_sum_over_difference",
    "stroke_difference",
    "both_strokes_known",
    "pressure_2_out",
    "pressure_2_in",
    "speed_out",
    "speed_in",
)
SLIDING_M_S = 3e-3
"""Slower rows do not count as part of a stroke: friction falls with velocity there."""
LONGEST_SAMPLES = 3000
"""Sliding samples that a mean covers; older ones fade."""
TRUSTED_SAMPLES = 200.0
"""Sliding samples after which a mean counts half."""
SUM_BEND_N, LEAST_DIFFERENCE_N = 50.0, 50.0
FORCE_N, PRESSURE_PA, SPEED_M_S = 500.0, 30e5, 0.05
OUT, IN = 0, 1
COUNT, FORCE, PRESSURE, SPEED = range(4)


def new_stroke_memory() -> Array:
    """Return the memory before the first sample, shape ``(2, 4)``: out and in; count and means of force balance [N],
    pressure 2 [Pa] and speed [m/s]."""
    return np.zeros((2, 4))


@numba.njit(cache=True)
def remember_strokes(velocity_m_s: Array, balance_n: Array, pressure_2_pa: Array, memory: Array) -> Array:
    """Return the features ``MEMORY_NAMES`` at each sample, shape ``(n, 8)``, each about 1 in size; changes ``memory``.

    Args:
        velocity_m_s: Causal, shape ``(n,)``.
        balance_n: P1·A1 - P2·A2, shape ``(n,)`` [N].
        pressure_2_pa: Rod side, shape ``(n,)`` [Pa].
        memory: See ``new_stroke_memory``.
    """
    result = np.empty((velocity_m_s.shape[0], 8))
    for row in range(velocity_m_s.shape[0]):
        speed = abs(velocity_m_s[row])
        if speed > SLIDING_M_S:
            stroke = memory[OUT] if velocity_m_s[row] > 0.0 else memory[IN]
            stroke[COUNT] = min(stroke[COUNT] + 1.0, LONGEST_SAMPLES)
            stroke[FORCE] += (balance_n[row] - stroke[FORCE]) / stroke[COUNT]
            stroke[PRESSURE] += (pressure_2_pa[row] - stroke[PRESSURE]) / stroke[COUNT]
            stroke[SPEED] += (speed - stroke[SPEED]) / stroke[COUNT]
        known_out = memory[OUT, COUNT] / (memory[OUT, COUNT] + TRUSTED_SAMPLES)
        known_in = memory[IN, COUNT] / (memory[IN, COUNT] + TRUSTED_SAMPLES)
        both = known_out * known_in
        total = memory[OUT, FORCE] + memory[IN, FORCE]
        difference = memory[OUT, FORCE] - memory[IN, FORCE]
        result[row, 0] = both * total / (abs(total) + SUM_BEND_N)
        result[row, 1] = both * total / max(difference, LEAST_DIFFERENCE_N)
        result[row, 2] = both * difference / FORCE_N
        result[row, 3] = both
        result[row, 4] = known_out * memory[OUT, PRESSURE] / PRESSURE_PA
        result[row, 5] = known_in * memory[IN, PRESSURE] / PRESSURE_PA
        result[row, 6] = known_out * memory[OUT, SPEED] / SPEED_M_S
        result[row, 7] = known_in * memory[IN, SPEED] / SPEED_M_S
    return result

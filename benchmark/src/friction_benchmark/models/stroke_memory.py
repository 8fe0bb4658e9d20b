"""Mean force balance of the strokes so far, out and in: it separates a sensor's offset from friction.

Friction changes sign with the direction, an offset does not: the sum of the mean force balance out and in is twice the
offset, as far as friction is equal in both. How far it is, a network can learn from rigs whose friction is known.
"""

import numpy as np

from cylinder_friction.arrays import Array, Mask

MEMORY_NAMES = (
    "stroke_sum", "stroke_sum_over_difference", "stroke_difference", "both_strokes_known",
    "pressure_2_out", "pressure_2_in", "speed_out", "speed_in",
)  # fmt: skip
SLIDING_M_S = 3e-3  # Slower rows do not count as part of a stroke: friction falls with velocity there
LONGEST_SAMPLES = 3000  # Sliding samples that a mean covers; older ones fade
TRUSTED_SAMPLES = 200.0  # Sliding samples after which a mean counts half
SUM_BEND_N, LEAST_DIFFERENCE_N = 50.0, 50.0
FORCE_N, PRESSURE_PA, SPEED_M_S = 500.0, 30e5, 0.05


def remember_strokes(velocity_m_s: Array, balance_n: Array, pressure_2_pa: Array) -> Array:
    """Return the features ``MEMORY_NAMES`` at each sample, shape ``(n, 8)``, each about 1 in size.

    ``velocity_m_s`` is causal; ``balance_n`` is P1·A1 - P2·A2; all have shape ``(n,)``.
    """
    values = np.column_stack([balance_n, pressure_2_pa, np.abs(velocity_m_s)])
    known_out, (force_out, pressure_out, speed_out) = _means(values, velocity_m_s > SLIDING_M_S)
    known_in, (force_in, pressure_in, speed_in) = _means(values, velocity_m_s < -SLIDING_M_S)
    both, total, difference = known_out * known_in, force_out + force_in, force_out - force_in
    return np.column_stack(
        [
            both * total / (np.abs(total) + SUM_BEND_N),
            both * total / np.maximum(difference, LEAST_DIFFERENCE_N),
            both * difference / FORCE_N,
            both,
            known_out * pressure_out / PRESSURE_PA,
            known_in * pressure_in / PRESSURE_PA,
            known_out * speed_out / SPEED_M_S,
            known_in * speed_in / SPEED_M_S,
        ]
    )


def _means(values: Array, counts: Mask) -> tuple[Array, Array]:
    """Return how sure the means over the counted rows until now are, 0 to 1, shape ``(n,)``, and them, ``(k, n)``."""
    means = np.zeros((1 + int(counts.sum()), values.shape[1]))
    for number, row in enumerate(values[counts], 1):
        means[number] = means[number - 1] + (row - means[number - 1]) / min(number, LONGEST_SAMPLES)
    so_far = np.cumsum(counts)
    covered = np.minimum(so_far, LONGEST_SAMPLES)
    return covered / (covered + TRUSTED_SAMPLES), means[so_far].T

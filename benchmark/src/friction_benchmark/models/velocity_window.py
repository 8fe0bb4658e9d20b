"""A window of past velocities whose spans grow with age: fine for the recent past, and seconds long.

Friction depends on a reversal for milliseconds and on a standstill for seconds; a window of equal steps would either be
too short or too wide for a small network.
"""

import numpy as np

from cylinder_friction.arrays import Array
from friction_benchmark.models.base import Single

EVERY = 4  # Samples between two steps of the window: 20 ms at 200 Hz
SPANS = np.repeat(np.array([1, 2, 4, 8, 16, 32, 64]), [6, 4, 4, 4, 4, 3, 2])
"""Steps that each mean of the window spans, newest first; together 7.2 s at 200 Hz."""
FAST_M_S, CREEP_M_S = 0.05, 5e-3  # Scales of the two forms of each mean: linear, and through a soft limit
WINDOW_INPUTS = 2 * len(SPANS)


def windows(velocity_m_s: Array) -> Single:
    """Return the window at every ``EVERY``-th sample, the first one included, shape ``(steps, WINDOW_INPUTS)``.

    Before the first sample the piston counts as at rest.
    """
    stepped = velocity_m_s[::EVERY]
    total = np.concatenate([np.zeros(SPANS.sum() + 1), np.cumsum(stepped)])
    ends = np.concatenate([[0], np.cumsum(SPANS)])
    newest = SPANS.sum() + 1 + np.arange(len(stepped))[:, None]
    means = (total[newest - ends[:-1]] - total[newest - ends[1:]]) / SPANS
    return np.concatenate([means / FAST_M_S, means / (np.abs(means) + CREEP_M_S)], axis=1).astype(np.float32)

"""Velocities without delay that friction models are identified with, from raw position."""

import math
from collections.abc import Callable

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.causal_velocity import CausalVelocity

WINDOWS_S = (0.035, 0.055, 0.075, 0.105)
"""Over which the slope of the position is taken; noise and lag of the position decide which fits friction best."""
NOISE_MULTIPLE = 4.0
"""Velocity below so many standard deviations of its noise is standstill."""
BACKLASH_MULTIPLE = 8.0
"""Half-width of the backlash, in standard deviations of the mean position over the window."""


def slope(window: int, backlash_m: float, dead_band_m_s: float) -> Callable[[Recording], Array]:
    """Return the slope of a line fitted around each sample, as a function from a recording to velocity [m/s].

    It is the causal velocity of the same window, moved back by its delay of half the window.

    Args:
        window: Samples, odd.
        backlash_m: Velocity counts while the position pushes the edge of a gap this wide either way; 0: always [m].
        dead_band_m_s: Slower is zero [m/s].
    """

    def velocity(recording: Recording) -> Array:
        position_m, half = recording.column("position_m"), window // 2
        block = CausalVelocity(window, 1, backlash_m, dead_band_m_s).block(recording.sample_time_s)
        lengthened = np.append(position_m, np.full(half, position_m[-1]))
        return block.advance(block.new_state(), lengthened[:, None])[half:]

    return velocity


def slope_noise(window: int, noise_m: float, sample_time_s: float) -> float:
    """Return the standard deviation that white noise of the position [m] leaves in its slope over a window [m/s]."""
    return noise_m / sample_time_s * math.sqrt(12.0 / (window * (window**2 - 1)))


def odd_window(duration_s: float, sample_time_s: float) -> int:
    """Return a duration in samples, odd and at least 3."""
    return max(3, 2 * round((duration_s / sample_time_s - 1.0) / 2.0) + 1)


def velocities_on_offer(noise_m: float, sample_time_s: float) -> dict[str, Callable[[Recording], Array]]:
    """Return candidates by what they are in words: each window with a dead band and with a backlash.

    Args:
        noise_m: Standard deviation of the position's noise [m].
        sample_time_s: Time between two samples [s].
    """
    offered: dict[str, Callable[[Recording], Array]] = {}
    for window in sorted({odd_window(window_s, sample_time_s) for window_s in WINDOWS_S}):
        dead_band_m_s = NOISE_MULTIPLE * slope_noise(window, noise_m, sample_time_s)
        backlash_m = BACKLASH_MULTIPLE * noise_m / math.sqrt(window)
        words = f"slope of the position over {1e3 * window * sample_time_s:.3g} ms"
        offered[f"{words}, zero below {1e3 * dead_band_m_s:.2g} mm/s"] = slope(window, 0.0, dead_band_m_s)
        offered[f"{words}, zero within a backlash of {1e6 * backlash_m:.3g} µm"] = slope(window, backlash_m, 0.0)
    return offered

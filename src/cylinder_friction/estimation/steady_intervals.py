"""What identification needs of logs: candidate velocities without delay, and what steady sliding shows by itself."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.apparent_loss import STRIBECK_SPEEDS_M_S
from cylinder_friction.labelling.robust import clustered_half_widths, robust_fit
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks, sliding_blocks
from cylinder_friction.labelling.uncertainty import line_uncertainty
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, OIL_TEMPERATURE, PRESSURES
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.causal_velocity import CausalVelocity

WINDOWS_S = (0.035, 0.055, 0.075, 0.105)
"""Windows for the slope of the position [s]. Noise and lag of the position decide which one fits friction best."""
NOISE_MULTIPLE = 4.0
"""The piston counts as at rest below this many standard deviations of the velocity's noise."""
BACKLASH_MULTIPLE = 8.0
"""Half-width of the backlash, in standard deviations of the mean position over the window."""
NO_FALL_M_S = 1e-4
"""A Stribeck velocity so low that dry friction does not fall at the speeds of steady sliding."""
ALIKE, LIKELY = 1.05, 1.92
"""Largest ratio of an error to the least one at which another Stribeck velocity describes friction as well; or, if that
allows more, its logarithm times the number of strokes, as few strokes hardly tell them apart (95 %, Laplace's law)."""
VISCOSITY_FALL_1_K = 0.03
"""Typical fall of a hydraulic oil's viscosity near 40 °C [1/K], for temperatures between the coldest and warmest."""
LEAST_WARMING_C = 2.0
"""Least span of oil temperatures over which viscous friction may differ [°C]; below it, the oil counts as one."""
_NAMES = ("viscous_n_s_m", "coulomb_n")


def slope(window: int, backlash_m: float, dead_band_m_s: float) -> Callable[[Recording], Array]:
    """Make a function that computes velocity [m/s] as the slope of a line fitted around each sample.

    It equals the causal velocity of the same odd ``window`` of samples, shifted back by its delay of half the window.
    Velocity is gated by a backlash operator of this half-width, and zero below the dead band; 0 for none.
    """

    def velocity(recording: Recording) -> Array:
        position_m, half = recording.column("position_m"), window // 2
        block = CausalVelocity(window, 1, backlash_m, dead_band_m_s).block(recording.sample_time_s)
        lengthened = np.append(position_m, np.full(half, position_m[-1]))
        return block.advance(block.new_state(), lengthened[:, None])[half:]

    return velocity


def slope_noise(window: int, noise_m: float, sample_time_s: float) -> float:
    """Return the standard deviation of the slope over a window [m/s] caused by white noise of the position [m]."""
    return noise_m / sample_time_s * math.sqrt(12.0 / (window * (window**2 - 1)))


def odd_window(duration_s: float, sample_time_s: float) -> int:
    """Convert a duration to a number of samples, odd and at least 3."""
    return max(3, 2 * round((duration_s / sample_time_s - 1.0) / 2.0) + 1)


def velocities_on_offer(noise_m: float, sample_time_s: float) -> dict[str, Callable[[Recording], Array]]:
    """List candidates by their descriptions: each window once with a dead band and once with a backlash.

    ``noise_m`` is the standard deviation of the position's noise.
    """
    offered: dict[str, Callable[[Recording], Array]] = {}
    for window in sorted({odd_window(window_s, sample_time_s) for window_s in WINDOWS_S}):
        dead_band_m_s = NOISE_MULTIPLE * slope_noise(window, noise_m, sample_time_s)
        backlash_m = BACKLASH_MULTIPLE * noise_m / math.sqrt(window)
        words = f"slope of the position over {1e3 * window * sample_time_s:.3g} ms"
        offered[f"{words}, zero below {1e3 * dead_band_m_s:.2g} mm/s"] = slope(window, 0.0, dead_band_m_s)
        offered[f"{words}, zero within a backlash of {1e6 * backlash_m:.3g} µm"] = slope(window, backlash_m, 0.0)
    return offered


def steady_intervals(
    recordings: Sequence[Recording], cylinder: Cylinder, confidence: float, zeros_n: float = 0.0, at_zero: bool = False
) -> dict[str, tuple[float, float]]:
    """Compute confidence intervals of viscous friction [N s/m] and Coulomb friction [N] from labelled recordings.

    In the fit, dry friction may fall with speed and change with pressure, in each direction in its own way, and each
    recording has its own level. Pressure is that of the side that the oil leaves, as the other one contains friction.
    Blocks of a stroke count as one. What strokes do not tell apart widens the intervals, which are infinite without
    enough strokes in both directions. If the oil's temperature is measured, the interval of viscous friction holds it
    from the coldest oil of the recordings to the warmest. Coulomb friction is that of extension, at the mean of these
    pressures or ``at_zero`` pressure; the sensors' zeros may shift it by ``zeros_n``. An error of the stated losses of
    lines, which grows with speed, shifts both.
    """
    parts = [sliding_blocks(each, cylinder, prior_n=0.0) for each in recordings]
    blocks = SlidingBlocks.together(parts)
    ways = blocks.direction > 0.0, blocks.direction < 0.0
    speed: Array = np.abs(blocks.columns["velocity_m_s"])
    if not all(way.any() for way in ways):
        return dict.fromkeys(_NAMES, (-np.inf, np.inf))
    part = np.repeat(np.arange(len(parts), dtype=np.int64), [len(each.stroke) for each in parts])
    viscous = _by_temperature(speed, blocks.columns.get(OIL_TEMPERATURE, speed[:0]))
    known: list[Array] = [*viscous]
    for way in ways:  # levels of dry friction: their mean, then the deviation of each recording but the first
        first, *others = np.unique(part[way])
        known += [way.astype(np.float64), *(way * (1.0 * (part == each) - (part == first)) for each in others)]
    if set(PRESSURES) <= blocks.columns.keys():
        leaving_bar = [1e-5 * blocks.columns[name] for name in reversed(PRESSURES)]
        known += [way * (bar - (not at_zero) * bar[way].mean()) for way, bar in zip(ways, leaving_bar, strict=True)]
    pairs = zip(recordings, parts, strict=True)
    lines_n = np.concatenate([lines_uncertain_n(each, cylinder, own.columns["velocity_m_s"]) for each, own in pairs])
    strokes, fits = np.unique(blocks.stroke, return_inverse=True)[1].astype(np.int64), []
    for stribeck_m_s in (NO_FALL_M_S, *STRIBECK_SPEEDS_M_S):
        design = np.column_stack([*known, np.exp(-speed / stribeck_m_s)])
        fit = robust_fit(design, blocks.label_n * blocks.direction)
        half = clustered_half_widths(design, fit, strokes, confidence)
        half = np.hypot(half, np.linalg.lstsq(design, lines_n)[0])
        half[len(viscous)] = np.hypot(half[len(viscous)], zeros_n)
        fits.append((float(np.abs(fit.residuals).sum()), fit.coefficients - half, fit.coefficients + half))
    most = max(ALIKE, math.exp(LIKELY / (strokes.max() + 1))) * min(error for error, _, _ in fits)
    alike = [(lower, upper) for error, lower, upper in fits if error <= most]
    places = slice(len(viscous)), slice(len(viscous), len(viscous) + 1)
    return {
        name: (float(min(lower[of].min() for lower, _ in alike)), float(max(upper[of].max() for _, upper in alike)))
        for name, of in zip(_NAMES, places, strict=True)
    }


def _by_temperature(speed: Array, oil_c: Array) -> list[Array]:
    """Split speed into columns whose coefficients are viscous friction in the coldest and in the warmest oil.

    In between, viscous friction falls as viscosity does. One column if the temperature is unknown or hardly changes.
    """
    if not len(oil_c) or np.ptp(oil_c) < LEAST_WARMING_C:
        return [speed]
    thin: Array = np.exp(-VISCOSITY_FALL_1_K * (oil_c - oil_c.min()))
    cold: Array = (thin - thin.min()) / (1.0 - thin.min())
    return [speed * cold, speed * (1.0 - cold)]


def lines_uncertain_n(recording: Recording, cylinder: Cylinder, velocity_m_s: Array) -> Array:
    """Compute the expanded uncertainty (k = 2) of the stated losses of lines as friction [N], shape ``(n,)``."""
    return np.zeros(len(velocity_m_s)) + COVERAGE_FACTOR * line_uncertainty(recording, cylinder, velocity_m_s)

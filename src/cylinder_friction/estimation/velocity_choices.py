"""Candidate velocities without delay for identifying friction models, and how parameters depend on the choice."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from tqdm import tqdm

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.identification.procedure import Identification
from cylinder_friction.friction_models.identification.search import Coordinates, search_locally
from cylinder_friction.friction_models.identification.simulation import Motion, Motions
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.causal_velocity import CausalVelocity

WINDOWS_S = (0.035, 0.055, 0.075, 0.105)
"""Windows for the slope of the position [s]. Noise and lag of the position decide which one fits friction best."""
NOISE_MULTIPLE = 4.0
"""The piston counts as at rest below this many standard deviations of the velocity's noise."""
BACKLASH_MULTIPLE = 8.0
"""Half-width of the backlash, in standard deviations of the mean position over the window."""
FITS_ALIKE = 0.01
"""A velocity fits as well as the best one if its error is greater by at most this share of mean |friction|."""
LEAST_SHARE = 0.02
"""Least half-width of an interval, as a share of the value: the bias by smoothing of label and velocity."""
EVALUATIONS = 400
STEADY = {"coulomb_n", "retract_ratio"}  # Parameters that steady sliding also determines


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


def widened_intervals(
    found: Identification,
    model: FrictionModel,
    recordings: Sequence[Recording],
    velocities: Mapping[str, Callable[[Recording], Array]],
    pressure: Callable[[Recording], Array] | None,
    *,
    mass_kg: float,
    damping_ratio: float,
) -> dict[str, tuple[float, float]]:
    """Widen intervals to contain the results of steady sliding and of all equally good velocities, and by 2 % at least.

    A filter and a gate at standstill bias parameters, bristle stiffness above all, by more than noise scatters them. A
    local search therefore starts from the best parameters with each velocity. If friction follows another law, all rows
    and steady sliding give different parameters; the interval contains both results with their uncertainties. With dry
    friction that grows with pressure, steady sliding shows other quantities. Arguments: see ``identify``.
    """
    values = {name: found.parameters.value(name) for name in found.intervals}
    intervals = {
        name: (min(lower, values[name] * (1.0 - LEAST_SHARE)), max(upper, values[name] * (1.0 + LEAST_SHARE)))
        for name, (lower, upper) in found.intervals.items()
    }
    pressures = [np.zeros(len(each)) if pressure is None else pressure(each) for each in recordings]
    for velocity in tqdm(velocities.values(), desc=f"intervals {model.title}", unit="velocity", disable=None):
        moving = [
            Motion(velocity(each), pressure_pa, each.column("friction_n"), each.usable())
            for each, pressure_pa in zip(recordings, pressures, strict=True)
        ]
        motions = Motions.of(moving, recordings[0].sample_time_s, model)
        reference_pa = 0.0 if pressure is None else motions.reference_pressure_pa
        coordinates = Coordinates.around(model, found.curve, mass_kg, damping_ratio, reference_pa)
        end = search_locally(motions, coordinates, coordinates.point(found.parameters), EVALUATIONS)
        if motions.error_of(coordinates.values(end)) > found.error_n + FITS_ALIKE * found.mean_friction_n:
            continue
        parameters = coordinates.parameters(end)
        for name, (lower, upper) in intervals.items():
            intervals[name] = min(lower, parameters.value(name)), max(upper, parameters.value(name))
    for name in STEADY & intervals.keys() if pressure is None else ():
        (lower, upper), other = intervals[name], getattr(found.curve, name) / values[name]
        intervals[name] = min(lower, other * lower), max(upper, other * upper)
    return intervals

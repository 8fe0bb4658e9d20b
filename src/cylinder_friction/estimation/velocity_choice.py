"""How much parameters depend on the choice of how velocity is made from position, as part of their intervals."""

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

FITS_ALIKE = 0.01
"""A velocity whose error exceeds the least by at most this share of mean |friction| could have been chosen as well."""
LEAST_SHARE = 0.02
"""Least half-width of an interval, over the value: as much as smoothing of label and velocity bends where noise is
small."""
EVALUATIONS = 400


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
    """Return the intervals of a result, widened to hold what is found with every velocity that fits alike, and 2 %.

    A filter and a gate at standstill bend what is identified by more than noise scatters it, bristle stiffness above
    all. So a local search starts from the best parameters with each velocity. Arguments are as for ``identify``.
    """
    values = {name: found.parameters.value(name) for name in found.intervals}
    intervals = {
        name: (min(lower, values[name] * (1.0 - LEAST_SHARE)), max(upper, values[name] * (1.0 + LEAST_SHARE)))
        for name, (lower, upper) in found.intervals.items()
    }
    for velocity in tqdm(velocities.values(), desc=f"intervals {model.title}", unit="velocity", disable=None):
        motions = Motions.of(
            [_motion(recording, velocity, pressure) for recording in recordings], recordings[0].sample_time_s, model
        )
        reference_pa = 0.0 if pressure is None else motions.reference_pressure_pa
        coordinates = Coordinates.around(model, found.curve, mass_kg, damping_ratio, reference_pa)
        end = search_locally(motions, coordinates, coordinates.point(found.parameters), EVALUATIONS)
        if motions.error_of(coordinates.values(end)) > found.error_n + FITS_ALIKE * found.mean_friction_n:
            continue
        parameters = coordinates.parameters(end)
        for name, (lower, upper) in intervals.items():
            intervals[name] = min(lower, parameters.value(name)), max(upper, parameters.value(name))
    return intervals


def shifted_intervals(
    found: Identification, intervals: Mapping[str, tuple[float, float]], zeros_n: float
) -> dict[str, tuple[float, float]]:
    """Return intervals widened by how far zeros of the sensors may shift friction.

    A shift of both directions adds to dry friction while extending, and is taken from it while retracting.

    Args:
        found: What was identified.
        intervals: By parameter.
        zeros_n: Greatest shift [N].
    """
    shifts = {"coulomb_n": zeros_n, "static_n": zeros_n}
    shifts["retract_ratio"] = (
        zeros_n * (1.0 + found.parameters.value("retract_ratio")) ** 2 / (2.0 * found.mean_friction_n)
    )
    widened = dict(intervals)
    for name in shifts.keys() & intervals.keys():
        value, (lower, upper) = found.parameters.value(name), intervals[name]
        low, high = math.hypot(value - lower, shifts[name]), math.hypot(upper - value, shifts[name])
        widened[name] = max(value - low, 1e-6 * value), value + high
    return widened


def _motion(
    recording: Recording, velocity: Callable[[Recording], Array], pressure: Callable[[Recording], Array] | None
) -> Motion:
    pressure_pa = np.zeros(len(recording)) if pressure is None else pressure(recording)
    return Motion(velocity(recording), pressure_pa, recording.column("friction_n"), recording.usable())

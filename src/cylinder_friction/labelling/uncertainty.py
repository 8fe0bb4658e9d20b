"""Uncertainty of a friction label [N], from the stated uncertainty of the sensors behind it."""

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, DRIVE_FORCE, LOAD_FORCE
from cylinder_friction.recordings.line_loss import RECTANGULAR
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.noise import MEDIAN_OF_NORMAL, noise_deviation
from cylinder_friction.signals.smooth_signals import SignalFilter, at_cylinder, has_pressures

DITHER = 0.5
"""Least noise, in steps of the converter, from which rounding acts as noise that averaging reduces (Widrow 1961)."""


def smoothing_deviation(recording: Recording, cylinder: Cylinder, signal_filter: SignalFilter) -> Array:
    """Compute the standard deviation that smoothing leaves in the label [N], shape ``(n,)``; see ``deviation``."""
    recording = at_cylinder(recording, signal_filter)
    force_n = sum(
        (area * recording.column(column) for column, area in sensitivities(recording, cylinder).items()),
        start=np.zeros(len(recording)),
    )
    step_s = recording.sample_time_s
    variance = np.square(signal_filter.deviation(force_n, step_s))
    if LOAD_FORCE in recording.columns:
        variance += np.square(signal_filter.deviation(recording.column(LOAD_FORCE), step_s))
    return np.asarray(np.sqrt(variance))


def inertia_deviation(recording: Recording, mass_kg: float) -> Array:
    """Compute the standard deviation that smoothing of the acceleration leaves in a filtered recording's label [N].

    It is the inertia by which the acceleration differs from the slope of the velocity, which is smoothed less, if that
    exceeds twice its noise. Shape ``(n,)``.
    """
    slope_m_s2 = np.gradient(recording.column("velocity_m_s"), recording.sample_time_s)
    left_n = mass_kg * np.abs(slope_m_s2 - recording.column("acceleration_m_s2"))
    noise_n = float(np.median(left_n)) / MEDIAN_OF_NORMAL
    return np.asarray(np.sqrt(np.maximum(left_n**2 - (2.0 * noise_n) ** 2, 0.0)))


def label_uncertainty(
    recording: Recording,
    cylinder: Cylinder,
    load_uncertainty_n: float | Array = 0.0,
    smoothing_n: float | Array = 0.0,
) -> Array | None:
    """Compute the expanded uncertainty (k = 2, about 95 %) of the friction label [N], shape ``(n,)``, or None.

    Friction is P1·A1 - P2·A2 - m·a - F_load, so (JCGM 100:2008, GUM, equations 10 and 11a)

        U² = 4·[A1²·u²(P1) + A2²·u²(P2) + u²(F_load) + u_s²],    u²(x) = zero² + (span·x)² + resolution²/12

    Here zero and span are each sensor's standard uncertainties, and resolution is one step of its converter, within
    which the reading is uniformly distributed. A measured drive force replaces both pressures. The terms add in
    quadrature, as sensors are independent. ``smoothing_n``, u_s, is the standard deviation that the label's filter
    leaves, a number or ``(n,)``. If noise spreads the converter's steps (``DITHER``), u_s includes them, and the
    resolution does not count again. A sensor's zero is constant within a recording, so averaging rows does not reduce
    its uncertainty. ``load_uncertainty_n`` is the standard uncertainty (k = 1) of an identified load.

    Returns None if a sensor behind the label states no uncertainty, as unknown is not zero. A measured load may use
    ``load_uncertainty_n`` instead.
    """
    areas = sensitivities(recording, cylinder)
    load_covered = LOAD_FORCE not in recording.metadata.uncertainty and bool(np.any(load_uncertainty_n))
    if LOAD_FORCE in recording.columns and not load_covered:
        areas[LOAD_FORCE] = 1.0
    if any(column not in recording.metadata.uncertainty for column in areas):
        return None
    variance = np.full(len(recording), np.square(load_uncertainty_n) + np.square(smoothing_n))
    for column, area in areas.items():
        stated = recording.metadata.uncertainty[column]
        constant = stated.zero**2
        if noise_deviation(recording.column(column)) < DITHER * stated.resolution:
            constant += stated.resolution**2 / 12.0
        variance += area**2 * constant
        if stated.span:
            variance += np.square((area * stated.span) * recording.column(column))
    return np.asarray(COVERAGE_FACTOR * np.sqrt(variance))


def line_uncertainty(recording: Recording, cylinder: Cylinder, velocity_m_s: Array) -> Array | float:
    """Compute the label's standard uncertainty (k = 1) from the stated losses of lines [N], ``(n,)``; 0 without them.

    Both lines have the same error, so their uncertainties add.
    """
    areas, lines = sensitivities(recording, cylinder), recording.metadata.line_loss
    own = [(area, lines[name]) for name, area in areas.items() if name in lines]
    pairs = ((area * (RECTANGULAR * line.uncertainty_percent / 100.0), line) for area, line in own)
    return sum((np.abs(share * line.lost_pa(velocity_m_s)) for share, line in pairs), start=0.0)


def sensitivities(recording: Recording, cylinder: Cylinder) -> dict[str, float]:
    """Compute the derivative of friction by each column of the driving force [m², or 1 for a force]."""
    if has_pressures(recording):
        return {"pressure_1_pa": cylinder.piston_area_m2, "pressure_2_pa": -cylinder.annulus_area_m2}
    return {DRIVE_FORCE: 1.0}

"""Fit of a Stribeck curve to points of steady sliding, or the reason why they do not determine one."""

from collections.abc import Sequence

import numpy as np

from cylinder_friction.friction_models.identification.steady_points import SteadyPoint
from cylinder_friction.friction_models.stribeck import StribeckCurve, fit_stribeck

LEAST_SPAN = 5.0
"""Smallest ratio of the fastest to the slowest steady speed at which a curve's level and slope can be separated."""

BELOW_SEEN = 0.6
"""Smallest plausible Coulomb friction, as a share of the least friction seen, which includes viscous friction."""

OPPOSING = 0.7
"""Smallest share of points whose friction must oppose the motion."""


def known_curve(points: Sequence[SteadyPoint]) -> tuple[StribeckCurve | None, str]:
    """Fit a curve through points of steady sliding; return None and the reason if they do not determine one."""
    problem = undetermined(points) if points else ""
    if problem:
        return None, problem
    try:
        curve = curve_through(points)
    except ValueError as error:
        return None, str(error)
    problem = _beyond_seen(curve, points)
    return (None, problem) if problem else (curve, "")


def is_breakaway_known(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> bool:
    """Check whether a point is as slow as the Stribeck velocity; if none is, static friction is extrapolated."""
    return min(abs(point.velocity_m_s) for point in points) <= curve.stribeck_velocity_m_s


def undetermined(points: Sequence[SteadyPoint]) -> str:
    """Explain why points of steady sliding do not determine friction; empty if they do. At least one is needed."""
    opposing = [point for point in points if point.friction_n * point.velocity_m_s > 0.0]
    if len(opposing) < OPPOSING * len(points):
        return (
            f"only {len(opposing)} of {len(points)} points of steady sliding oppose the motion, as friction must; the "
            "force carries a load, the position counts the other way, or the pressures are swapped"
        )
    if len({point.velocity_m_s > 0.0 for point in points}) == 1:
        way = "extending" if points[0].velocity_m_s > 0.0 else "retracting"
        return f"steady sliding was seen while {way} alone; record strokes in both directions"
    speeds = [abs(point.velocity_m_s) for point in points]
    span = max(speeds) / min(speeds)
    if span < LEAST_SPAN:
        return (
            f"speeds of steady sliding run from {1e3 * min(speeds):.2g} to {1e3 * max(speeds):.2g} mm/s, a factor of "
            f"{span:.2g}; Coulomb and viscous friction can be separated from a factor of {LEAST_SPAN:.2g}; record "
            "slower and faster strokes"
        )
    return ""


def curve_through(points: Sequence[SteadyPoint]) -> StribeckCurve:
    """Fit the curve, with each point weighted by the square root of its rows; raise as ``fit_stribeck`` does."""
    names = ("velocity_m_s", "friction_n", "rows")
    velocity, friction, rows = (np.array([getattr(each, name) for each in points], dtype=np.float64) for name in names)
    return fit_stribeck(velocity, friction, np.sqrt(rows))


def _beyond_seen(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> str:
    seen = [abs(point.friction_n) for point in points]
    coulomb = sorted((curve.coulomb_n, curve.retract_ratio * curve.coulomb_n))
    if coulomb[0] >= BELOW_SEEN * min(seen) and coulomb[1] <= max(seen):
        return ""
    return (
        f"the fit's Coulomb friction, {coulomb[0]:.0f} to {coulomb[1]:.0f} N, lies outside the friction that was seen, "
        f"{min(seen):.0f} to {max(seen):.0f} N, so its parameters are not determined; record more strokes at constant "
        "velocity"
    )

"""LuGre friction of cylinders that nobody measured: parameters drawn around what handbooks give, on measured motion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import savgol_filter

from cylinder_friction.friction_models.lugre import LugreParameters, new_bristle, passive_damping_velocity, simulate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

    Array = NDArray[np.float64]

BREAKAWAY_PA = 1.2e5
"""Pressure on the piston at which a cylinder without load breaks away: geometric middle of 0.5 to 3 bar."""

STATIC_RATIO, RETRACT_RATIO = 1.5, 1.2
STRIBECK_VELOCITY_M_S = 8e-3
STRIBECK_EXPONENT = 1.5
BRISTLE_STIFFNESS_N_M = 1e7
VISCOUS_N_S_M = 1100.0
DAMPING_RATIO = 0.5
"""Middles, geometric where the range spans decades, of what is usual for cylinders of some centimetres' bore."""

MOTION_WINDOW, MOTION_ORDER = 31, 3
REST_M_S = 1.5e-3
"""Slower is rest: four times the noise of the smoothed velocity of a 12-bit potentiometer."""


def generic_parameters(cylinder: Cylinder) -> LugreParameters:
    """Return the LuGre model of a cylinder of which nothing but its sizes and moving mass is known."""
    static_n = BREAKAWAY_PA * cylinder.piston_area_m2
    stiff = 2.0 * DAMPING_RATIO * math.sqrt(BRISTLE_STIFFNESS_N_M * cylinder.moving_mass_kg)
    damping = max(0.0, stiff - VISCOUS_N_S_M)
    coulomb_n = static_n / STATIC_RATIO
    return LugreParameters(
        coulomb_n=coulomb_n,
        static_n=static_n,
        stribeck_velocity_m_s=STRIBECK_VELOCITY_M_S,
        stribeck_exponent=STRIBECK_EXPONENT,
        viscous_n_s_m=VISCOUS_N_S_M,
        bristle_stiffness_n_m=BRISTLE_STIFFNESS_N_M,
        bristle_damping_n_s_m=damping,
        damping_velocity_m_s=min(STRIBECK_VELOCITY_M_S, passive_damping_velocity(coulomb_n, damping)),
        retract_ratio=RETRACT_RATIO,
    )


def drawn_parameters(centre: LugreParameters, spread: float, generator: np.random.Generator) -> LugreParameters:
    """Return parameters each within ``1 ± spread`` of the centre's; static friction and retraction by their excess."""

    def factor() -> float:
        return float(generator.uniform(1.0 - spread, 1.0 + spread))

    coulomb_n = centre.coulomb_n * factor()
    return replace(
        centre,
        coulomb_n=coulomb_n,
        static_n=coulomb_n * (1.0 + (centre.static_n / centre.coulomb_n - 1.0) * factor()),
        stribeck_velocity_m_s=centre.stribeck_velocity_m_s * factor(),
        viscous_n_s_m=centre.viscous_n_s_m * factor(),
        bristle_stiffness_n_m=centre.bristle_stiffness_n_m * factor(),
        retract_ratio=1.0 + (centre.retract_ratio - 1.0) * factor(),
    )


def smooth_velocity(recording: Recording) -> Array:
    """Return a recording's velocity without delay [m/s], zero at rest, shape ``(n,)``; from its position alone."""
    position = recording.column("position_m")
    velocity = savgol_filter(position, MOTION_WINDOW, MOTION_ORDER, deriv=1, delta=recording.sample_time_s)
    return np.where(np.abs(velocity) < REST_M_S, 0.0, velocity)


def synthetic_friction(parameters: LugreParameters, velocity_m_s: Array, sample_time_s: float) -> Array:
    """Return LuGre friction [N] along a motion, shape ``(n,)``."""
    return simulate(parameters, velocity_m_s, sample_time_s, new_bristle())

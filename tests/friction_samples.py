"""One physical set of numbers for LuGre, and a path with everything in it."""

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.friction_models.identification.presliding import bristle_damping, damping_velocity
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
from cylinder_friction.friction_models.parameters import ModelParameters

CURVE = {"coulomb_n": 240.0, "static_n": 360.0, "stribeck_velocity_m_s": 8e-3, "stribeck_exponent": 1.5}
PLAIN_LUGRE = LugreParameters(
    **CURVE, viscous_n_s_m=1500.0, bristle_stiffness_n_m=5e6, bristle_damping_n_s_m=4000.0, damping_velocity_m_s=8e-3
)
ODD: dict[str, ModelParameters] = {"lugre": PLAIN_LUGRE}
"""Without pressure or direction."""


def held_path(sample_time_s: float) -> NDArray[np.float64]:
    """Return presliding to and fro, breakaway, fast sliding, a slow stretch, dwell, reversal, dwell, stick again."""
    stretches = [
        (1e-4, 0.05),
        (-1.5e-4, 0.05),
        (2e-3, 0.1),
        (0.08, 0.1),
        (0.012, 0.1),
        (0.0, 0.25),
        (5e-3, 0.05),
        (-0.03, 0.1),
        (-1e-3, 0.1),
        (0.0, 0.1),
        (1e-4, 0.05),
        (0.2, 0.05),
        (-0.2, 0.05),
    ]
    return np.concatenate([np.full(round(lasting / sample_time_s), speed) for speed, lasting in stretches])


def new_bristle() -> NDArray[np.float64]:
    """Return the bristle deflection before the first sample, shape ``(1,)`` [m]."""
    return LuGre().new_state()


def simulate(
    parameters: LugreParameters,
    velocity_m_s: NDArray[np.float64],
    sample_time_s: float,
    bristle_m: NDArray[np.float64],
    pressure_pa: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return LuGre's friction [N], shape ``(n,)``; changes the bristle deflection."""
    return LuGre().simulate(parameters.packed(), velocity_m_s, sample_time_s, bristle_m, pressure_pa)


def lugre_to_find(mass_kg: float, slope_n_pa: float = 0.0) -> LugreParameters:
    """Return LuGre with a direction, its bristles damped by half of critically on this mass."""
    damping = bristle_damping(0.5, 2e6, mass_kg, 1500.0)
    return LugreParameters(
        **CURVE,
        viscous_n_s_m=1500.0,
        bristle_stiffness_n_m=2e6,
        bristle_damping_n_s_m=damping,
        damping_velocity_m_s=damping_velocity(8e-3, 240.0, damping),
        retract_ratio=1.2,
        pressure_slope_n_pa=slope_n_pa,
    )

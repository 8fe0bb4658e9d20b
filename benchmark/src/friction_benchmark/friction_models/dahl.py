"""Dahl friction: the stress-strain curve of a solid, as a function of travel."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numba

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import (
    COULOMB,
    SCALING,
    STIFFNESS,
    VISCOUS,
    ModelParameters,
    ParameterSpec,
)
from friction_benchmark.friction_models.dry_friction import side_factor


@dataclass(frozen=True)
class DahlParameters(ModelParameters):
    """``dFd/dt = s0 v (1 - Fd sgn(v) / Fmax)`` and ``F = Fd + s2 v`` with ``Fmax = side(v) (Fc + k p)``."""

    specs: ClassVar[tuple[ParameterSpec, ...]] = (COULOMB, VISCOUS, STIFFNESS, *SCALING)

    coulomb_n: float
    viscous_n_s_m: float
    bristle_stiffness_n_m: float
    retract_ratio: float = 1.0
    pressure_slope_n_pa: float = 0.0


@numba.njit(cache=True)
def _simulate(
    packed: Array, velocity: Array, log_speed: Array, pressure: Array, sample_time: float, state: Array, friction: Array
) -> None:
    coulomb, viscous, stiffness = packed[0], packed[1], packed[2]
    dry = state[0]
    for row in range(velocity.shape[0]):
        v = velocity[row]
        if v != 0.0:
            direction = 1.0 if v > 0.0 else -1.0
            strength = coulomb * side_factor(direction, packed[3], coulomb, packed[4], pressure[row])
            limit = direction * strength
            dry = limit + (dry - limit) * math.exp(-stiffness * abs(v) * sample_time / strength)
        friction[row] = dry + viscous * v
    state[0] = dry


class Dahl(FrictionModel):
    """Dahl's model (1968) with exponent 1, and viscous friction beside it, without which it could not slide in oil.

    At a held velocity the equation is linear and is stepped exactly. It knows no Stribeck effect and no rate.
    """

    short_name = "dahl"
    short_title = "Dahl"
    parameter_class = DahlParameters
    start = (0.0,)  # Friction without its viscous part [N]
    kernel = staticmethod(_simulate)
    multiply_adds = 30

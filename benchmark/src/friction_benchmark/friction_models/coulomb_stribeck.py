"""Coulomb, Stribeck and viscous friction: a function of velocity, with a stated rule for standstill."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numba

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import SCALING, STRIBECK, ParameterSpec, StribeckParameters
from friction_benchmark.friction_models.dry_friction import falling_part, side_factor

RISE = ParameterSpec("regularising_velocity_m_s", "m/s", "speed over which friction rises to its curve", 1e-5, 2e-2)
STANDSTILL = ParameterSpec(
    "standstill_share", "1", "share of static friction that is left at standstill", 1e-3, 1.0, 0.5, logarithmic=False
)


@dataclass(frozen=True)
class CoulombStribeckParameters(StribeckParameters):
    """``F = d (1 + k p / Fc) side(d) g(v) [q + (1 - q) tanh(|v| / vr)] + s2 v``.

    ``g(v) = Fc + (Fs - Fc) exp(-|v / vs|**a)``, ``d`` is the direction of the last motion, 0 before the first.
    """

    specs: ClassVar[tuple[ParameterSpec, ...]] = (*STRIBECK, RISE, STANDSTILL, *SCALING)

    regularising_velocity_m_s: float
    standstill_share: float
    retract_ratio: float = 1.0
    pressure_slope_n_pa: float = 0.0


@numba.njit(cache=True)
def _simulate(
    packed: Array, velocity: Array, log_speed: Array, pressure: Array, sample_time: float, state: Array, friction: Array
) -> None:
    coulomb, static, viscous = packed[0], packed[1], packed[4]
    slowest, share = packed[5], packed[6]
    direction = state[0]
    for row in range(velocity.shape[0]):
        v = velocity[row]
        speed = abs(v)
        dry, risen = static, share
        if speed > 0.0:
            direction = 1.0 if v > 0.0 else -1.0
            dry = coulomb + (static - coulomb) * falling_part(log_speed[row], packed[2], packed[3])
            risen = share + (1.0 - share) * math.tanh(speed / slowest)
        dry *= side_factor(direction, packed[7], coulomb, packed[8], pressure[row])
        friction[row] = direction * dry * risen + viscous * v
    state[0] = direction


class CoulombStribeck(FrictionModel):
    """The static curve, with the least memory that standstill needs: the direction of the last motion.

    A static curve is undefined at standstill, where friction balances the drive. Here friction keeps a share of its
    static value in the direction of the last motion, as oil stays trapped; slow motion blends into the curve as a
    hyperbolic tangent. Share and speed are identified; a share near 0 is the usual regularisation.

    Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, section 2.1; tanh: Andersson, Soederberg, Bjoerklund 2007.
    """

    short_name = "stribeck"
    short_title = "Coulomb–viscous–Stribeck"
    parameter_class = CoulombStribeckParameters
    start = (0.0,)  # Direction of the last motion
    kernel = staticmethod(_simulate)
    multiply_adds = 75

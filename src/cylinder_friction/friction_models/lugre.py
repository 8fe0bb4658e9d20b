"""LuGre friction, with and without pressure scaling, stepped exactly at a velocity that is held over the step."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numba
import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import (
    DAMPING,
    DAMPING_VELOCITY,
    SCALING,
    STIFFNESS,
    STRIBECK,
    ParameterSpec,
    StribeckParameters,
)
from cylinder_friction.friction_models.stribeck import StribeckCurve

LUGRE_STEP_MULTIPLY_ADDS = 100
"""Multiply-adds of one step: five exponentials or logarithms at about 16 each, and the rest."""


@dataclass(frozen=True)
class LugreParameters(StribeckParameters):
    """The LuGre model of Canudas de Wit et al. 1995, with bristle damping that fades with speed.

    ``dz/dt = v - s0 * |v| / g(v, p) * z`` and ``F = s0 * z + s1 * exp(-(v / vc)**2) * dz/dt + s2 * v`` with
    ``g(v, p) = side(v) * (1 + k * p / Fc) * [Fc + (Fs - Fc) * exp(-|v / vs|**a)]``. So at pressure ``p`` Coulomb
    friction is ``Fc + k * p`` and static friction keeps its ratio to it; ``k = 0`` is the plain model.
    ``StribeckParameters`` describes the numbers of the curve.

    Raises:
        ValueError: A number is not finite or has an impossible sign, or static is below Coulomb.

    Source: Canudas de Wit, Olsson, Astrom and Lischinsky 1995; fading damping: Astrom and Canudas de Wit 2008.

    Example:
        >>> from cylinder_friction.friction_models.lugre import LugreParameters
        >>> parameters = LugreParameters(300.0, 420.0, 0.01, 1.0, 800.0, 1e7, 2e4, damping_velocity_m_s=0.05)
        >>> parameters.is_passive()
        True
        >>> round(parameters.passive_damping_velocity_m_s, 3)
        0.14
    """

    specs: ClassVar[tuple[ParameterSpec, ...]] = (*STRIBECK, STIFFNESS, DAMPING, DAMPING_VELOCITY, *SCALING)

    bristle_stiffness_n_m: float  # Bristle stiffness s0 [N/m]
    bristle_damping_n_s_m: float  # Bristle damping s1 at standstill [N s/m]
    damping_velocity_m_s: float  # Speed vc over which bristle damping fades [m/s]
    retract_ratio: float = 1.0  # Dry friction while retracting over dry friction while extending
    pressure_slope_n_pa: float = 0.0  # Coulomb friction k per pascal of the pressure that the caller chooses [N/Pa]

    @property
    def curve(self) -> StribeckCurve:
        """The friction of steady sliding at zero gauge pressure."""
        return StribeckCurve(
            self.coulomb_n,
            self.static_n,
            self.stribeck_velocity_m_s,
            self.stribeck_exponent,
            self.viscous_n_s_m,
            self.retract_ratio,
        )

    @property
    def passive_damping_velocity_m_s(self) -> float:
        """The greatest ``damping_velocity_m_s`` that keeps the model passive, ``4 sqrt(2e) min g / s1`` [m/s].

        A passive model never returns more energy than its bristles stored. A sufficient condition is
        ``s1 exp(-(v/vc)^2) |v| <= 4 g(v)`` at every speed; the left side is greatest at ``vc / sqrt 2``.
        """
        return passive_damping_velocity(self.coulomb_n * min(1.0, self.retract_ratio), self.bristle_damping_n_s_m)

    def is_passive(self) -> bool:
        return self.damping_velocity_m_s <= self.passive_damping_velocity_m_s


def _simulate(
    packed: Array,
    velocity: Array,
    log_speed: Array,
    pressure: Array,
    sample_time: float,
    bristle: Array,
    friction: Array,
) -> None:
    """Step through all rows. NumPy computes what does not depend on the bristles: it is many times faster than a loop.

    At a held velocity, the deflection moves by the share ``bent`` of its distance to the ``limit`` of steady sliding.
    """
    coulomb, static, stribeck_velocity, exponent, viscous, stiffness, damping, fading, ratio, slope = packed.tolist()
    falling = np.exp(-np.exp(exponent * (log_speed - math.log(stribeck_velocity))))
    dry = (coulomb + (static - coulomb) * falling) * np.where(velocity < 0.0, ratio, 1.0)
    # Below zero gauge pressure (a noisy sensor on an open port) the seal is not relieved further.
    dry *= 1.0 + slope / coulomb * np.maximum(pressure, 0.0)
    limit = np.copysign(dry / stiffness, velocity)
    bent = -np.expm1(-stiffness * sample_time * np.abs(velocity) / dry)
    damping_per_step = damping / sample_time * np.exp(-((velocity / fading) ** 2))
    _bend(limit, bent, damping_per_step, stiffness, bristle, friction)
    friction += viscous * velocity


@numba.njit(cache=True)
def _bend(
    limit: Array, bent: Array, damping_per_step: Array, stiffness: float, bristle: Array, friction: Array
) -> None:
    deflection = bristle[0]
    for row in range(limit.shape[0]):
        change = bent[row] * (limit[row] - deflection)
        deflection += change
        friction[row] = stiffness * deflection + damping_per_step[row] * change
    bristle[0] = deflection


class LuGre(FrictionModel):
    """Bristles that bend and slip (``LugreParameters`` has the equations), with or without pressure scaling.

    Source: Canudas de Wit, Olsson, Astrom and Lischinsky 1995. Coulomb friction with a preload and a pressure
    coefficient times the sum of pressures is the usual law in simulation tools (Simscape's Cylinder Friction).

    Example:
        >>> import numpy as np
        >>> from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
        >>> parameters = LugreParameters(300.0, 420.0, 0.01, 1.0, 800.0, 1e7, 2e4, damping_velocity_m_s=0.05)
        >>> model = LuGre()
        >>> friction_n = model.simulate(parameters.packed(), np.full(400, 0.1), 0.005, model.new_state())
        >>> friction_n[-1:].round(1).tolist()  # on the Stribeck curve: 300 N and 800 N s/m times 0.1 m/s
        [380.0]
    """

    short_name = "lugre"
    short_title = "LuGre"
    parameter_class = LugreParameters
    start = (0.0,)  # Bristle deflection [m]
    kernel = staticmethod(_simulate)
    multiply_adds = LUGRE_STEP_MULTIPLY_ADDS


def passive_damping_velocity(least_dry_friction_n: float, bristle_damping_n_s_m: float) -> float:
    """Compute the greatest ``vc`` [m/s] at which damping ``s1 * exp(-(v / vc)**2)`` leaves LuGre passive.

    Use it to choose ``damping_velocity_m_s``: with a greater value, a simulation can gain energy and oscillate. Give
    the least dry friction ``g`` of both directions [N] and the bristle damping ``s1`` at standstill [N s/m].

    Example:
        >>> from cylinder_friction.friction_models.lugre import passive_damping_velocity
        >>> round(passive_damping_velocity(300.0, 2e4), 3)
        0.14
    """
    if bristle_damping_n_s_m == 0.0:
        return math.inf
    return 4.0 * math.sqrt(2.0 * math.e) * least_dry_friction_n / bristle_damping_n_s_m

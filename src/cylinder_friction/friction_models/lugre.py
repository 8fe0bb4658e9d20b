"""LuGre friction, with and without pressure scaling, stepped exactly at a velocity that is held over the step."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.friction_models.stribeck import StribeckCurve, refuse_unphysical_curve

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LUGRE_UNITS = {
    "coulomb_n": "N",
    "static_n": "N",
    "stribeck_velocity_m_s": "m/s",
    "stribeck_exponent": "1",
    "viscous_n_s_m": "N s/m",
    "bristle_stiffness_n_m": "N/m",
    "bristle_damping_n_s_m": "N s/m",
    "damping_velocity_m_s": "m/s",
    "retract_ratio": "1",
    "pressure_slope_n_pa": "N/Pa",
}
"""Unit of every parameter, in the order of the fields of ``LugreParameters``."""


@dataclass(frozen=True)
class LugreParameters:
    """The LuGre model of Canudas de Wit et al. 1995, with bristle damping that fades with speed.

    ``dz/dt = v - s0 * |v| / g(v, p) * z`` and ``F = s0 * z + s1 * exp(-(v / vc)**2) * dz/dt + s2 * v`` with
    ``g(v, p) = side(v) * (1 + k * p / Fc) * [Fc + (Fs - Fc) * exp(-|v / vs|**a)]``. So at pressure ``p`` Coulomb
    friction is ``Fc + k * p`` and static friction keeps its ratio to it; ``k = 0`` is the plain model.

    Attributes:
        coulomb_n: Coulomb friction Fc while extending, at zero gauge pressure [N].
        static_n: Static friction Fs while extending, at zero gauge pressure [N], at least ``coulomb_n``.
        stribeck_velocity_m_s: Stribeck velocity vs [m/s].
        stribeck_exponent: Exponent a of the Stribeck curve.
        viscous_n_s_m: Viscous coefficient s2 [N s/m].
        bristle_stiffness_n_m: Bristle stiffness s0 [N/m].
        bristle_damping_n_s_m: Bristle damping s1 at standstill [N s/m].
        damping_velocity_m_s: Speed vc over which bristle damping fades [m/s].
        retract_ratio: Dry friction while retracting over dry friction while extending.
        pressure_slope_n_pa: Coulomb friction per pascal k [N/Pa]; which pressure is the user's choice.

    Raises:
        ValueError: A number is not finite or has an impossible sign, or static is below Coulomb.

    Source: Canudas de Wit, Olsson, Astrom and Lischinsky 1995; fading damping: Astrom and Canudas de Wit 2008.
    """

    coulomb_n: float
    static_n: float
    stribeck_velocity_m_s: float
    stribeck_exponent: float
    viscous_n_s_m: float
    bristle_stiffness_n_m: float
    bristle_damping_n_s_m: float
    damping_velocity_m_s: float
    retract_ratio: float = 1.0
    pressure_slope_n_pa: float = 0.0

    def __post_init__(self) -> None:
        refuse_unphysical_curve(self)
        for field in ("bristle_stiffness_n_m", "damping_velocity_m_s"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"LugreParameters: {field} must be a positive number, but got {value!r}")
        for field in ("bristle_damping_n_s_m", "pressure_slope_n_pa"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"LugreParameters: {field} must be zero or a positive number, but got {value!r}")

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
        """The greatest fading speed that keeps the model passive, ``4 sqrt(2e) min g / s1`` [m/s]; may be infinite."""
        return passive_damping_velocity(self.coulomb_n * min(1.0, self.retract_ratio), self.bristle_damping_n_s_m)

    def is_passive(self) -> bool:
        """Returns whether the model can never give energy back beyond what its bristles stored.

        Sufficient: ``s1 exp(-(v/vc)^2) |v| <= 4 g(v)`` at every speed, whose left side is greatest at ``vc / sqrt 2``.
        """
        return self.damping_velocity_m_s <= self.passive_damping_velocity_m_s

    def packed(self) -> Array:
        """Returns the numbers in the order of the fields, shape ``(10,)``, as the compiled functions take them."""
        return np.array([getattr(self, field.name) for field in fields(self)], dtype=np.float64)


def passive_damping_velocity(least_dry_friction_n: float, bristle_damping_n_s_m: float) -> float:
    """Returns the greatest ``vc`` [m/s] at which damping ``s1 * exp(-(v / vc)**2)`` leaves LuGre passive."""
    if bristle_damping_n_s_m == 0.0:
        return math.inf
    return 4.0 * math.sqrt(2.0 * math.e) * least_dry_friction_n / bristle_damping_n_s_m


def new_bristle() -> Array:
    """Returns the bristle deflection before the first sample, shape ``(1,)`` [m]; ``simulate`` changes it in place."""
    return np.zeros(1)


def simulate(
    parameters: LugreParameters,
    velocity_m_s: Array,
    sample_time_s: float,
    bristle_m: Array,
    pressure_pa: Array | None = None,
) -> Array:
    """Returns friction [N], shape ``(n,)``, at the end of each sample, over which velocity and pressure are held.

    Each step is the exact solution at the held velocity, so it is stable however stiff the bristles are. Cutting
    the samples into pieces does not change one bit.

    Args:
        parameters: The model.
        velocity_m_s: Velocity, shape ``(n,)``.
        sample_time_s: Time between two samples [s].
        bristle_m: State from ``new_bristle``, changed in place.
        pressure_pa: Gauge pressure that scales dry friction, shape ``(n,)``; zero where there is none.
    """
    velocity = np.ascontiguousarray(velocity_m_s, dtype=np.float64)
    pressure = np.zeros_like(velocity) if pressure_pa is None else np.ascontiguousarray(pressure_pa, dtype=np.float64)
    if pressure.shape != velocity.shape:
        raise ValueError(f"pressure_pa has shape {pressure.shape}, but velocity_m_s has {velocity.shape}; expected one")
    friction = np.empty_like(velocity)
    _simulate(parameters.packed(), velocity, pressure, sample_time_s, bristle_m, friction)
    return friction


@numba.njit(cache=True)
def lugre_step(
    packed: Array, velocity: float, log_speed: float, pressure: float, sample_time: float, bristle: float
) -> tuple[float, float]:
    """Returns the new bristle deflection [m] and friction [N] after one sample; ``log_speed`` is ``ln |velocity|``.

    The logarithm is an argument so that a search over parameters on one recording computes it once.
    """
    stiffness = packed[5]
    if velocity == 0.0:
        return bristle, stiffness * bristle
    coulomb, static = packed[0], packed[1]
    speed = abs(velocity)
    falling = math.exp(-math.exp(packed[3] * (log_speed - math.log(packed[2]))))
    dry = coulomb + (static - coulomb) * falling
    # Below zero gauge pressure (a noisy sensor on an open port) the seal is not relieved further.
    dry *= 1.0 + packed[9] * max(pressure, 0.0) / coulomb
    if velocity < 0.0:
        dry *= packed[8]
    decay = stiffness * speed * sample_time / dry
    after = bristle * math.exp(-decay) - math.expm1(-decay) * (velocity / speed) * (dry / stiffness)
    rate = (after - bristle) / sample_time
    damping = packed[6] * math.exp(-((velocity / packed[7]) ** 2))
    return after, stiffness * after + damping * rate + packed[4] * velocity


@numba.njit(cache=True)
def _simulate(
    packed: Array, velocity: Array, pressure: Array, sample_time: float, bristle: Array, friction: Array
) -> None:
    deflection = bristle[0]
    for row in range(velocity.shape[0]):
        speed = abs(velocity[row])
        log_speed = math.log(speed) if speed > 0.0 else 0.0
        deflection, friction[row] = lugre_step(packed, velocity[row], log_speed, pressure[row], sample_time, deflection)
    bristle[0] = deflection


@numba.njit(cache=True)
def mean_absolute_error(
    packed: Array,
    velocity: Array,
    log_speed: Array,
    pressure: Array,
    friction: Array,
    usable: NDArray[np.bool_],
    starts: NDArray[np.int64],
    sample_time: float,
) -> float:
    """Returns the mean absolute difference between model and ``friction`` [N]; each motion from a fresh state.

    It stands beside ``lugre_step`` because numba's cache on disk notices changes in its own file only.
    """
    total, count = 0.0, 0
    for motion in range(starts.shape[0] - 1):
        bristle = 0.0
        for row in range(starts[motion], starts[motion + 1]):
            bristle, estimate = lugre_step(packed, velocity[row], log_speed[row], pressure[row], sample_time, bristle)
            if usable[row]:
                total += abs(estimate - friction[row])
                count += 1
    return total / count

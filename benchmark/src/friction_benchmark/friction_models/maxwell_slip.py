"""Generalised Maxwell-slip friction: elements in parallel that stick like springs or slip along the Stribeck curve."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numba
import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import SCALING, STIFFNESS, STRIBECK, ParameterSpec, StribeckParameters
from friction_benchmark.friction_models.dry_friction import falling_part, side_factor

ELEMENTS = 6

SLIP = (
    ParameterSpec(
        "travel_spread", "1", "travel at which the last element slips over that of the first", 1.05, 500.0, 10.0
    ),
    ParameterSpec("share_tilt", "1", "share of friction of the last element over that of the first", 0.05, 20.0, 1.0),
    ParameterSpec("attraction_n_s", "N/s", "how fast slipping elements follow the Stribeck curve", 10.0, 1e6, 1e4),
)


@dataclass(frozen=True)
class MaxwellSlipParameters(StribeckParameters):
    """Element ``i`` sticks with ``dFi/dt = ki v`` until ``|Fi| = ni s(v)``, then slips until velocity changes sign.

    Slipping, ``dFi/dt = C (ni sgn(v) - Fi / s(v))``. ``F = sum Fi + s2 v``, ``sum ni = 1``,
    ``s(v) = side(v) (1 + k p / Fc) [Fc + (Fs - Fc) exp(-|v / vs|**a)]``.

    Of ``N`` elements, the shares ``ni`` and the travels ``ni s / ki`` at which they slip are geometric sequences:
    ``share_tilt`` and ``travel_spread`` are their last over their first, and the stiffnesses sum to
    ``bristle_stiffness_n_m``. So a presliding curve of any number of elements takes three numbers.
    """

    specs: ClassVar[tuple[ParameterSpec, ...]] = (*STRIBECK, STIFFNESS, *SLIP, *SCALING)

    bristle_stiffness_n_m: float
    travel_spread: float
    share_tilt: float
    attraction_n_s: float
    retract_ratio: float = 1.0
    pressure_slope_n_pa: float = 0.0

    def elements(self) -> tuple[Array, Array]:
        """Return the elements' stiffnesses ``ki`` [N/m] and shares ``ni``, each of shape ``(N,)``."""
        return _elements(self.packed(), ELEMENTS)


@numba.njit(cache=True)
def _elements(packed: Array, count: int) -> tuple[Array, Array]:
    stiffnesses, shares = np.empty(count), np.empty(count)
    for element in range(count):
        place = element / (count - 1) if count > 1 else 0.0
        shares[element] = packed[7] ** place
        stiffnesses[element] = shares[element] / packed[6] ** place
    return stiffnesses * (packed[5] / stiffnesses.sum()), shares / shares.sum()


@numba.njit(cache=True)
def _simulate(
    packed: Array, velocity: Array, log_speed: Array, pressure: Array, sample_time: float, state: Array, friction: Array
) -> None:
    coulomb, static, viscous, attraction = packed[0], packed[1], packed[4], packed[8]
    count = (state.shape[0] - 1) // 2
    stiffness, share = _elements(packed, count)
    for row in range(velocity.shape[0]):
        v = velocity[row]
        if v == 0.0:
            state[count:] = 0.0
        else:
            speed = abs(v)
            direction = 1.0 if v > 0.0 else -1.0
            if direction != state[2 * count]:
                state[count : 2 * count] = 0.0
                state[2 * count] = direction
            strength = coulomb + (static - coulomb) * falling_part(log_speed[row], packed[2], packed[3])
            strength *= side_factor(direction, packed[9], coulomb, packed[10], pressure[row])
            kept = math.exp(-attraction * sample_time / strength)
            for element in range(count):
                limit = share[element] * strength
                along = direction * state[element]
                if state[count + element] == 1.0 or along >= limit:
                    along = limit + (along - limit) * kept
                    state[count + element] = 1.0
                else:
                    along += stiffness[element] * speed * sample_time
                    if along >= limit:
                        along = limit
                        state[count + element] = 1.0
                state[element] = direction * along
        total = 0.0
        for element in range(count):
            total += state[element]
        friction[row] = total + viscous * v


class GeneralisedMaxwellSlip(FrictionModel):
    """GMS: presliding hysteresis with memory of its turning points, no drift, and frictional lag in sliding.

    At a held velocity every element is stepped exactly: straight while it sticks, from the moment within the step at
    which it slips on its limit, and exponentially towards the limit when it slips.

    Source: Al-Bender, Lampaert and Swevers 2005.
    """

    short_name = "gms"
    short_title = "Generalised Maxwell-slip"
    parameter_class = MaxwellSlipParameters
    start = (0.0,) * (2 * ELEMENTS + 1)  # Each element's force [N], whether it slips (1 or 0), and the direction last
    kernel = staticmethod(_simulate)
    multiply_adds = 120

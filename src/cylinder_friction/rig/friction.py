"""The rig's true friction, which is outside the class of LuGre and related models.

Presliding and breakaway follow generalised Maxwell-slip: elements that stick or slip (Al-Bender, Lampaert and Swevers,
2005). Their strength is a Stribeck curve with a lubricant film that thins slowly at rest (Yanada and Sekikawa, 2008).
Its level depends on both chamber pressures (oil presses on the seals), direction, temperature, position and drift.

Friction is positive when it opposes positive velocity. ``f`` is ``FrictionConstants`` throughout.
"""

import math
from typing import Any

import numba

from cylinder_friction.rig.parameters import BAR_PA

REFERENCE_C = 40.0


@numba.njit(cache=True)
def viscosity_ratio(f: Any, temperature_c: float) -> float:
    """Compute the oil's viscosity over that at 40 °C."""
    return math.exp(-f.viscosity_temperature_1_k * (temperature_c - REFERENCE_C))


@numba.njit(cache=True)
def coulomb_friction(f: Any, pressure_1_pa: float, pressure_2_pa: float, place: float, temperature_c: float) -> float:
    """Compute Coulomb friction [N], the mean of both directions.

    ``F_C = F0(T) + c_p max(p1, p2)^0.8 + c_r p2^0.7`` with pressures in bar, times ``place`` (ripple and drift).
    A rod on side 1 adds ``c_r p1^0.7``.
    """
    higher_bar = max(pressure_1_pa, pressure_2_pa, 0.0) / BAR_PA
    rod_bar = max(pressure_2_pa, 0.0) / BAR_PA
    free = f.coulomb_n * (1.0 - f.coulomb_temperature_1_k * (temperature_c - REFERENCE_C))
    rod_1 = (max(pressure_1_pa, 0.0) / BAR_PA) ** 0.7 if f.rod_on_side_1 else 0.0
    return place * (free + f.piston_seal_n * higher_bar**0.8 + f.rod_seal_n * (rod_bar**0.7 + rod_1))


@numba.njit(cache=True)
def place_factor(f: Any, position_m: float, stroke_m: float, drift: float) -> float:
    """Compute the factor on Coulomb friction at this place in the bore and this time: ripple, bend and drift."""
    factor = drift + f.bend_n_per_n * (position_m / stroke_m) ** 2
    for wave in range(len(f.ripple)):
        angle = 2.0 * math.pi * position_m / f.ripple_length_m[wave] + f.ripple_phase_rad[wave]
        factor += f.ripple[wave] * math.sin(angle)
    return factor


@numba.njit(cache=True)
def ageing_factor(f: Any, age_s: float) -> float:
    """Compute the factor on dry friction of contacts of this age (Dieterich, 1979)."""
    return 1.0 + f.ageing * math.log1p(age_s / f.ageing_onset_s)


@numba.njit(cache=True)
def strength(f: Any, coulomb_n: float, velocity_m_s: float, film: float, viscosity: float) -> float:
    """Compute the Stribeck strength s [N], the mean of both directions.

    ``s = F_C + [(1 - h) F_S - F_C] exp(-|v| / v_s)`` (Yanada and Sekikawa, 2008, with exponent 1); ``v_s`` grows as
    the viscosity falls.
    """
    decay = math.exp(-abs(velocity_m_s) * viscosity / f.stribeck_velocity_m_s)
    return coulomb_n * (1.0 + ((1.0 - film) * f.static_ratio - 1.0) * decay)


@numba.njit(cache=True)
def direction_factor(f: Any, direction: float) -> float:
    """Compute the factor on the strength: smaller in extension (``direction`` > 0) than in retraction."""
    return 1.0 - f.asymmetry if direction > 0.0 else 1.0 + f.asymmetry


@numba.njit(cache=True)
def film_rate(f: Any, film: float, velocity_m_s: float, viscosity: float) -> tuple[float, float]:
    """Compute the film's limit, ``h_ss = K_f min(|v|, v_b)^(2/3)`` [-], and its rate [1/s].

    It builds fast and thins slowly, slowest at rest.
    """
    speed = abs(velocity_m_s)
    target = (1.0 - 1.0 / f.static_ratio) * min(speed * viscosity / f.film_velocity_m_s, 1.0) ** (2.0 / 3.0)
    if film <= target:
        return target, 1.0 / f.film_build_s
    moving = speed / (speed + f.dwell_velocity_m_s)
    return target, (1.0 - moving) / f.film_dwell_s + moving / f.film_squeeze_s


@numba.njit(cache=True)
def damping(f: Any, velocity_m_s: float, viscosity: float) -> float:
    """Compute viscous plus presliding damping [N s/m], the factor on the velocity."""
    ratio = velocity_m_s / f.damping_velocity_m_s
    presliding = f.damping_n_s_m * math.exp(-ratio * ratio) if abs(ratio) < 6.0 else 0.0
    return f.viscous_n_s_m * viscosity + presliding

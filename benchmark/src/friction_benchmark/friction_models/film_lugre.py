"""LuGre whose Stribeck curve rides on a lubricant film that builds, is squeezed out, and thins at rest."""

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
from friction_benchmark.friction_models.dry_friction import falling_part, side_factor

TIMES_S = (1e-3, 100.0, 0.5)
"""Bounds and start of every time constant of the film, none of which is known before the search: five decades, from a
fast logger's sample to minutes."""
FILM = (
    ParameterSpec("film_velocity_m_s", "m/s", "speed above which the film grows no more", 1e-3, 1.0),
    ParameterSpec("film_build_s", "s", "time constant of a film that builds", *TIMES_S),
    ParameterSpec("film_squeeze_s", "s", "time constant of a film that thins in motion", *TIMES_S),
    ParameterSpec("film_dwell_s", "s", "time constant of a film that thins at standstill", *TIMES_S),
    ParameterSpec("film_inertia_s", "s", "lead of viscous friction on acceleration", 1e-5, 1.0, 5e-3),
)


@dataclass(frozen=True)
class FilmLugreParameters(StribeckParameters):
    """The equations of LuGre with ``g(v, h)``, and the film ``h`` beside them.

    ``dz/dt = v - s0 |v| z / g``, ``F = s0 z + s1 exp(-(v / vc)**2) dz/dt + s2 (v + T dv/dt)``,
    ``g(v, h) = side(v) (1 + k p / Fc) (Fc + [(1 - h) Fs - Fc] exp(-|v / vs|**a))``, ``dh/dt = (hss - h) / tau``,
    ``hss = (1 - Fc / Fs) (min(|v|, vb) / vb)**(2/3)``, and ``tau`` is ``film_build_s`` where ``h <= hss``,
    ``film_squeeze_s`` where ``h > hss``, ``film_dwell_s`` at ``v = 0``.
    """

    specs: ClassVar[tuple[ParameterSpec, ...]] = (*STRIBECK, STIFFNESS, DAMPING, DAMPING_VELOCITY, *FILM, *SCALING)

    bristle_stiffness_n_m: float
    bristle_damping_n_s_m: float
    damping_velocity_m_s: float
    film_velocity_m_s: float
    film_build_s: float
    film_squeeze_s: float
    film_dwell_s: float
    film_inertia_s: float
    retract_ratio: float = 1.0
    pressure_slope_n_pa: float = 0.0


@numba.njit(cache=True)
def _simulate(
    packed: Array, velocity: Array, log_speed: Array, pressure: Array, sample_time: float, state: Array, friction: Array
) -> None:
    coulomb, static, viscous, stiffness = packed[0], packed[1], packed[4], packed[5]
    full_film = 1.0 - coulomb / static
    log_film_velocity = math.log(packed[8])
    # What is left of a film's distance from steady state after a step, and the mean of it over the step.
    kept, mean = np.empty(3), np.empty(3)
    for regime in range(3):
        steps = sample_time / packed[9 + regime]
        kept[regime] = math.exp(-steps)
        mean[regime] = -math.expm1(-steps) / steps
    bristle, film, last = state[0], state[1], state[2]
    for row in range(velocity.shape[0]):
        v = velocity[row]
        rate = 0.0 if np.isnan(last) else (v - last) / sample_time
        last = v
        viscous_part = viscous * (v + packed[12] * rate)
        speed = abs(v)
        if speed == 0.0:
            film *= kept[2]
            friction[row] = stiffness * bristle + viscous_part
            continue
        steady = full_film * math.exp(min(log_speed[row] - log_film_velocity, 0.0) * (2.0 / 3.0))
        regime = 0 if film <= steady else 1
        offset = film - steady
        film_mean = steady + offset * mean[regime]
        film = steady + offset * kept[regime]
        falling = falling_part(log_speed[row], packed[2], packed[3])
        dry = coulomb + ((1.0 - film_mean) * static - coulomb) * falling
        dry *= side_factor(v, packed[13], coulomb, packed[14], pressure[row])
        decay = stiffness * speed * sample_time / dry
        after = bristle * math.exp(-decay) - math.expm1(-decay) * (v / speed) * (dry / stiffness)
        damping = packed[6] * math.exp(-((v / packed[7]) ** 2))
        friction[row] = stiffness * after + damping * (after - bristle) / sample_time + viscous_part
        bristle = after
    state[0], state[1], state[2] = bristle, film, last


class FilmLuGre(FrictionModel):
    """LuGre with lubricant-film dynamics and the inertia of the fluid film; bristle damping fades with speed.

    At a held velocity the film is stepped exactly, and the bristles exactly for the mean film over the step.
    ``dv/dt`` is the difference of two samples over their distance. ``film_inertia_s`` near 0 is the model of 2008.

    Source: Yanada and Sekikawa 2008; ``T dv/dt``: Tran, Hafizah and Yanada 2012.
    """

    short_name = "film_lugre"
    short_title = "LuGre with lubricant film"
    parameter_class = FilmLugreParameters
    start = (0.0, 0.0, math.nan)  # Bristle deflection [m], film [1] and last velocity [m/s; NaN before the first]
    kernel = staticmethod(_simulate)
    multiply_adds = 160

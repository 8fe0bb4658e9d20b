"""The joint search over all LuGre parameters: differential evolution, then Nelder-Mead."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

from cylinder_friction.friction_models.identification.presliding import (
    STIFFNESS_RANGE_N_M,
    bristle_damping,
    damping_velocity,
)
from cylinder_friction.friction_models.lugre import LugreParameters

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from cylinder_friction.friction_models.identification.motion import Motions
    from cylinder_friction.friction_models.stribeck import StribeckCurve

    Array = NDArray[np.float64]

FIRST_PRESSURE_SHARE = 0.3
_LEAST_SHARE, _GREATEST_SHARE = 1e-3, 0.95


@dataclass(frozen=True)
class Coordinates:
    """How a point of the search becomes parameters: logarithms of what is positive, ratios of what belongs together.

    A point is ``(ln Fc at the reference pressure, Fs / Fc - 1, ln vs, a, ln s2, ln s0, ln retract ratio)`` and, for
    the pressure-scaled model, the share of ``Fc`` at the reference pressure that is owed to pressure. Damping is
    no coordinate: it follows from the damping ratio.

    Attributes:
        mass_kg: Moving mass, for the damping ratio [kg].
        damping_ratio: Damping ratio of the mass on its bristles.
        reference_pressure_pa: Where the first coordinate holds; 0 for the plain model [Pa].
        lower, upper: Where the search may go, shape ``(7,)`` or ``(8,)``.
    """

    mass_kg: float
    damping_ratio: float
    reference_pressure_pa: float
    lower: Array
    upper: Array

    @classmethod
    def around(
        cls, curve: StribeckCurve, mass_kg: float, damping_ratio: float, reference_pressure_pa: float = 0.0
    ) -> Coordinates:
        """Returns coordinates with generous bounds around a curve of steady sliding."""
        level = math.log(curve.coulomb_n)
        stiff_low, stiff_high = (math.log(value) for value in STIFFNESS_RANGE_N_M)
        lower = [level - 1.5, 0.0, math.log(1e-3), 0.5, math.log(1.0), stiff_low, math.log(0.4)]
        upper = [level + 1.0, 1.5, math.log(0.1), 3.0, math.log(5e4), stiff_high, math.log(2.5)]
        if reference_pressure_pa > 0.0:
            lower.append(_LEAST_SHARE)
            upper.append(_GREATEST_SHARE)
        return cls(mass_kg, damping_ratio, reference_pressure_pa, np.array(lower), np.array(upper))

    def parameters(self, point: Array) -> LugreParameters:
        """Returns the parameters at a point of the search."""
        level, stribeck_velocity = math.exp(point[0]), math.exp(point[2])
        viscous, stiffness, retract_ratio = math.exp(point[4]), math.exp(point[5]), math.exp(point[6])
        share = float(point[7]) if len(point) > 7 else 0.0
        coulomb = level * (1.0 - share)
        damping = bristle_damping(self.damping_ratio, stiffness, self.mass_kg, viscous)
        return LugreParameters(
            coulomb_n=coulomb,
            static_n=coulomb * (1.0 + max(float(point[1]), 0.0)),
            stribeck_velocity_m_s=stribeck_velocity,
            stribeck_exponent=float(point[3]),
            viscous_n_s_m=viscous,
            bristle_stiffness_n_m=stiffness,
            bristle_damping_n_s_m=damping,
            damping_velocity_m_s=damping_velocity(stribeck_velocity, coulomb * min(1.0, retract_ratio), damping),
            retract_ratio=retract_ratio,
            pressure_slope_n_pa=level * share / self.reference_pressure_pa if share > 0.0 else 0.0,
        )

    def point(self, parameters: LugreParameters) -> Array:
        """Returns the point of given parameters, moved into the bounds; their damping is not looked at."""
        owed_to_pressure = parameters.pressure_slope_n_pa * self.reference_pressure_pa
        level = parameters.coulomb_n + owed_to_pressure
        numbers = [
            math.log(level),
            parameters.static_n / parameters.coulomb_n - 1.0,
            math.log(parameters.stribeck_velocity_m_s),
            parameters.stribeck_exponent,
            math.log(max(parameters.viscous_n_s_m, 1.0)),
            math.log(parameters.bristle_stiffness_n_m),
            math.log(parameters.retract_ratio),
        ]
        if self.reference_pressure_pa > 0.0:
            numbers.append(owed_to_pressure / level)
        inside = 1e-6 * (self.upper - self.lower)
        return np.clip(np.array(numbers), self.lower + inside, self.upper - inside)

    def start(self, curve: StribeckCurve, stiffness_n_m: float) -> Array:
        """Returns the point of a steady curve and a stiffness; a first share of friction is owed to pressure."""
        slope = 0.0
        if self.reference_pressure_pa > 0.0:
            slope = FIRST_PRESSURE_SHARE * curve.coulomb_n / self.reference_pressure_pa
        kept = 1.0 - slope * self.reference_pressure_pa / curve.coulomb_n
        return self.point(
            LugreParameters(
                coulomb_n=kept * curve.coulomb_n,
                static_n=kept * curve.static_n,
                stribeck_velocity_m_s=curve.stribeck_velocity_m_s,
                stribeck_exponent=curve.stribeck_exponent,
                viscous_n_s_m=curve.viscous_n_s_m,
                bristle_stiffness_n_m=stiffness_n_m,
                bristle_damping_n_s_m=0.0,
                damping_velocity_m_s=curve.stribeck_velocity_m_s,
                retract_ratio=curve.retract_ratio,
                pressure_slope_n_pa=slope,
            )
        )


def search_globally(
    motions: Motions,
    coordinates: Coordinates,
    start: Array,
    seed: int,
    population: int,
    generations: int,
    each_generation: Callable[[], object],
) -> tuple[Array, list[float]]:
    """Returns the best point of differential evolution, and the least mean absolute error after each generation [N].

    Args:
        motions: What is simulated.
        coordinates: The space and its bounds.
        start: One member of the first population.
        seed: Seed of the random numbers.
        population: Members a coordinate.
        generations: Greatest number of generations.
        each_generation: Called after every generation, for a progress bar.

    Source: Storn and Price 1997.
    """
    history: list[float] = []
    best = [math.inf]

    def cost(point: Array) -> float:
        error = motions.mean_absolute_error(coordinates.parameters(point))
        best[0] = min(best[0], error)
        return error

    def note(*_: object, **__: object) -> None:
        history.append(best[0])
        each_generation()

    result = differential_evolution(
        cost,
        bounds=Bounds(coordinates.lower, coordinates.upper),
        x0=start,
        maxiter=generations,
        popsize=population,
        rng=np.random.default_rng(seed),
        polish=False,
        tol=1e-6,
        callback=note,
    )
    return np.asarray(result.x), history


def search_locally(motions: Motions, coordinates: Coordinates, start: Array, evaluations: int) -> Array:
    """Returns the best point of adaptive Nelder-Mead from ``start``.

    The first simplex spans a twentieth of the bounds a coordinate, because SciPy's own spans a twentieth of
    the value, which means nothing for a logarithm.

    Source: Gao and Han 2012.
    """
    steps = 0.05 * (coordinates.upper - coordinates.lower)
    inward = np.where(start + steps > coordinates.upper, -steps, steps)

    def cost(point: Array) -> float:
        return motions.mean_absolute_error(coordinates.parameters(point))

    first: Any = start
    options: Any = {
        "adaptive": True,
        "maxfev": evaluations,
        "maxiter": evaluations,
        "xatol": 1e-4,
        "fatol": 1e-5,
        "initial_simplex": np.vstack([start, start + np.diag(inward)]),
    }
    result = minimize(
        cost,
        first,
        method="Nelder-Mead",
        bounds=Bounds(coordinates.lower, coordinates.upper),
        options=options,
    )
    return np.asarray(result.x)

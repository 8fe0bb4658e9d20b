"""The joint search over all parameters of a friction model: its coordinates, differential evolution, Nelder-Mead."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.identification.presliding import bristle_damping, damping_velocity
from cylinder_friction.friction_models.identification.simulation import Motions
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import ModelParameters, ParameterSpec
from cylinder_friction.friction_models.stribeck import StribeckCurve


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of the search, one per searched parameter: logarithms of positive numbers, ratios of related ones.

    The logarithm of Coulomb friction at the reference pressure replaces ``coulomb_n``, the excess ``Fs / Fc - 1``
    replaces ``static_n``, and the share of that Coulomb friction due to pressure replaces ``pressure_slope_n_pa``.
    Bristle damping is no coordinate, as it follows from the damping ratio.
    """

    model: FrictionModel  # The model whose parameters are searched
    mass_kg: float  # Moving mass, for the damping ratio [kg]
    damping_ratio: float  # Damping ratio of the mass on its bristles
    reference_pressure_pa: float  # Pressure at which Coulomb friction is searched [Pa]; 0 without pressure
    # Limits of the search, shape ``(coordinates,)``
    lower: Array
    upper: Array

    @classmethod
    def around(
        cls,
        model: FrictionModel,
        curve: StribeckCurve,
        mass_kg: float,
        damping_ratio: float,
        reference_pressure_pa: float = 0.0,
    ) -> Coordinates:
        """Set up coordinates with the bounds of the model's specs, around a curve of steady sliding."""
        level = math.log(curve.coulomb_n)
        bounds = np.array([_bounds(spec, level) for spec in model.searched])
        return cls(model, mass_kg, damping_ratio, reference_pressure_pa, bounds[:, 0].copy(), bounds[:, 1].copy())

    def values(self, point: Array) -> Array:
        """Convert a point of the search to the model's numbers, shape ``(k,)``, in the order of its specs."""
        at = {
            spec.name: math.exp(number) if spec.logarithmic else float(number)
            for spec, number in zip(self.model.searched, point, strict=True)
        }
        level, share = at["coulomb_n"], at.get("pressure_slope_n_pa", 0.0)
        coulomb = level * (1.0 - share)
        at["coulomb_n"] = coulomb
        at["pressure_slope_n_pa"] = level * share / self.reference_pressure_pa if share > 0.0 else 0.0
        if "static_n" in at:
            at["static_n"] = coulomb * (1.0 + max(at["static_n"], 0.0))
        if any(spec.name == "bristle_damping_n_s_m" for spec in self.model.specs):
            damping = bristle_damping(
                self.damping_ratio, at["bristle_stiffness_n_m"], self.mass_kg, at["viscous_n_s_m"]
            )
            at["bristle_damping_n_s_m"] = damping
            at["damping_velocity_m_s"] = damping_velocity(
                at["stribeck_velocity_m_s"], coulomb * min(1.0, at["retract_ratio"]), damping
            )
        return np.array([at[spec.name] for spec in self.model.specs])

    def parameters(self, point: Array) -> ModelParameters:
        """Convert a point of the search to the model's parameters."""
        return self.model.parameters(self.values(point))

    def point(self, parameters: ModelParameters) -> Array:
        """Convert parameters to a point of the search, clipped to the bounds; bristle damping is ignored."""
        coulomb = parameters.value("coulomb_n")
        owed_to_pressure = parameters.value("pressure_slope_n_pa") * self.reference_pressure_pa
        level = coulomb + owed_to_pressure
        numbers = []
        for spec in self.model.searched:
            if spec.relative_to == "curve":
                number = math.log(level)
            elif spec.relative_to == "coulomb_n":
                number = parameters.value(spec.name) / coulomb - 1.0
            elif spec.relative_to == "pressure":
                number = owed_to_pressure / level
            else:
                value = parameters.value(spec.name)
                number = math.log(max(value, spec.lower)) if spec.logarithmic else value
            numbers.append(number)
        inside = 1e-6 * (self.upper - self.lower)
        return np.clip(np.array(numbers), self.lower + inside, self.upper - inside)

    def start(self, curve: StribeckCurve, stiffness_n_m: float) -> Array:
        """Convert a steady curve and a stiffness to a point, with a first share of friction due to pressure."""
        return self.point(self.model.first_guess(curve, stiffness_n_m, self.reference_pressure_pa))


def _bounds(spec: ParameterSpec, level: float) -> tuple[float, float]:
    if spec.relative_to == "curve":
        return level + math.log(spec.lower), level + math.log(spec.upper)
    return (math.log(spec.lower), math.log(spec.upper)) if spec.logarithmic else (spec.lower, spec.upper)


def search_globally(
    motions: Motions,
    coordinates: Coordinates,
    start: Array,
    seed: int,
    population: int,
    generations: int,
    each_generation: Callable[[], object],
) -> tuple[Array, list[float]]:
    """Run differential evolution; return its best point and the least mean absolute error after each generation [N].

    ``start`` is one member of the first population, which has ``population`` members per coordinate.

    Source: Storn and Price 1997.
    """
    history, best = list[float](), [math.inf]

    def cost(point: Array) -> float:
        error = motions.error_of(coordinates.values(point))
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
    """Run adaptive Nelder-Mead from ``start``; return its best point.

    The first simplex spans a twentieth of the bounds in each coordinate; SciPy's own spans a twentieth of the value,
    which is meaningless for a logarithm.

    Source: Gao and Han 2012.
    """
    steps = 0.05 * (coordinates.upper - coordinates.lower)
    inward = np.where(start + steps > coordinates.upper, -steps, steps)

    def cost(point: Array) -> float:
        return motions.error_of(coordinates.values(point))

    first: Any = start
    options: Any = {"adaptive": True, "maxfev": evaluations, "maxiter": evaluations, "xatol": 1e-4, "fatol": 1e-5}
    options["initial_simplex"] = np.vstack([start, start + np.diag(inward)])
    result = minimize(
        cost, first, method="Nelder-Mead", bounds=Bounds(coordinates.lower, coordinates.upper), options=options
    )
    return np.asarray(result.x)

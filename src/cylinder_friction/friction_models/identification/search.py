"""The joint search over all parameters of a friction model: coordinates, differential evolution, Gauss-Newton."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, differential_evolution, lsq_linear

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.identification.presliding import bristle_damping, damping_velocity
from cylinder_friction.friction_models.identification.simulation import Motions
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import ModelParameters, ParameterSpec
from cylinder_friction.friction_models.stribeck import StribeckCurve

START_MARGIN = 0.05
"""Least distance of a start to the bounds, as a share of the bounds' distance. At a bound, other coordinates may have
no effect: without a Stribeck effect, its velocity has none."""
ALIKE_SPREAD = 0.05
"""Standard deviation of the population's errors, as a share of their mean, at which differential evolution ends. All
members are then in one valley, whose lowest point local searches find faster."""
SLOPE_STEP = 1e-4
"""Step of each coordinate for the slopes of friction, as a share of its bounds' distance."""
LEAST_DIFFERENCE = 0.03
"""Least difference that weights a row, as a share of the mean. Near zero, a weight would grow without limit."""
DAMPINGS = (1e-3, 0.1, 10.0, 1000.0)
"""Dampings of a step, tried in this order until the error falls."""
CONVERGED = 1e-6
"""Reduction of the error by one step at which the local search has converged, as a share of the error."""


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
        return self.inside(np.array(numbers))

    def inside(self, point: Array, share: float = 1e-6) -> Array:
        """Clip a point to the bounds, less a margin of this share of their distance; rounding cannot cross it."""
        margin = share * (self.upper - self.lower)
        return np.clip(point, self.lower + margin, self.upper - margin)

    def start(self, curve: StribeckCurve, stiffness_n_m: float) -> Array:
        """Convert a steady curve and a stiffness to a point, with a first share of friction due to pressure."""
        return self.inside(
            self.point(self.model.first_guess(curve, stiffness_n_m, self.reference_pressure_pa)), START_MARGIN
        )


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
        tol=ALIKE_SPREAD,
        callback=note,
    )
    return np.asarray(result.x), history


def search_locally(motions: Motions, coordinates: Coordinates, start: Array, evaluations: int) -> Array:
    """Run Gauss-Newton steps from ``start`` for the least mean absolute error; return the best point.

    A square over an absolute difference is the absolute difference. So each step solves a problem of least squares,
    with each row weighted by the inverse of its present difference. The search ends after about this number of
    simulations, or when a step reduces the error by less than ``CONVERGED``.

    Source: Schlossmacher 1973 for the weights; Levenberg 1944 and Marquardt 1963 for the damping.
    """
    span = coordinates.upper - coordinates.lower

    def simulated(point: Array) -> Array:
        return motions.simulated(coordinates.values(point))

    point, friction_n = start, simulated(start)
    error_n = motions.difference_of(friction_n)
    for _ in range(evaluations // (len(start) + 1)):
        steps = np.where(point + SLOPE_STEP * span > coordinates.upper, -SLOPE_STEP, SLOPE_STEP)
        ends = point + np.diag(steps * span)
        slopes = np.array([(simulated(end) - friction_n) / step for end, step in zip(ends, steps, strict=True)])
        off_n = np.where(motions.usable, motions.friction_n - friction_n, 0.0)
        weighted = slopes * (motions.usable / np.maximum(np.abs(off_n), LEAST_DIFFERENCE * error_n))
        curvature, downhill = weighted @ slopes.T, weighted @ off_n
        room = (coordinates.lower - point) / span, (coordinates.upper - point) / span
        for damping in DAMPINGS:
            candidate = coordinates.inside(point + span * _damped_step(curvature, downhill, damping, room))
            candidate_n = simulated(candidate)
            candidate_error_n = motions.difference_of(candidate_n)
            if candidate_error_n < error_n:
                break
        else:
            return point
        converged = candidate_error_n > (1.0 - CONVERGED) * error_n
        point, friction_n, error_n = candidate, candidate_n, candidate_error_n
        if converged:
            return point
    return point


def _damped_step(curvature: Array, downhill: Array, damping: float, room: tuple[Array, Array]) -> Array:
    """Solve for the step, within ``room``, whose ``curvature`` is raised by a share of its own diagonal."""
    diagonal = np.diag(curvature)
    raised = curvature + np.diag(damping * diagonal + SLOPE_STEP**2 * diagonal.max())
    factor = np.linalg.cholesky(raised)
    return np.asarray(lsq_linear(factor.T, np.linalg.solve(factor, downhill), room, method="bvls").x)

"""The joint search over all parameters of a friction model: differential evolution, then Nelder-Mead."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from cylinder_friction.friction_models.identification.coordinates import Coordinates
    from cylinder_friction.friction_models.identification.motion import Motions

    Array = NDArray[np.float64]


def search_globally(
    motions: Motions,
    coordinates: Coordinates,
    start: Array,
    seed: int,
    population: int,
    generations: int,
    each_generation: Callable[[], object],
) -> tuple[Array, list[float]]:
    """Return the best point of differential evolution, and the least mean absolute error after each generation [N].

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
    """Return the best point of adaptive Nelder-Mead from ``start``.

    The first simplex spans a twentieth of the bounds a coordinate, because SciPy's own spans a twentieth of
    the value, which means nothing for a logarithm.

    Source: Gao and Han 2012.
    """
    steps = 0.05 * (coordinates.upper - coordinates.lower)
    inward = np.where(start + steps > coordinates.upper, -steps, steps)

    def cost(point: Array) -> float:
        return motions.error_of(coordinates.values(point))

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

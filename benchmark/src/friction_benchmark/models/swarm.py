"""Multi-agent particle swarm on a lattice, followed by the Nelder-Mead simplex: optimisation without a gradient.

Swarm: agents of a multi-agent genetic algorithm (Zhong et al. 2004) joined to a particle swarm (Zhao, Guo and Cao
2005, "A multiagent-based particle swarm optimization approach for optimal reactive power dispatch"). Inertia falls as
in Shi and Eberhart 1998. Simplex: SciPy's Nelder-Mead with the coefficients of Gao and Han 2012, which adapt to the
dimension. Pan et al. 2017 join the two to identify friction.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from cylinder_friction.arrays import Array

SIDE = 6  # Agents along one side of the lattice, which wraps around
INERTIA = (0.9, 0.4)  # At the start and at the end
OWN, COMMON = 2.0, 2.0  # Attraction to an agent's own best position and to the best of all, c1 and c2
FASTEST = 0.05  # Largest step in a coordinate, as a share of the box's side
SELF_LEARNING_RADIUS, SELF_LEARNING_AGENTS = 0.02, 9
"""The small lattice around the best agent, as a share of the box's side, and its positions in each generation."""
SIMPLEX_SHARE = 0.3  # Share of all evaluations that is left to the simplex


class _Counted:
    """A cost function that counts its calls, keeps the best position, and ends the swarm when its budget is spent."""

    def __init__(self, cost: Callable[[Array], float], budget: int) -> None:
        self.cost, self.budget, self.spent = cost, budget, 0
        self.best, self.position = np.inf, np.empty(0)

    def __call__(self, position: Array) -> float:
        if self.spent >= self.budget:
            raise _SpentError
        value = self.cost(position)
        if not np.isfinite(value):
            value = np.finfo(np.float64).max
        if value < self.best:
            self.best, self.position = value, position.copy()
        self.spent += 1
        return value


class _SpentError(Exception):
    """The swarm's budget is spent."""


def swarm_then_simplex(cost: Callable[[Array], float], lower: Array, upper: Array, budget: int, seed: int) -> Array:
    """Return the best position, shape ``(d,)``, that the swarm, and then the simplex started from it, have found.

    The swarm stays in the box between the corners ``lower`` and ``upper``; the simplex may leave it. All evaluations of
    ``cost`` in the budget are spent; they are at least ``SIDE**2``, one per agent of the lattice.
    """
    counted = _Counted(cost, max(SIDE**2, round((1.0 - SIMPLEX_SHARE) * budget)))
    try:
        _swarm(counted, lower, upper, np.random.default_rng(seed))
    except _SpentError:
        counted.budget = budget
    size = 0.05 * (upper - lower)
    while counted.spent < budget:  # a simplex that has shrunk to nothing starts anew from the best position
        minimize(
            counted,
            counted.position,
            method="Nelder-Mead",
            options={
                "adaptive": len(size) > 1,  # the adaptive coefficients degenerate in one dimension
                "initial_simplex": np.vstack([counted.position, counted.position + np.diag(size)]),
                "maxfev": budget - counted.spent,
                "maxiter": budget,
                "xatol": 1e-9 * float(size.max()),
                "fatol": np.inf,
            },
        )
    return counted.position


def _swarm(cost: _Counted, lower: Array, upper: Array, generator: np.random.Generator) -> None:
    """Search until the budget is spent."""
    count, span = SIDE**2, upper - lower
    positions = lower + span * generator.random((count, len(lower)))
    steps = FASTEST * span * generator.uniform(-1.0, 1.0, positions.shape)
    costs = np.array([cost(position) for position in positions])
    own_positions, own_costs = positions.copy(), costs.copy()
    neighbours = _neighbours()
    while True:
        progress = cost.spent / cost.budget
        inertia = INERTIA[0] + (INERTIA[1] - INERTIA[0]) * progress
        rivals = neighbours[np.arange(count), np.argmin(costs[neighbours], axis=1)]
        winners = positions[rivals]
        for agent in np.flatnonzero(costs[rivals] < costs).tolist():
            away = generator.uniform(-1.0, 1.0, len(lower)) * (winners[agent] - positions[agent])
            positions[agent] = np.clip(winners[agent] + away, lower, upper)
        pulls = OWN * generator.random(positions.shape) * (own_positions - positions)
        pulls += COMMON * generator.random(positions.shape) * (cost.position - positions)
        steps = np.clip(inertia * steps + pulls, -FASTEST * span, FASTEST * span)
        positions = np.clip(positions + steps, lower, upper)
        for agent in range(count):
            costs[agent] = cost(positions[agent])
        better = costs < own_costs
        own_positions[better], own_costs[better] = positions[better], costs[better]
        best = int(np.argmin(costs))
        radius = SELF_LEARNING_RADIUS * (1.0 - cost.spent / cost.budget) * span
        for _ in range(SELF_LEARNING_AGENTS):
            tried = cost.position + radius * generator.uniform(-1.0, 1.0, len(span))
            value = cost(tried)
            if value < costs[best]:
                positions[best], costs[best] = tried, value


def _neighbours() -> NDArray[np.int64]:
    """Return the four neighbours of each agent (von Neumann's), shape ``(SIDE², 4)``; the lattice wraps around."""
    lattice = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    rolled = [np.roll(lattice, shift, axis).ravel() for shift, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1))]
    return np.stack(rolled, axis=1)

"""Multi-agent particle swarm on a lattice, then Nelder and Mead's simplex: search without a gradient.

Swarm: agents of a multi-agent genetic algorithm (Zhong et al. 2004) joined to a particle swarm (Zhao, Guo and Cao
2005, "A multiagent-based particle swarm optimization approach for optimal reactive power dispatch"). Inertia falls as
in Shi and Eberhart 1998. Simplex: Nelder and Mead 1965 with the coefficients of Gao and Han 2012, which adapt to the
dimension. As Pan et al. 2017 join them for friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Cost = Callable[[Array], float]


@dataclass(frozen=True)
class SwarmPlan:
    """How the swarm searches.

    Attributes:
        side: Agents on one side of the lattice, whose edges meet.
        inertia: At the start and at the end.
        own, common: Pull towards an agent's own best place and towards the best of all, c1 and c2.
        fastest: Largest step in a coordinate, as a share of the box's side.
        self_learning_radius: Of the small lattice around the best agent, as a share of the box's side.
        self_learning_agents: On that lattice, a generation.
        simplex_share: Of all evaluations, for Nelder and Mead.
    """

    side: int = 6
    inertia: tuple[float, float] = (0.9, 0.4)
    own: float = 2.0
    common: float = 2.0
    fastest: float = 0.05
    self_learning_radius: float = 0.02
    self_learning_agents: int = 9
    simplex_share: float = 0.3

    def __post_init__(self) -> None:
        if self.side < 2 or not 0.0 <= self.simplex_share < 1.0:
            raise ValueError(f"expected a side of at least 2 and a simplex_share in [0, 1), but got {self}")


TRAIL = 20
"""Parts of the budget after each of which the best place so far is noted."""


@dataclass
class Found:
    """What a search has found.

    Attributes:
        place: The best.
        cost: There.
        curve: The best cost after each evaluation.
        trail: The best place after each twentieth of the budget, for early stopping on other data.
    """

    place: Array
    cost: float
    curve: list[float]
    trail: list[Array]

    @property
    def evaluations(self) -> int:
        return len(self.curve)


class _Counted:
    """A cost function that counts, remembers the best, and ends the search when the budget is spent."""

    def __init__(self, cost: Cost, budget: int, whole: int) -> None:
        self.cost, self.budget, self.whole = cost, budget, whole
        self.curve: list[float] = []
        self.trail: list[Array] = []
        self.best, self.place = np.inf, np.empty(0)

    @property
    def spent(self) -> int:
        return len(self.curve)

    def __call__(self, place: Array) -> float:
        if self.spent >= self.budget:
            raise _SpentError
        value = self.cost(place)
        if not np.isfinite(value):
            value = np.finfo(np.float64).max
        if value < self.best or not self.curve:
            self.best, self.place = value, place.copy()
        self.curve.append(self.best)
        if self.spent * TRAIL >= (len(self.trail) + 1) * self.whole:
            self.trail.append(self.place.copy())
        return value

    def found(self) -> Found:
        return Found(self.place, self.best, self.curve, self.trail)


class _SpentError(Exception):
    """The budget is spent."""


def swarm_then_simplex(
    cost: Cost, lower: Array, upper: Array, budget: int, seed: int, plan: SwarmPlan | None = None
) -> Found:
    """Return the best place in a box that the swarm, and then the simplex from the swarm's best, have found.

    Args:
        cost: Of a place, shape ``(d,)``.
        lower, upper: Corners of the box the swarm stays in, shape ``(d,)``; the simplex may leave it.
        budget: Evaluations of ``cost``, all of which are spent; at least one a agent of the lattice.
        seed: Of everything random.
        plan: How to search.

    Raises:
        ValueError: The budget does not even place the agents.
    """
    plan = plan or SwarmPlan()
    if budget < plan.side**2:
        raise ValueError(f"expected a budget of at least {plan.side**2} evaluations, one an agent, but got {budget}")
    generator = np.random.default_rng(seed)
    for_swarm = max(plan.side**2, round((1.0 - plan.simplex_share) * budget))
    counted = _Counted(cost, for_swarm, budget)
    try:
        _swarm(counted, lower, upper, plan, generator)
    except _SpentError:
        counted.budget = budget
    try:
        while True:
            _simplex(counted, counted.place, 0.05 * (upper - lower))
    except _SpentError:
        return counted.found()


def _swarm(cost: _Counted, lower: Array, upper: Array, plan: SwarmPlan, generator: np.random.Generator) -> None:
    """Search until the budget is spent."""
    count, span = plan.side**2, upper - lower
    places = lower + span * generator.random((count, len(lower)))
    steps = plan.fastest * span * generator.uniform(-1.0, 1.0, places.shape)
    costs = np.array([cost(place) for place in places])
    own_places, own_costs = places.copy(), costs.copy()
    neighbours = _neighbours(plan.side)
    while True:
        progress = cost.spent / cost.budget
        inertia = plan.inertia[0] + (plan.inertia[1] - plan.inertia[0]) * progress
        rivals = neighbours[np.arange(count), np.argmin(costs[neighbours], axis=1)]
        losers = np.flatnonzero(costs[rivals] < costs)
        winners = places[rivals]
        for agent in losers.tolist():
            away = generator.uniform(-1.0, 1.0, len(lower)) * (winners[agent] - places[agent])
            places[agent] = np.clip(winners[agent] + away, lower, upper)
        pulls = plan.own * generator.random(places.shape) * (own_places - places)
        pulls += plan.common * generator.random(places.shape) * (cost.place - places)
        steps = np.clip(inertia * steps + pulls, -plan.fastest * span, plan.fastest * span)
        places = np.clip(places + steps, lower, upper)
        for agent in range(count):
            costs[agent] = cost(places[agent])
        better = costs < own_costs
        own_places[better], own_costs[better] = places[better], costs[better]
        _learn_alone(cost, places, costs, span, plan, generator)


def _learn_alone(
    cost: _Counted, places: Array, costs: Array, span: Array, plan: SwarmPlan, generator: np.random.Generator
) -> None:
    """Try places close around the best agent, on a lattice that shrinks with the search, and moves it there."""
    best = int(np.argmin(costs))
    radius = plan.self_learning_radius * (1.0 - cost.spent / cost.budget) * span
    for _ in range(plan.self_learning_agents):
        tried = cost.place + radius * generator.uniform(-1.0, 1.0, len(span))
        value = cost(tried)
        if value < costs[best]:
            places[best], costs[best] = tried, value


def _neighbours(side: int) -> NDArray[np.int64]:
    """Return the four neighbours of each agent (von Neumann's), shape ``(side², 4)``; edges meet."""
    row, column = np.divmod(np.arange(side * side), side)
    around = [
        ((row - 1) % side, column),
        ((row + 1) % side, column),
        (row, (column - 1) % side),
        (row, (column + 1) % side),
    ]
    return np.stack([r * side + c for r, c in around], axis=1)


def _simplex(cost: _Counted, start: Array, size: Array) -> None:
    """Nelder and Mead's search from ``start`` until the simplex has shrunk to nothing or the budget is spent."""
    n = len(start)
    expand, contract, shrink = 1.0 + 2.0 / n, 0.75 - 0.5 / n, 1.0 - 1.0 / n
    if n == 1:
        expand, contract, shrink = 2.0, 0.5, 0.5
    corners = np.vstack([start, start + np.diag(size)])
    values = np.array([cost(corner) for corner in corners])
    while True:
        order = np.argsort(values, kind="stable")
        corners, values = corners[order], values[order]
        if np.abs(corners[1:] - corners[0]).max() <= 1e-9 * np.abs(size).max():
            return
        centre = corners[:-1].mean(axis=0)
        direction = centre - corners[-1]
        reflected, value = centre + direction, cost(centre + direction)
        if value < values[0]:
            further = centre + expand * direction
            further_value = cost(further)
            corners[-1], values[-1] = (further, further_value) if further_value < value else (reflected, value)
        elif value < values[-2]:
            corners[-1], values[-1] = reflected, value
        else:
            outside = value < values[-1]
            inner = centre + (contract if outside else -contract) * direction
            inner_value = cost(inner)
            if inner_value < min(value, values[-1]):
                corners[-1], values[-1] = inner, inner_value
            else:
                corners[1:] = corners[0] + shrink * (corners[1:] - corners[0])
                values[1:] = [cost(corner) for corner in corners[1:]]

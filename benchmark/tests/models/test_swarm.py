"""The swarm and the simplex on functions whose minimum is known, and the budget they keep to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friction_benchmark.models.swarm import SwarmPlan, _neighbours, swarm_then_simplex


def rosenbrock(x: np.ndarray) -> float:
    return float(np.sum(100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2))


def rastrigin(x: np.ndarray) -> float:
    return float(np.sum(x**2 - 10.0 * np.cos(2.0 * np.pi * x) + 10.0))


def box(size: float, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full(dimension, -size), np.full(dimension, size)


def test_the_simplex_finishes_what_the_swarm_began_in_a_curved_valley() -> None:
    found = swarm_then_simplex(rosenbrock, *box(3.0, 6), budget=6000, seed=0)
    swarm = swarm_then_simplex(rosenbrock, *box(3.0, 6), 4200, 0, SwarmPlan(simplex_share=0.0))
    np.testing.assert_allclose(found.position, np.ones(6), atol=1e-4)
    assert found.cost < 1e-3 * swarm.cost


def test_among_many_valleys_it_finds_far_better_ones_than_chance() -> None:
    lower, upper = box(5.12, 8)
    chance = min(rastrigin(x) for x in np.random.default_rng(1).uniform(lower, upper, (6000, 8)))
    assert swarm_then_simplex(rastrigin, lower, upper, budget=6000, seed=1).cost < 0.4 * chance


@settings(max_examples=10, deadline=None)
@given(budget=st.integers(min_value=36, max_value=700), dimension=st.integers(min_value=1, max_value=8))
def test_the_budget_is_spent_to_the_last_evaluation(budget: int, dimension: int) -> None:
    calls = []

    def counted(x: np.ndarray) -> float:
        calls.append(x.copy())
        return float(np.abs(x).sum())

    found = swarm_then_simplex(counted, *box(2.0, dimension), budget=budget, seed=3)
    assert len(calls) == budget == found.evaluations
    assert found.cost == min(float(np.abs(x).sum()) for x in calls) == float(np.abs(found.position).sum())


def test_the_swarm_stays_in_its_box() -> None:
    seen = []

    def downhill(x: np.ndarray) -> float:
        seen.append(x.copy())
        return float(x.sum())

    plan = SwarmPlan(simplex_share=0.0, self_learning_agents=0)
    found = swarm_then_simplex(downhill, *box(1.0, 3), budget=800, seed=0, plan=plan)
    assert np.abs(seen).max() <= 1.0
    np.testing.assert_array_equal(found.position, -np.ones(3))


def test_a_cost_that_is_not_a_number_is_the_worst() -> None:
    found = swarm_then_simplex(lambda x: float("nan") if x[0] < 0.0 else float(x[0]), *box(1.0, 2), budget=500, seed=0)
    assert 0.0 <= found.cost < 1e-3


def test_the_same_seed_finds_the_same_place_and_another_another() -> None:
    one, same, other = (swarm_then_simplex(rosenbrock, *box(3.0, 4), budget=400, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.position, same.position)
    assert not np.array_equal(one.position, other.position)


def test_neighbours_on_the_lattice_whose_edges_meet() -> None:
    neighbours = _neighbours(4)
    assert sorted(neighbours[0]) == [1, 3, 4, 12]
    assert sorted(neighbours[10]) == [6, 9, 11, 14]


def test_a_budget_that_does_not_place_the_agents_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a budget of at least 36 evaluations, one per agent, but got 35"):
        swarm_then_simplex(rosenbrock, *box(1.0, 2), budget=35, seed=0)

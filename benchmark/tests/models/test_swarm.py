"""The swarm and the simplex on functions whose minimum is known, and the budget they keep to."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from friction_benchmark.models.swarm import swarm_then_simplex


def rosenbrock(x: np.ndarray) -> float:
    return float(np.sum(100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2))


def rastrigin(x: np.ndarray) -> float:
    return float(np.sum(x**2 - 10.0 * np.cos(2.0 * np.pi * x) + 10.0))


def box(size: float, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full(dimension, -size), np.full(dimension, size)


def test_the_simplex_finishes_what_the_swarm_began_in_a_curved_valley() -> None:
    np.testing.assert_allclose(swarm_then_simplex(rosenbrock, *box(3.0, 6), budget=6000, seed=0), np.ones(6), atol=1e-4)


def test_among_many_valleys_it_finds_far_better_ones_than_chance() -> None:
    lower, upper = box(5.12, 8)
    chance = min(rastrigin(x) for x in np.random.default_rng(1).uniform(lower, upper, (6000, 8)))
    assert rastrigin(swarm_then_simplex(rastrigin, lower, upper, budget=6000, seed=1)) < 0.4 * chance


@settings(max_examples=10, deadline=None)
@given(budget=st.integers(min_value=36, max_value=700), dimension=st.integers(min_value=1, max_value=8))
def test_the_budget_is_spent_to_the_last_evaluation_and_the_best_is_kept(budget: int, dimension: int) -> None:
    costs = []

    def counted(x: np.ndarray) -> float:
        costs.append(float(np.abs(x).sum()))
        return costs[-1]

    found = swarm_then_simplex(counted, *box(2.0, dimension), budget=budget, seed=3)
    assert len(costs) == budget
    assert float(np.abs(found).sum()) == min(costs)


def test_a_cost_that_is_not_a_number_is_the_worst() -> None:
    found = swarm_then_simplex(lambda x: float("nan") if x[0] < 0.0 else float(x[0]), *box(1.0, 2), budget=500, seed=0)
    assert 0.0 <= found[0] < 1e-3


def test_the_same_seed_finds_the_same_place_and_another_another() -> None:
    one, same, other = (swarm_then_simplex(rosenbrock, *box(3.0, 4), budget=400, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.labelling.robust import bootstrap_coefficients, robust_fit

GENERATOR = np.random.default_rng(5)
DESIGN = np.column_stack([np.ones(400), np.linspace(-1.0, 1.0, 400)])
CLUSTERS = np.arange(400) // 10


def test_columns_that_say_the_same_share_their_coefficient() -> None:
    fit = robust_fit(np.column_stack([DESIGN, DESIGN[:, 1]]), DESIGN @ np.array([2.0, 3.0]))
    np.testing.assert_allclose(fit.coefficients, [2.0, 1.5, 1.5], atol=1e-9)


def test_blocks_are_drawn_within_their_group() -> None:
    """A draw without one of the groups could not tell its level."""
    group = np.arange(400) // 200
    design = np.column_stack([group == 0, group == 1]).astype(np.float64)
    target = design @ np.array([1.0, 5.0])
    blocks = np.arange(400) // 100
    drawn = bootstrap_coefficients(design, robust_fit(design, target), target, blocks, np.array([0, 0, 1, 1]), 50, 1)
    np.testing.assert_allclose(drawn, np.tile([1.0, 5.0], (50, 1)), atol=1e-9)
    assert drawn.shape == (50, 2)


def test_one_seed_gives_equal_bits() -> None:
    target = DESIGN @ np.array([2.0, 3.0]) + GENERATOR.normal(0.0, 0.1, 400)
    fit = robust_fit(DESIGN, target)
    one, two, other = (
        bootstrap_coefficients(DESIGN, fit, target, CLUSTERS, np.zeros(40), 20, seed) for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, other)
    assert one.mean(axis=0) == pytest.approx([2.0, 3.0], abs=0.1)

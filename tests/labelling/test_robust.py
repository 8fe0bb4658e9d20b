from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.labelling.robust import bootstrap_coefficients, clustered_half_widths, robust_fit

GENERATOR = np.random.default_rng(5)
DESIGN = np.column_stack([np.ones(400), np.linspace(-1.0, 1.0, 400)])
CLUSTERS = np.arange(400) // 10


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_exact_lines_are_found(constant: float, slope: float) -> None:
    fit = robust_fit(DESIGN, DESIGN @ np.array([constant, slope]))
    np.testing.assert_allclose(fit.coefficients, [constant, slope], atol=1e-7)


def test_outliers_hardly_move_the_line() -> None:
    target = DESIGN @ np.array([2.0, 3.0]) + GENERATOR.normal(0.0, 0.1, 400)
    target[::20] += 50.0
    robust = robust_fit(DESIGN, target)
    np.testing.assert_allclose(robust.coefficients, [2.0, 3.0], atol=0.05)
    assert robust.weights[::20].max() < 0.01


def test_columns_that_say_the_same_share_their_coefficient() -> None:
    fit = robust_fit(np.column_stack([DESIGN, DESIGN[:, 1]]), DESIGN @ np.array([2.0, 3.0]))
    np.testing.assert_allclose(fit.coefficients, [2.0, 1.5, 1.5], atol=1e-9)


def test_alike_neighbours_widen_intervals_and_bootstrap_alike() -> None:
    noise = np.repeat(GENERATOR.normal(0.0, 0.1, 40), 10)
    target = DESIGN @ np.array([2.0, 3.0]) + noise
    fit = robust_fit(DESIGN, target)
    alike = clustered_half_widths(DESIGN, fit, CLUSTERS, 0.95)
    single = clustered_half_widths(DESIGN, fit, np.arange(400), 0.95)
    assert (alike > 2.0 * single).all()
    drawn = bootstrap_coefficients(DESIGN, fit, target, CLUSTERS, np.zeros(40), 400, 0)
    np.testing.assert_allclose(2.02 * drawn.std(axis=0), alike, rtol=0.25)


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

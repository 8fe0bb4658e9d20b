"""The block bootstrap: sums by hand, coverage, pairing."""

from __future__ import annotations

import numpy as np
import pytest

from friction_benchmark.bootstrap import block_sums, bootstrap_percent, interval


def test_blocks_by_hand_stay_within_a_recording_and_skip_rows_that_do_not_count():
    references = [np.array([10.0, 10, 20, 20, 30]), np.array([5.0, 5])]
    estimates = [np.array([11.0, 12, 20, 0, 33]), np.array([5.0, 6])]
    usable = [np.array([True, True, True, False, True]), np.array([True, True])]
    sums = block_sums(references, estimates, usable, 2)
    assert sums.abs_error_n.tolist() == [3.0, 0.0, 3.0, 1.0]
    assert sums.abs_friction_n.tolist() == [20.0, 20.0, 30.0, 10.0]


def test_an_interval_holds_the_figure_itself_and_seeds_repeat():
    generator = np.random.default_rng(0)
    reference = generator.normal(300.0, 10.0, 20_000)
    estimate = reference + generator.normal(0.0, 10.0, 20_000)
    sums = block_sums([reference], [estimate], [np.ones(20_000, dtype=bool)], 200)
    draws = bootstrap_percent(sums, 500, seed=1)
    low, high = interval(draws)
    percent = 100 * np.abs(estimate - reference).mean() / np.abs(reference).mean()
    assert low < percent < high
    assert (draws == bootstrap_percent(sums, 500, seed=1)).all()
    assert (draws != bootstrap_percent(sums, 500, seed=2)).any()


def test_draws_of_two_estimators_are_paired():
    generator = np.random.default_rng(1)
    reference = generator.normal(300.0, 10.0, 8000)
    hard = np.repeat(generator.uniform(1.0, 30.0, 40), 200)  # some blocks are harder than others, for both alike
    mask = [np.ones(8000, dtype=bool)]
    one = bootstrap_percent(block_sums([reference], [reference + hard], mask, 200), 400, 0)
    other = bootstrap_percent(block_sums([reference], [reference + hard + 1.0], mask, 200), 400, 0)
    assert np.std(other - one) < 0.05 * np.std(one)
    assert np.mean(other - one) == pytest.approx(100.0 / 300.0, rel=0.02)

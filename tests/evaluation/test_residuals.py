"""Residual figures: of signals whose distribution and memory are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from statsmodels.stats.diagnostic import acorr_ljungbox

from cylinder_friction.evaluation.residuals import autocorrelation, dependence, residual_figures


def everywhere(values: np.ndarray) -> np.ndarray:
    return np.ones(len(values), dtype=bool)


def test_effective_rows_of_an_autoregressive_residual_follow_theory():
    noise = np.random.default_rng(1).normal(size=200_000)
    values = lfilter([1.0], [1.0, -0.9], noise)
    found = residual_figures(values, everywhere(values))
    assert found.autocorrelation_1 == pytest.approx(0.9, abs=0.01)
    assert found.effective_rows == pytest.approx(200_000 * (1 - 0.9) / (1 + 0.9), rel=0.15)
    assert found.ljung_box_p < 1e-6


def test_skewness_is_positive_where_the_long_tail_is_at_underestimates():
    values = np.random.default_rng(2).exponential(size=5000)
    assert residual_figures(values, everywhere(values)).skewness > 1.5


def test_ljung_box_is_that_of_statsmodels_on_the_longest_run():
    values = lfilter([1.0], [1.0, -0.1], np.random.default_rng(7).normal(size=1000))
    usable = everywhere(values)
    usable[300] = False
    found = residual_figures(values, usable)
    expected = acorr_ljungbox(values[301:], lags=[10])
    assert found.ljung_box == pytest.approx(expected["lb_stat"].iloc[0], rel=1e-9)
    assert found.ljung_box_p == pytest.approx(expected["lb_pvalue"].iloc[0], rel=1e-6)


def test_a_gap_is_missing_and_not_zero():
    values = lfilter([1.0], [1.0, -0.8], np.random.default_rng(4).normal(size=50_000))
    usable = everywhere(values)
    usable[::7] = False
    disturbed = np.where(usable, values, 1e9)
    expected = autocorrelation(values, everywhere(values), 10)
    assert autocorrelation(disturbed, usable, 10) == pytest.approx(expected, abs=0.03)


def test_residuals_that_never_vary_have_a_median_and_no_shape():
    found = residual_figures(np.zeros(100), np.ones(100, dtype=bool))
    assert found.median_n == 0.0
    assert math.isnan(found.skewness)
    assert math.isnan(found.ljung_box)


def test_dependence_finds_the_input_a_residual_still_follows():
    generator = np.random.default_rng(6)
    velocity, pressure = generator.normal(size=4000), generator.normal(size=4000)
    residual = 2.0 * velocity + 0.1 * generator.normal(size=4000)
    inputs = {"velocity": velocity, "pressure": pressure, "constant": np.ones(4000)}
    found = dependence(residual, np.ones(4000, dtype=bool), inputs)
    assert found["velocity"] > 0.99
    assert abs(found["pressure"]) < 0.06
    assert found["constant"] == 0.0

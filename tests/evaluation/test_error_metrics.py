"""Errors: what must hold for any signal, and hand-computed figures."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.evaluation.metrics import errors, lag_s

SIGNALS = st.lists(st.floats(-1e4, 1e4), min_size=4, max_size=40).filter(lambda values: np.ptp(values) > 1.0)


def all_rows(values: np.ndarray) -> np.ndarray:
    return np.ones(len(values), dtype=bool)


def test_figures_computed_by_hand():
    reference = np.array([100.0, -100.0, 200.0, -200.0])
    estimate = np.array([110.0, -100.0, 190.0, -160.0])  # errors +10, 0, -10, +40
    found = errors(reference, estimate, all_rows(reference))
    assert found.rows == 4
    assert found.mae_n == pytest.approx(15.0)
    assert found.rmse_n == pytest.approx(math.sqrt((100 + 0 + 100 + 1600) / 4))
    assert found.bias_n == pytest.approx(10.0)
    assert found.mean_abs_friction_n == pytest.approx(150.0)
    assert found.percent == pytest.approx(10.0)
    assert found.fit_percent == pytest.approx(100 * (1 - math.sqrt(1800) / math.sqrt(100000)))
    assert found.range_nrmse_percent == pytest.approx(100 * math.sqrt(450) / 400)
    assert found.p95_n == pytest.approx(35.5)  # 85 % of the way from 10 to 40


def test_rows_that_are_not_usable_do_not_count_whatever_stands_there():
    reference = np.array([100.0, math.nan, 100.0])
    estimate = np.array([90.0, 5.0, 110.0])
    found = errors(reference, estimate, np.array([True, False, True]))
    assert (found.rows, found.mae_n, found.bias_n) == (2, 10.0, 0.0)


@given(SIGNALS, st.floats(0.01, 100.0), st.integers(0, 1000))
def test_percentages_do_not_depend_on_the_unit_and_newtons_scale_with_it(values, factor, seed):
    reference = np.array(values)
    estimate = reference + np.random.default_rng(seed).normal(0.0, 10.0, len(reference))
    plain = errors(reference, estimate, all_rows(reference))
    scaled = errors(factor * reference, factor * estimate, all_rows(reference))
    assert scaled.mae_n == pytest.approx(factor * plain.mae_n, rel=1e-9)
    for name in ("percent", "fit_percent", "range_nrmse_percent"):
        assert getattr(scaled, name) == pytest.approx(getattr(plain, name), rel=1e-6, abs=1e-9)


def test_an_undefined_ratio_is_left_out_of_the_dictionary():
    found = errors(np.zeros(3), np.ones(3), np.ones(3, dtype=bool)).to_dict()
    assert "percent" not in found
    assert found["mae_n"] == 1.0


@pytest.mark.parametrize(
    ("reference", "estimate", "usable", "message"),
    [
        (np.zeros(3), np.zeros(2), np.ones(3, dtype=bool), r"one shape, but got \(3,\), \(2,\) and \(3,\)"),
        (np.zeros(3), np.zeros(3), np.zeros(3, dtype=bool), "none of the 3 rows is usable"),
        (np.zeros(3), np.array([0.0, math.nan, 0.0]), np.ones(3, dtype=bool), "estimate is nan at row 1"),
        (np.array([0.0, 0.0, math.inf]), np.zeros(3), np.ones(3, dtype=bool), "reference is inf at row 2"),
    ],
)
def test_what_cannot_be_judged_is_refused(reference, estimate, usable, message):
    with pytest.raises(ValueError, match=message):
        errors(reference, estimate, usable)


@pytest.mark.parametrize("shift", [-7, -1, 0, 3, 20])
def test_a_shift_is_found_as_lag_and_late_is_positive(shift):
    signal = np.convolve(np.random.default_rng(3).normal(size=1200), np.ones(15), mode="same")
    reference, estimate = signal[100:1100], signal[100 - shift : 1100 - shift]
    found = lag_s(reference, 3.0 * estimate + 50.0, np.ones(1000, dtype=bool), 0.005, 0.2)
    assert found == pytest.approx(0.005 * shift, abs=0.001), "whatever gain and offset"


def test_a_lag_of_part_of_a_sample_is_found():
    time_s = 0.005 * np.arange(4000)
    reference = np.sin(2 * np.pi * 1.3 * time_s)
    estimate = np.sin(2 * np.pi * 1.3 * (time_s - 0.0123))
    assert lag_s(reference, estimate, np.ones(4000, dtype=bool), 0.005, 0.1) == pytest.approx(0.0123, abs=1e-4)
    assert math.isnan(lag_s(np.ones(50), np.ones(50), np.ones(50, dtype=bool), 0.005, 0.05)), "nothing varies"


def test_lag_looks_at_usable_rows_alone():
    signal = np.convolve(np.random.default_rng(5).normal(size=900), np.ones(15), mode="same")
    reference, estimate = signal[10:810].copy(), signal[6:806].copy()
    usable = np.ones(800, dtype=bool)
    usable[300:420] = False
    reference[300:420], estimate[300:420] = 1e6, math.nan
    assert lag_s(reference, estimate, usable, 0.005, 0.1) == pytest.approx(0.02, abs=0.001)

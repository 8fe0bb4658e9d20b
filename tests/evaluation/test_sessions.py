"""Intervals from sessions: by hand, coverage, pairing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t as student

from cylinder_friction.evaluation.sessions import half_width_points, session_errors


def test_sums_by_hand_join_the_recordings_of_a_session_and_skip_rows_that_do_not_count():
    references = [np.array([10.0, 10, 20, 99]), np.array([20.0, 20]), np.array([10.0, 30]), np.array([7.0])]
    estimates = [np.array([11.0, 12, 20, 0]), np.array([20.0, 21]), np.array([10.0, 32]), np.array([0.0])]
    usable = [np.array([True, True, True, False]), np.ones(2, bool), np.ones(2, bool), np.zeros(1, bool)]
    found = session_errors(["b", "a", "b", "c"], references, estimates, usable)
    assert found.percent == {"a": pytest.approx(100 * 1 / 40), "b": pytest.approx(100 * 5 / 80)}
    ratio = 6 / 120
    assert found.deviation == pytest.approx([100 * (1 - ratio * 40) / 60, 100 * (5 - ratio * 80) / 60])
    assert found.deviation.sum() == pytest.approx(0.0, abs=1e-12)


def test_two_sessions_alone_have_the_interval_of_students_t():
    half = half_width_points({"1": np.array([-0.5, 0.5])}, ["1"])
    assert half == pytest.approx(student.ppf(0.975, 1) * math.sqrt(0.5) / math.sqrt(2.0))


def test_nothing_is_known_where_no_condition_has_two_sessions():
    assert math.isnan(half_width_points({"1": np.zeros(1), "2": np.zeros(1)}, ["1"]))
    assert half_width_points({"1": np.zeros(1), "2": np.array([-1.0, 1.0])}, ["1"]) > 0.0


@pytest.mark.parametrize("of", [["1"], ["1", "2", "3", "4"]])
def test_two_sessions_in_each_of_four_conditions_hold_what_they_say_where_resampling_them_would_not(of):
    generator = np.random.default_rng(3)
    held, resampled, repeats = 0, 0, 2000
    for _ in range(repeats):
        each = {condition: generator.normal(0.0, 0.8, 2) for condition in "1234"}
        mean = np.mean([each[condition].mean() for condition in of])
        held += abs(mean) <= half_width_points({key: values - values.mean() for key, values in each.items()}, of)
        resampled += min(each["1"]) <= 0.0 <= max(each["1"])
    assert held / repeats == pytest.approx(0.95, abs=0.015)
    assert resampled / repeats == pytest.approx(0.5, abs=0.05)

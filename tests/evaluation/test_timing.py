"""The measured time of a step."""

from __future__ import annotations

import pytest

from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.evaluation.timing import time_steps


@pytest.mark.parametrize("inputs", [("position_m",), ("position_m", "pressure_1_pa", "pressure_2_pa", "velocity_m_s")])
def test_steps_are_timed_one_at_a_time_and_a_slow_estimator_is_cut_short(inputs, labelled_recordings):
    estimator = RidgeEstimator(lags=2, inputs=inputs).fit(labelled_recordings[:1])
    found = time_steps(estimator, labelled_recordings[0], 60)
    assert found.steps == 60
    assert 0.0 < found.p50_s <= found.p99_s <= found.maximum_s
    assert time_steps(estimator, labelled_recordings[0], 1000, maximum_seconds=0.0).steps == 1

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.evaluation.coverage import coverage, coverage_metrics
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.comparison_tables import coverage_table


def wide(hybrid: HybridEstimator, half_width_n: float) -> HybridEstimator:
    """Return the hybrid with bounds as wide everywhere."""
    assert hybrid.bounds is not None
    other = hybrid.without_forest()
    other.bounds = replace(hybrid.bounds, lower_n=(-half_width_n,) * 4, upper_n=(half_width_n,) * 4)
    return other


def test_shares_are_counted_by_condition_and_session(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    estimator = wide(small_hybrid, 10.0)
    recordings, truth_n = [], {}
    for number, recording in enumerate(labelled_recordings[:4]):
        estimate_n = estimator.estimate(recording)
        usable = np.arange(len(recording)) >= 100
        recordings.append(recording.with_columns(friction_n=estimate_n + 9.0, usable=usable))
        if number < 2:
            outside = np.arange(len(recording)) % (2 + number) == 0
            truth_n[recording.name] = estimate_n + np.where(outside, 11.0, -9.0)
    found = {(each.reference, each.condition): each for each in coverage(estimator, recordings, truth_n)}
    assert set(found) == {("label", "1"), ("label", "2"), ("label", "all"), ("truth", "1"), ("truth", "all")}
    assert found["label", "all"].held_percent == 100.0
    assert found["label", "all"].rows == sum(int(each.usable().sum()) for each in recordings)
    truth = found["truth", "1"]
    assert truth.held_percent == pytest.approx(100.0 * (1 / 2 + 2 / 3) / 2, abs=0.1)
    assert truth.worst_session == recordings[0].metadata.session
    assert truth.worst_session_percent == pytest.approx(50.0, abs=0.1)
    assert truth.held_near_events_percent == pytest.approx(truth.held_percent, abs=8.0)
    assert truth.mean_width_n == 20.0
    estimator.bounds = None
    assert coverage(estimator, labelled_recordings, {}) == []
    metrics = coverage_metrics(list(found.values()), "truth")
    assert metrics["held_by_bounds_percent/condition_1"] == truth.held_percent
    assert metrics["held_by_bounds_percent/condition_all"] == found["truth", "all"].held_percent


def test_without_starts_and_stops_there_is_no_share_near_them(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    steady = recording.with_columns(velocity_m_s=np.full(len(recording), 0.02))
    (of_condition, of_all) = coverage(wide(small_hybrid, 10.0), [steady], {})
    assert of_condition.held_near_events_percent is of_all.held_near_events_percent is None
    assert coverage_table([of_all]).rows[0][4] == "–"

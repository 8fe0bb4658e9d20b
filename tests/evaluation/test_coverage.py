from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.evaluation.coverage import by_condition, coverage
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.comparison_tables import coverage_by_rows


def wide(hybrid: HybridEstimator, half_width_n: float) -> HybridEstimator:
    """Return the hybrid with bounds as wide everywhere."""
    assert hybrid.bounds is not None
    other = hybrid.without_forest()
    other.bounds = replace(hybrid.bounds, lower_n=(-half_width_n,) * 4, upper_n=(half_width_n,) * 4)
    return other


def test_shares_are_counted_by_condition_session_and_kind_of_motion(
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
    every = coverage(estimator, recordings, truth_n)
    found = {(each.reference, each.group): each for each in every if each.by == "condition"}
    assert set(found) == {("label", "1"), ("label", "2"), ("label", "all"), ("truth", "1"), ("truth", "all")}
    assert found["label", "all"].held_percent == 100.0
    assert found["label", "all"].rows == sum(int(each.usable().sum()) for each in recordings)
    truth = found["truth", "1"]
    assert truth.held_percent == pytest.approx(100.0 * (1 / 2 + 2 / 3) / 2, abs=0.1)
    assert truth.mean_width_n == 20.0
    assert by_condition(every, "truth") == {"1": truth.held_percent, "all": found["truth", "all"].held_percent}
    sessions = {each.group: each for each in every if (each.reference, each.by) == ("truth", "session")}
    assert sessions[recordings[0].metadata.session].held_percent == pytest.approx(50.0, abs=0.1)
    for by in ("session", "speed", "acceleration", "motion"):
        own = [each for each in every if (each.reference, each.by) == ("truth", by)]
        assert sum(each.rows for each in own) == found["truth", "all"].rows, by
    worst_first = [float(row[3]) for row in coverage_by_rows(every).rows]
    assert worst_first == sorted(worst_first)
    estimator.bounds = None
    assert coverage(estimator, labelled_recordings, {}) == []


def test_classes_of_a_steady_motion_are_not_empty(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    steady = recording.with_columns(velocity_m_s=np.full(len(recording), 0.02))
    found = coverage(wide(small_hybrid, 10.0), [steady], {})
    assert [each.group for each in found if each.by == "speed"] == ["up to 20 mm/s"]
    assert [each.group for each in found if each.by == "motion"] == ["elsewhere"]

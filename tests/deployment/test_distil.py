"""Distillation: the student imitates, is smaller, and its cost is measured."""

from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.deployment.distil import DistilReport, distil
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.recordings.recording import Recording

PLAN = TrainingPlan(epochs=12, patience=12, sequence_length=200, burn_in=20, batch_size=2)


def difference(one: HybridEstimator, other: HybridEstimator, recordings: list[Recording]) -> float:
    return float(np.mean([np.abs(one.estimate(each) - other.estimate(each)).mean() for each in recordings]))


def test_a_student_imitates_the_original(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    train, validation, held_out = labelled_recordings[0::2], labelled_recordings[1:4:2], labelled_recordings[5::2]
    student, report = distil(small_hybrid, 4, train, validation, held_out, PLAN)
    untrained, _ = distil(small_hybrid, 4, train, validation, held_out, TrainingPlan(1, 1, 200, 20, 4))
    assert difference(small_hybrid, student, held_out) < difference(small_hybrid, untrained, held_out)
    assert report.difference_n == pytest.approx(difference(small_hybrid, student, held_out))
    assert report.student_multiply_adds < report.original_multiply_adds
    assert student.bounds is not None
    assert student.bounds.probability == 0.9

    student.save(tmp_path / "student")
    loaded = HybridEstimator.load(tmp_path / "student")
    np.testing.assert_array_equal(loaded.estimate(held_out[0]), student.estimate(held_out[0]))
    again, _ = distil(small_hybrid, 4, train, validation, held_out, PLAN)
    np.testing.assert_array_equal(again.estimate(held_out[0]), student.estimate(held_out[0]))


def test_the_report_states_the_cost() -> None:
    assert DistilReport(5.0, 5.5, 0.85, 11684, 1805).text().splitlines() == [
        "original    5.00 N mean absolute error, 11684 operations per step",
        "student     5.50 N (+10.0%), 1805 operations per step",
        "difference  0.85 N on average",
    ]


def test_what_cannot_be_distilled_is_refused(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    with pytest.raises(ValueError, match="nodes must be at least 1, but got 0"):
        distil(small_hybrid, 0, labelled_recordings, labelled_recordings, labelled_recordings)
    with pytest.raises(ValueError, match="the hybrid to distil is not fitted yet"):
        distil(HybridEstimator(), 4, labelled_recordings, labelled_recordings, labelled_recordings)

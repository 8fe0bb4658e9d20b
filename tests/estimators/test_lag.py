"""With a lag each estimate is of an earlier moment, and stands where it belongs."""

from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.evaluation.coverage import coverage
from cylinder_friction.recordings.recording import Recording

LAG_S, LAG = 0.05, 10
PLAN = TrainingPlan(epochs=2, patience=2, sequence_length=200, burn_in=20, batch_size=4)


@pytest.fixture(scope="module")
def late(cylinder: Cylinder, labelled_recordings: list[Recording]) -> HybridEstimator:
    hybrid = HybridEstimator(
        cylinder, architecture=Architecture(1, 8, 0.0, 3e-3), plan=PLAN, forest_plan=None, lag_s=LAG_S
    )
    return hybrid.fit(labelled_recordings)


def test_an_estimate_stands_at_the_moment_that_it_is_of(
    late: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    estimate_n, stream = late.estimate(recording), late.stream()
    stepped = np.array([stream.step(*sample) for sample in recording.samples()])
    assert estimate_n[:-LAG].tolist() == stepped[LAG:].tolist()
    assert set(estimate_n[-LAG:]) == {stepped[-1]}


def test_bounds_are_those_of_the_late_estimate(late: HybridEstimator, labelled_recordings: list[Recording]) -> None:
    shares = coverage(late, labelled_recordings, {})
    found = {each.group: each for each in shares if each.by == "condition"}
    assert 80.0 < found["all"].held_percent < 97.0


def test_the_lag_is_saved_and_stated(late: HybridEstimator, tmp_path: Path) -> None:
    late.save(tmp_path)
    loaded = load_estimator(tmp_path)
    assert (loaded.lag_s, loaded.lag_samples, loaded.step_model().lag_s) == (LAG_S, LAG, pytest.approx(LAG_S))
    assert late.without_forest().lag_samples == LAG


@pytest.mark.parametrize("lag_s", [-0.01, float("nan"), float("inf")])
def test_an_impossible_lag_is_refused(cylinder: Cylinder, lag_s: float) -> None:
    with pytest.raises(ValueError, match="lag_s must be zero or a positive number of seconds, but got"):
        HybridEstimator(cylinder, lag_s=lag_s)

"""A warm start begins with what was learned in the session's recording before."""

from dataclasses import replace

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.evaluation.starts import starts
from cylinder_friction.labelling.offset_tracker import fit_offset_tracker
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording


@pytest.fixture(scope="module")
def ridge(cylinder: Cylinder, offset_recordings: list[Recording]) -> RidgeEstimator:
    estimator = RidgeEstimator(6).fit(offset_recordings)
    estimator.offset = fit_offset_tracker(offset_recordings, cylinder, SAMPLE_COLUMNS)
    return estimator


@pytest.mark.extended
def test_later_recordings_are_scored_from_either_start(
    ridge: RidgeEstimator, offset_recordings: list[Recording]
) -> None:
    first = max(offset_recordings, key=lambda each: abs(each.metadata.identified_zero["pressure_1_pa"].offset))
    later = replace(first, metadata=replace(first.metadata, name=f"{first.name}_later"))
    (found,) = starts(ridge, [first, later], {})
    assert (found.condition, found.reference, found.recordings) == (first.metadata.condition, "label", 1)
    stream = ridge.real_time()
    stream.run(first.samples())
    warm_n = ridge.estimate(later, *stream.offset)
    error_n = abs(warm_n - later.column("friction_n"))[later.usable()].mean()
    assert found.warm_percent == pytest.approx(100.0 * error_n / found.mean_abs_friction_n)
    assert found.warm_percent < found.cold_percent


@pytest.mark.extended
def test_without_offset_or_second_recording_there_is_nothing(
    ridge: RidgeEstimator, offset_recordings: list[Recording]
) -> None:
    assert starts(ridge, offset_recordings[:1], {}) == []
    assert starts(RidgeEstimator(6).fit(offset_recordings), offset_recordings, {}) == []

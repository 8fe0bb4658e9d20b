"""A step model of every design does what its estimator does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.base import NotFittedError
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.realtime.bounds import UNKNOWN_N
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.reference import ReferenceStream
from cylinder_friction.realtime.stream import RealTimeStream

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording


def test_on_valid_samples_reference_and_compiled_step_are_the_estimate_bit_for_bit(
    designed: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    model, recording = designed.step_model(), labelled_recordings[0]
    samples, expected = recording.samples(designed.inputs)[:800], designed.estimate(recording)[:800]
    reference = ReferenceStream(model)
    np.testing.assert_array_equal([reference.step(*sample).friction_n for sample in samples], expected)
    newtons, flags = RealTimeStream(model).run(samples)
    np.testing.assert_array_equal(newtons[:, 0], expected)
    assert set(flags) <= {0, Flag.WARMING, Flag.OFFSET_UNKNOWN, Flag.WARMING | Flag.OFFSET_UNKNOWN}


def test_the_compiled_step_is_the_reference_bit_for_bit_whatever_comes(
    designed: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    model = designed.step_model()
    samples = labelled_recordings[1].samples(designed.inputs)[:900].copy()
    position, others = model.position, [place for place in range(len(model.inputs)) if place != model.position]
    for place in others[:1]:
        samples[300:360, place] = samples[300, place]
        samples[400:500, place] = np.nan
    samples[450:460, others[-1:]], samples[470] = np.inf, 1e9
    samples[600:620, position] += 0.1
    reference = ReferenceStream(model)
    expected = [reference.step(*sample) for sample in samples]
    compiled = RealTimeStream(model)
    assert [compiled.step(*sample) for sample in samples] == expected


def test_guard_and_bounds_are_the_estimators(small_hybrid: HybridEstimator) -> None:
    model = small_hybrid.step_model()
    assert (model.guard, model.bounds) == (small_hybrid.guard, small_hybrid.bounds)


def test_an_estimator_that_was_never_calibrated_says_nothing_about_its_error(
    cylinder: Cylinder, small_hybrid: HybridEstimator
) -> None:
    alone = small_hybrid.without_forest()
    assert alone.guard == small_hybrid.guard
    assert alone.bounds is None
    bounds = alone.step_model().bounds
    assert (bounds.lower_n, bounds.upper_n, bounds.probability) == ((-UNKNOWN_N,) * 4, (UNKNOWN_N,) * 4, 1.0)


def test_an_unfitted_estimator_says_so() -> None:
    with pytest.raises(NotFittedError, match="not fitted yet; call fit or load first"):
        HybridEstimator().step_model()


def test_an_estimator_without_a_real_time_step_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="lugre: has no real-time step; expected a hybrid, forest, force balance or"):
        LugreEstimator(cylinder).step_model()


@pytest.mark.parametrize("weight", [1.0, 0.3, 0.02])
def test_the_low_pass_is_a_filter_cut_where_the_rest_no_longer_counts(
    weight: float, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    low_pass = LowPassForceBalanceEstimator(cylinder).fit(labelled_recordings)
    low_pass.weight = weight
    recording = labelled_recordings[0]
    newtons, _ = low_pass.real_time().run(recording.samples())
    np.testing.assert_allclose(newtons[:, 0], low_pass.estimate(recording), atol=1e-6)

"""A step model of every design does what its estimator does."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.base import NotFittedError
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator
from cylinder_friction.realtime.bounds import UNKNOWN_N
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.from_hybrid import step_model
from cylinder_friction.realtime.reference import ReferenceStream
from cylinder_friction.realtime.stream import RealTimeStream

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.realtime.estimator import RealTimeEstimator
    from cylinder_friction.recordings.recording import Recording


def test_on_sound_samples_reference_and_compiled_step_are_the_estimate_bit_for_bit(
    designed: RealTimeEstimator, labelled_recordings: list[Recording]
) -> None:
    model, recording = step_model(designed), labelled_recordings[0]
    samples, expected = recording.samples()[:800], designed.estimate(recording)[:800]
    reference = ReferenceStream(model)
    np.testing.assert_array_equal([reference.step(*sample).friction_n for sample in samples], expected)
    newtons, flags = RealTimeStream(model).run(samples)
    np.testing.assert_array_equal(newtons[:, 0], expected)
    assert set(flags) <= {0, Flag.WARMING}


def test_the_compiled_step_is_the_reference_bit_for_bit_whatever_comes(
    designed: RealTimeEstimator, labelled_recordings: list[Recording]
) -> None:
    model = step_model(designed)
    samples = labelled_recordings[1].samples()[:900].copy()
    samples[300:360, 0] = samples[300, 0]
    samples[400:500, 1], samples[450:460, 0], samples[470] = np.nan, np.inf, 1e9
    samples[600:620, 2] += 0.1
    reference = ReferenceStream(model)
    expected = [reference.step(*sample) for sample in samples]
    compiled = RealTimeStream(model)
    assert [compiled.step(*sample) for sample in samples] == expected


def test_guard_and_bounds_may_be_replaced(small_hybrid: HybridEstimator) -> None:
    model = step_model(small_hybrid)
    guard, bounds = replace(model.guard, freeze_samples=7), replace(model.bounds, probability=0.5)
    other = step_model(small_hybrid, guard, bounds)
    assert (other.guard, other.bounds) == (guard, bounds)
    assert (model.guard, model.bounds) == (small_hybrid.guard, small_hybrid.bounds)


def test_an_estimator_that_was_never_calibrated_says_nothing_about_its_error(
    cylinder: Cylinder, small_hybrid: HybridEstimator
) -> None:
    alone = small_hybrid.without_forest()
    assert alone.guard == small_hybrid.guard
    assert alone.bounds is None
    bounds = step_model(alone).bounds
    assert (bounds.lower_n, bounds.upper_n, bounds.probability) == ((-UNKNOWN_N,) * 4, (UNKNOWN_N,) * 4, 1.0)


def test_an_unfitted_estimator_says_so() -> None:
    with pytest.raises(NotFittedError, match="not fitted yet; call fit or load first"):
        step_model(HybridEstimator())


def test_another_kind_of_estimator_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="expected an estimator of kind 'hybrid' or 'random_forest', but got 'force_"):
        step_model(ForceBalanceEstimator(cylinder, "none"))

"""What a correction gains, and that nothing is kept of one that gains nothing."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.gain import Gain
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.recordings.recording import Recording


@pytest.mark.parametrize(("times", "share"), [(1.0, 1.0), (2.0, 0.5), (0.5, 1.0), (-1.0, 0.0)])
def test_a_correction_that_does_not_hold_elsewhere_is_scaled_down(times: float, share: float) -> None:
    wanted_n = np.array([1.0, -2.0, 3.0])
    gain = Gain.of([np.stack([times * wanted_n, wanted_n])])
    assert gain.share == pytest.approx(share)
    assert gain.low_pass_n == 2.0
    assert gain.corrected_n <= gain.low_pass_n


def test_a_hybrid_is_no_worse_than_the_low_pass_on_the_sessions_held_out(
    small_hybrid: HybridEstimator, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    assert small_hybrid.gain is not None
    assert small_hybrid.gain.corrected_n <= small_hybrid.gain.low_pass_n


def test_adaptation_without_a_gain_gives_the_low_pass_with_tracker_and_bounds(
    small_hybrid: HybridEstimator, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    """Labels that are a low-pass of the balance, and noise, leave nothing to learn."""
    low_pass = LowPassForceBalanceEstimator(cylinder, weight=0.3).fit(labelled_recordings)
    low_pass.weight = 0.3
    draw = np.random.default_rng(0)
    noisy = [
        each.with_columns(friction_n=low_pass.estimate(each) + draw.normal(0.0, 30.0, len(each)))
        for each in labelled_recordings
    ]
    adapted = small_hybrid.adapt(noisy, cylinder, plan=TrainingPlan(1, None, 200, 20, 4))
    assert isinstance(adapted, LowPassForceBalanceEstimator)
    assert adapted.weight == pytest.approx(0.3, abs=0.1)
    assert adapted.bounds is not None
    assert adapted.guard is not None
    assert adapted.trained_for is not None
    assert "its bounds rest on 8 sessions" in adapted.trained_for.adapted
    newtons, _ = adapted.real_time().run(noisy[0].samples())
    np.testing.assert_allclose(newtons[:, 0], adapted.estimate(noisy[0]), atol=1e-6)

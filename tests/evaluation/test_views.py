"""What figures show, in numbers known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.evaluation.views import agreement, excerpt, histogram, velocity_profile


def test_an_excerpt_is_the_stretch_with_most_motion_and_hides_what_is_not_usable(compared):
    part = excerpt(compared(hybrid=1.0, lugre=2.0), "1", ("hybrid",), 4.0)
    assert len(part.time_s) == 800
    assert part.time_s[0] == pytest.approx(0.05)  # the first ten rows are not usable
    assert part.residuals_n()["hybrid"] == pytest.approx(-1.0)


def test_the_views_agree_with_numbers_known_beforehand(compared):
    comparison = compared(hybrid=6.0, lugre=2.0)
    found = agreement(comparison, "hybrid", "1")
    assert found.slope == pytest.approx(1.0)
    assert found.intercept_n == pytest.approx(6.0)
    assert 0.999 < found.r_squared < 1.0
    profile = velocity_profile(comparison, "1", ("hybrid",))
    assert profile.medians_n["hybrid"] - profile.medians_n["label"] == pytest.approx(6.0, abs=0.1)
    counted = histogram(np.random.default_rng(0).normal(size=50_000))
    assert counted.density.sum() * counted.width_n == pytest.approx(1.0 - counted.outside, abs=1e-9)
    assert np.abs(counted.density - counted.normal_density).max() < 0.03

"""A Stribeck curve is stated where the points tell it, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.friction_models.identification.steady_points import SteadyPoint, is_breakaway_known, known_curve
from cylinder_friction.friction_models.stribeck import StribeckCurve

CURVE = StribeckCurve(300.0, 450.0, 0.005, 1.5, 1500.0, 1.1)


def points(slowest_m_s: float, fastest_m_s: float, ways: tuple[float, ...] = (1.0, -1.0)) -> list[SteadyPoint]:
    velocity = np.concatenate([way * np.geomspace(slowest_m_s, fastest_m_s, 12) for way in ways])
    friction = CURVE.friction(velocity)
    return [SteadyPoint(v, f, f - 5.0, f + 5.0, 100) for v, f in zip(velocity.tolist(), friction.tolist(), strict=True)]


def test_points_over_a_wide_range_tell_the_curve() -> None:
    curve, problem = known_curve(points(0.001, 0.1))
    assert problem == ""
    assert curve is not None
    assert curve.coulomb_n == pytest.approx(300.0, rel=0.02)
    assert curve.viscous_n_s_m == pytest.approx(1500.0, rel=0.05)
    assert is_breakaway_known(curve, points(0.001, 0.1))
    assert not is_breakaway_known(CURVE, points(0.03, 0.3)), "sliding was never slow"


@pytest.mark.parametrize(
    ("seen", "message"),
    [
        (points(0.006, 0.016), "speeds of steady sliding run from 6 to 16 mm/s, a factor of 2.7; Coulomb and viscous"),
        (points(0.001, 0.1, (1.0,)), "steady sliding was seen while extending alone"),
        (points(0.001, 0.1, (-1.0,)), "steady sliding was seen while retracting alone"),
        ([], "got 0 points of steady sliding"),
    ],
)
def test_the_reason_why_no_curve_is_stated(seen: list[SteadyPoint], message: str) -> None:
    curve, problem = known_curve(seen)
    assert curve is None
    assert message in problem


def test_a_fit_outside_of_what_was_seen_is_not_stated() -> None:
    """Friction in proportion to speed leaves nothing that Coulomb friction could be."""
    velocity = np.concatenate([way * np.geomspace(0.02, 0.2, 12) for way in (1.0, -1.0)])
    steep = [SteadyPoint(v, 2e4 * v, 2e4 * v, 2e4 * v, 100) for v in velocity.tolist()]
    curve, problem = known_curve(steep)
    assert curve is None
    assert "lies outside the force of steady sliding, 400 to 4000 N, so its parameters are not determined" in problem

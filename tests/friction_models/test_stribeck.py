from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.friction_models.stribeck import StribeckCurve, fit_stribeck

CURVE = StribeckCurve(240.0, 360.0, 8e-3, 1.5, 1500.0, 1.2)


@given(st.floats(1e-5, 0.5))
def test_the_two_directions_differ_by_the_retract_ratio_in_their_dry_part_alone(speed: float) -> None:
    extend, retract = CURVE.friction(np.array([speed, -speed]))
    viscous = CURVE.viscous_n_s_m * speed
    assert -retract - viscous == pytest.approx(CURVE.retract_ratio * (extend - viscous), rel=1e-9)


def test_the_curve_goes_from_static_over_coulomb_to_viscous() -> None:
    assert CURVE.friction(np.array([1e-9]))[0] == pytest.approx(360.0, abs=0.1)
    assert CURVE.friction(np.array([0.1]))[0] == pytest.approx(240.0 + 150.0, abs=0.1)
    assert CURVE.friction(np.array([0.0]))[0] == 0.0


def test_the_fit_finds_the_curve_despite_noise_and_outliers() -> None:
    generator = np.random.default_rng(3)
    speed = np.geomspace(1e-3, 0.12, 25)
    velocity = np.concatenate([-speed, speed])
    friction = CURVE.friction(velocity) + generator.normal(0.0, 2.0, len(velocity))
    friction[[4, 40]] += 150.0
    fitted = fit_stribeck(velocity, friction)
    assert fitted.coulomb_n == pytest.approx(240.0, rel=0.03)
    assert fitted.static_n == pytest.approx(360.0, rel=0.06)
    assert fitted.retract_ratio == pytest.approx(1.2, rel=0.03)
    assert fitted.viscous_n_s_m == pytest.approx(1500.0, rel=0.06)
    assert np.abs(fitted.friction(velocity) - CURVE.friction(velocity)).max() < 8.0


def test_too_few_points_are_refused_with_what_to_do() -> None:
    with pytest.raises(ValueError, match=r"got 3 points of steady sliding; record more strokes"):
        fit_stribeck(np.array([0.1, 0.2, -0.1]), np.array([1.0, 1.0, -1.0]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"coulomb_n": -1.0}, "coulomb_n must be a positive number, but got -1.0"),
        ({"static_n": 200.0}, r"static_n must be at least coulomb_n \(240.0 N\), but got 200.0 N"),
        ({"retract_ratio": 0.0}, "StribeckCurve: retract_ratio must be a positive number, but got 0.0"),
        ({"viscous_n_s_m": float("nan")}, "viscous_n_s_m must be zero or a positive number, but got nan"),
    ],
)
def test_impossible_numbers_are_refused_by_name(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        StribeckCurve(**{**CURVE.__dict__, **change})

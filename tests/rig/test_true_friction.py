from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.rig.friction import (
    coulomb_friction,
    damping,
    direction_factor,
    film_rate,
    strength,
    viscosity_ratio,
)
from cylinder_friction.rig.parameters import FrictionParameters, friction_constants

F = friction_constants(FrictionParameters())
PRESSURES = st.floats(0.0, 200e5)


@given(PRESSURES, PRESSURES, st.floats(1e4, 50e5))
def test_coulomb_friction_grows_with_either_pressure_where_it_matters(p1: float, p2: float, more: float) -> None:
    before = coulomb_friction(F, p1, p2, 1.0, 40.0)
    assert coulomb_friction(F, p1, p2 + more, 1.0, 40.0) > before
    assert coulomb_friction(F, p1 + more, p2, 1.0, 40.0) >= before
    if p1 >= p2:
        assert coulomb_friction(F, p1 + more, p2, 1.0, 40.0) > before


def test_the_pressure_law_is_not_linear() -> None:
    at = [coulomb_friction(F, p, p, 1.0, 40.0) for p in (0.0, 30e5, 60e5)]
    assert at[1] - at[0] > 1.2 * (at[2] - at[1]) > 0.0


def test_friction_without_pressure_has_the_stated_ratio_of_directions() -> None:
    assert direction_factor(F, -1.0) / direction_factor(F, 1.0) == pytest.approx(290.0 / 240.0, rel=1e-3)


def test_breakaway_after_a_long_dwell_is_the_static_ratio_and_less_with_a_film() -> None:
    assert strength(F, 300.0, 0.0, 0.0, 1.0) == pytest.approx(450.0)
    assert strength(F, 300.0, 0.0, 0.2, 1.0) == pytest.approx(0.8 * 450.0)


def test_the_film_builds_fast_thins_slower_and_slowest_at_rest() -> None:
    _, build = film_rate(F, 0.0, 0.03, 1.0)
    _, squeeze = film_rate(F, 0.33, 0.01, 1.0)
    _, dwell = film_rate(F, 0.33, 0.0, 1.0)
    assert build > squeeze > 50.0 * dwell > 0.0


@given(st.floats(10.0, 70.0))
def test_warm_oil_is_thinner_and_drags_less(temperature_c: float) -> None:
    assert viscosity_ratio(F, temperature_c + 1.0) < viscosity_ratio(F, temperature_c)
    assert damping(F, 0.05, viscosity_ratio(F, temperature_c)) > 0.0
    assert viscosity_ratio(F, 40.0) == pytest.approx(1.0)

from __future__ import annotations

import pytest
from hypothesis import given, settings
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


@settings(deadline=None)  # the first call compiles
@given(PRESSURES, PRESSURES, st.floats(1e4, 50e5))
def test_coulomb_friction_grows_with_either_pressure_where_it_matters(p1: float, p2: float, more: float) -> None:
    before = coulomb_friction(F, p1, p2, 1.0, 40.0)
    assert coulomb_friction(F, p1, p2 + more, 1.0, 40.0) > before
    assert coulomb_friction(F, p1 + more, p2, 1.0, 40.0) >= before
    if p1 >= p2:
        assert coulomb_friction(F, p1 + more, p2, 1.0, 40.0) > before


def test_friction_without_pressure_has_the_stated_ratio_of_directions() -> None:
    assert direction_factor(F, -1.0) / direction_factor(F, 1.0) == pytest.approx(290.0 / 240.0, rel=1e-3)


def test_breakaway_is_less_with_a_film_which_builds_fast_thins_slower_and_slowest_at_rest() -> None:
    assert strength(F, 300.0, 0.0, 0.0, 1.0) == pytest.approx(450.0)
    assert strength(F, 300.0, 0.0, 0.2, 1.0) == pytest.approx(0.8 * 450.0)
    build, squeeze, dwell = (film_rate(F, *at, 1.0)[1] for at in ((0.0, 0.03), (0.33, 0.01), (0.33, 0.0)))
    assert build > squeeze > 50.0 * dwell > 0.0


@settings(deadline=None)
@given(st.floats(10.0, 70.0))
def test_warm_oil_is_thinner_and_drags_less(temperature_c: float) -> None:
    assert viscosity_ratio(F, temperature_c + 1.0) < viscosity_ratio(F, temperature_c)
    assert damping(F, 0.05, viscosity_ratio(F, temperature_c)) > 0.0
    assert viscosity_ratio(F, 40.0) == pytest.approx(1.0)

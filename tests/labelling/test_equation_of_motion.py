import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.equation_of_motion import (
    Stiffness,
    friction_label,
    paper_stiffness,
    trapped_oil_stiffness,
)
from cylinder_friction.signals.smooth_signals import SmoothSignals

MIDDLE_M = 0.125


def signals(
    pressure_1_pa: float = 0.0, pressure_2_pa: float = 0.0, velocity: float = 0.0, acceleration: float = 0.0
) -> SmoothSignals:
    return SmoothSignals(*(np.array([value]) for value in (pressure_1_pa, pressure_2_pa, velocity, acceleration)))


def label(
    cylinder: Cylinder, seen: SmoothSignals, at_m: float = MIDDLE_M, load_n: float = 0.0, **spring: float
) -> float:
    stiffness = Stiffness(**spring)  # type: ignore[arg-type]
    return float(friction_label(seen, np.array([at_m]), load_n, cylinder, stiffness)[0])


@given(
    friction_n=st.floats(-2e3, 2e3),
    pressure_2_pa=st.floats(0.0, 2e7),
    acceleration=st.floats(-20.0, 20.0),
    load_n=st.floats(-1e4, 1e4),
)
def test_friction_that_balances_the_piston_is_found(
    cylinder: Cylinder, friction_n: float, pressure_2_pa: float, acceleration: float, load_n: float
) -> None:
    force_n = friction_n + load_n + cylinder.moving_mass_kg * acceleration
    pressure_1_pa = (force_n + pressure_2_pa * cylinder.annulus_area_m2) / cylinder.piston_area_m2
    seen = signals(pressure_1_pa, pressure_2_pa, 0.0, acceleration)
    assert label(cylinder, seen, load_n=load_n) == pytest.approx(friction_n, abs=1e-6)


def test_trapped_oil_replaces_the_pressures(cylinder: Cylinder) -> None:
    without = label(cylinder, signals(), MIDDLE_M + 1e-5, mode="trapped_oil")
    with_pressures = label(cylinder, signals(9e5, 4e6), MIDDLE_M + 1e-5, mode="trapped_oil")
    assert without == with_pressures
    assert without == pytest.approx(-1e-5 * trapped_oil_stiffness(cylinder, Stiffness()))
    assert label(cylinder, signals(), MIDDLE_M, mode="trapped_oil") == 0.0


def test_trapped_oil_is_the_springs_of_both_chambers(cylinder: Cylinder) -> None:
    area_1, area_2 = cylinder.piston_area_m2, cylinder.annulus_area_m2
    no_dead_volume = Stiffness("trapped_oil", bulk_modulus_pa=1.4e9, dead_volume_m3=1e-15)
    expected = 1.4e9 * (area_1 + area_2) / MIDDLE_M
    assert trapped_oil_stiffness(cylinder, no_dead_volume) == pytest.approx(expected, rel=1e-6)


def test_external_spring_is_taken_off(cylinder: Cylinder) -> None:
    got = label(cylinder, signals(1e6), 0.2, mode="external", external_stiffness_n_m=1e4, reference_m=0.1)
    assert got == pytest.approx(1e6 * cylinder.piston_area_m2 - 1e4 * 0.1)


def test_paper_literal_is_meganewtons_where_friction_is_hundreds(cylinder: Cylinder) -> None:
    seen = signals(1e6, 1e6, velocity=0.1)
    plain, literal = label(cylinder, seen), label(cylinder, seen, mode="paper_literal", dead_volume_m3=1e-12)
    # Equations (1) and (2) mid-stroke: 1.4 GPa over oil columns of half a stroke, side by side.
    spring_n = 1.4e9 * (cylinder.piston_area_m2 + cylinder.annulus_area_m2) / MIDDLE_M * MIDDLE_M
    assert spring_n > 7e6
    assert literal - plain == pytest.approx(-spring_n, rel=1e-6)


def test_paper_literal_keeps_equation_4_as_printed(cylinder: Cylinder) -> None:
    """To the left F_f = P2·A2 - P1·A1 - K·x - m·a, unsigned; signed friction is its negative."""
    stiffness = Stiffness("paper_literal")
    spring_n = float(paper_stiffness(np.array([0.1]), cylinder, stiffness)[0]) * 0.1
    unsigned = 4e6 * cylinder.annulus_area_m2 - 1e6 * cylinder.piston_area_m2 - spring_n - cylinder.moving_mass_kg * 2.0
    got = label(cylinder, signals(1e6, 4e6, -0.1, 2.0), 0.1, mode="paper_literal")
    assert got == pytest.approx(-unsigned)


def test_stiffness_is_bounded_at_the_ends(cylinder: Cylinder) -> None:
    ends = paper_stiffness(np.array([-0.001, 0.0, 0.25, 0.26]), cylinder, Stiffness())
    assert np.isfinite(ends).all()
    assert ends[0] == ends[1]
    assert ends[2] == ends[3]


def test_unknown_mode_is_refused() -> None:
    with pytest.raises(
        ValueError, match="stiffness must be one of none, trapped_oil, external, paper_literal, but got"
    ):
        Stiffness("series")  # type: ignore[arg-type]

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.equation_of_motion import (
    Stiffness,
    friction_label,
    paper_stiffness,
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


def test_the_springs_of_trapped_oil_in_both_chambers_replace_the_pressures(cylinder: Cylinder) -> None:
    spring_n_m = 1.4e9 * (cylinder.piston_area_m2 + cylinder.annulus_area_m2) / MIDDLE_M
    for seen in (signals(), signals(9e5, 4e6)):
        off_n = label(cylinder, seen, MIDDLE_M + 1e-5, mode="trapped_oil", bulk_modulus_pa=1.4e9, dead_volume_m3=1e-15)
        assert off_n == pytest.approx(-1e-5 * spring_n_m, rel=1e-6)
    assert label(cylinder, signals(), MIDDLE_M, mode="trapped_oil") == 0.0


def test_external_spring_is_taken_off(cylinder: Cylinder) -> None:
    got = label(cylinder, signals(1e6), 0.2, mode="external", external_stiffness_n_m=1e4, reference_m=0.1)
    assert got == pytest.approx(1e6 * cylinder.piston_area_m2 - 1e4 * 0.1)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_paper_literal_keeps_equation_4_as_printed(cylinder: Cylinder, way: float) -> None:
    """To the left F_f = P2·A2 - P1·A1 - K·x - m·a, unsigned; the spring is meganewtons, friction hundreds."""
    # Equations (1) and (2) mid-stroke: 1.4 GPa over oil columns of half a stroke, side by side.
    spring_n = 1.4e9 * (cylinder.piston_area_m2 + cylinder.annulus_area_m2) / MIDDLE_M * MIDDLE_M
    pressures_n = 1e6 * cylinder.piston_area_m2 - 4e6 * cylinder.annulus_area_m2
    unsigned = way * pressures_n - spring_n - cylinder.moving_mass_kg * 2.0
    got = label(cylinder, signals(1e6, 4e6, 0.1 * way, 2.0), mode="paper_literal", dead_volume_m3=1e-12)
    assert got == pytest.approx(way * unsigned, rel=1e-6)


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

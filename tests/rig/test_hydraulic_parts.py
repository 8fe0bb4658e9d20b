from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.hydraulics import (
    bulk_modulus,
    cushion_gain,
    in_series,
    makeup_flow,
    orifice,
    port_a,
    port_b,
    pump_flow,
    stop_force,
    valve_opening,
)
from cylinder_friction.rig.parameters import default_rig, hydraulic_constants

CYLINDER = Cylinder(
    name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
Y = hydraulic_constants(default_rig(CYLINDER).with_throttle(3e-8).hydraulics)


def test_bulk_modulus_is_that_of_aerated_oil() -> None:
    found = [bulk_modulus(Y, bar * 1e5) / 1e9 for bar in (1.0, 10.0, 50.0)]
    assert found == pytest.approx([0.09, 0.77, 1.32], rel=0.05)


@given(st.floats(-1.0e5, 300e5), st.floats(1e3, 1e6))
def test_oil_stiffens_with_pressure(pressure_pa: float, more: float) -> None:
    assert 0.0 < bulk_modulus(Y, pressure_pa) <= bulk_modulus(Y, pressure_pa + more) < 1.4e9 * 1.001


@given(st.floats(-100e5, 100e5))
def test_an_orifice_is_odd_and_its_slope_is_its_derivative(drop_pa: float) -> None:
    flow, slope = orifice(Y, 4e-7, drop_pa)
    assert orifice(Y, 4e-7, -drop_pa)[0] == -flow
    step = 10.0
    ahead, behind = orifice(Y, 4e-7, drop_pa + step)[0], orifice(Y, 4e-7, drop_pa - step)[0]
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-3, abs=1e-15)
    assert slope > 0.0


def test_an_orifice_far_from_zero_follows_the_square_root() -> None:
    assert orifice(Y, 4e-7, 50e5)[0] == pytest.approx(4e-7 * (50e5) ** 0.5, rel=1e-4)


@given(st.floats(1e-9, 1e-5), st.floats(1e-9, 1e-5))
def test_two_orifices_in_series_pass_less_than_either(first: float, second: float) -> None:
    together = in_series(first, second)
    assert together < min(first, second)
    assert together**-2 == pytest.approx(first**-2 + second**-2)


def test_the_closed_centre_is_closed_within_the_overlap() -> None:
    assert valve_opening(Y, 0.99 * Y.valve_overlap) == 0.0
    assert valve_opening(Y, 1.0) == pytest.approx(1.0)
    assert port_a(Y, 0.0, 60e5, 0.0, 0.1) == (0.0, 0.0)
    assert port_b(Y, 0.0, 60e5, 0.0, 0.1) == (0.0, 0.0)


def test_the_throttle_holds_back_outflow_and_its_check_valve_lets_inflow_pass() -> None:
    out, _ = port_b(Y, 1.0, 60e5, 50e5, 0.1)
    into, _ = port_b(Y, -1.0, 60e5, 10e5, 0.1)
    assert out == pytest.approx(-3e-8 * (50e5 - Y.tank_pressure_pa) ** 0.5, rel=0.01)
    assert into == pytest.approx(4e-7 * (50e5) ** 0.5, rel=0.03)


def test_cushions_hold_back_outflow_near_their_end_alone() -> None:
    assert cushion_gain(Y, 0.0) < 0.05 * cushion_gain(Y, 0.02)
    near, far = (port_a(Y, -1.0, 60e5, 20e5, x)[0] for x in (0.001, 0.1))
    assert 0.0 > near > 0.1 * far
    assert port_a(Y, 1.0, 60e5, 20e5, 0.001) == port_a(Y, 1.0, 60e5, 20e5, 0.1)


def test_the_pump_closes_at_its_pressure_and_the_relief_opens_above() -> None:
    assert pump_flow(Y, 30e5)[0] == pytest.approx(10.0 / 60e3)
    assert pump_flow(Y, 60e5)[0] == 0.0
    assert pump_flow(Y, 66e5)[0] < 0.0


@given(st.floats(-2e-4, 0.2502), st.floats(-0.2, 0.2))
def test_an_end_stop_never_pulls(position_m: float, velocity_m_s: float) -> None:
    force, stiffness = stop_force(Y, position_m, velocity_m_s)
    assert stiffness >= 0.0
    if position_m < 0.0:
        assert force >= 0.0
    elif position_m > Y.stroke_m:
        assert force <= 0.0
    else:
        assert force == 0.0


@given(st.floats(-1.0e5, 50e5))
def test_anti_cavitation_valves_let_in_what_is_missing_and_nothing_out(pressure_pa: float) -> None:
    fitted = Y._replace(makeup_gain=2e-6)
    flow, slope = makeup_flow(fitted, pressure_pa)
    opens_pa = Y.tank_pressure_pa - Y.makeup_cracking_pa
    assert (flow > 0.0) == (pressure_pa < opens_pa)
    assert slope >= 0.0
    assert makeup_flow(Y, pressure_pa) == (0.0, 0.0)

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.hydraulics import (
    bulk_modulus,
    orifice,
)
from cylinder_friction.rig.parameters import default_rig, hydraulic_constants

CYLINDER = Cylinder(
    name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
Y = hydraulic_constants(default_rig(CYLINDER).with_throttle(3e-8).hydraulics)


def test_bulk_modulus_is_that_of_aerated_oil() -> None:
    found = [bulk_modulus(Y, bar * 1e5) / 1e9 for bar in (1.0, 10.0, 50.0)]
    assert found == pytest.approx([0.09, 0.77, 1.32], rel=0.05)


@given(st.floats(-100e5, 100e5))
def test_an_orifice_is_odd_and_its_slope_is_its_derivative(drop_pa: float) -> None:
    flow, slope = orifice(Y, 4e-7, drop_pa)
    assert orifice(Y, 4e-7, -drop_pa)[0] == -flow
    step = 10.0
    ahead, behind = orifice(Y, 4e-7, drop_pa + step)[0], orifice(Y, 4e-7, drop_pa - step)[0]
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-3, abs=1e-15)
    assert slope > 0.0

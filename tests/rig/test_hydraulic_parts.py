from __future__ import annotations

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.hydraulics import bulk_modulus
from cylinder_friction.rig.parameters import default_rig, hydraulic_constants

CYLINDER = Cylinder(
    name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
Y = hydraulic_constants(default_rig(CYLINDER).with_throttle(3e-8).hydraulics)


def test_bulk_modulus_is_that_of_aerated_oil() -> None:
    found = [bulk_modulus(Y, bar * 1e5) / 1e9 for bar in (1.0, 10.0, 50.0)]
    assert found == pytest.approx([0.09, 0.77, 1.32], rel=0.05)

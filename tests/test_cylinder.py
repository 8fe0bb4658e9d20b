"""Areas of the Bosch H160CA 63x28, and what is refused."""

from __future__ import annotations

import pytest

from cylinder_friction.cylinder import Cylinder


def test_areas_of_the_catalogue_cylinder(cylinder: Cylinder) -> None:
    assert cylinder.piston_area_m2 == pytest.approx(3.117e-3, rel=1e-3)
    assert cylinder.annulus_area_m2 == pytest.approx(2.501e-3, rel=1e-3)
    assert cylinder.piston_area_m2 / cylinder.annulus_area_m2 == pytest.approx(1.246, rel=1e-3)


def test_a_rod_as_thick_as_the_bore_is_refused() -> None:
    with pytest.raises(ValueError, match=r"rod_diameter_m must be smaller than bore_diameter_m \(0\.063 m\)"):
        Cylinder("solid", 0.063, 0.063, 0.25, 6.0)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_length_that_is_none_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="'odd': stroke_m must be a positive number, but got"):
        Cylinder("odd", 0.063, 0.028, value, 6.0)

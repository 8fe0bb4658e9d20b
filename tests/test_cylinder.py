"""Areas of the Bosch H160CA 63x28, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from cylinder_friction.cylinder import Cylinder


def test_areas_of_the_catalogue_cylinder(cylinder: Cylinder) -> None:
    assert cylinder.piston_area_m2 == pytest.approx(3.117e-3, rel=1e-3)
    assert cylinder.annulus_area_m2 == pytest.approx(2.501e-3, rel=1e-3)
    assert cylinder.piston_area_m2 / cylinder.annulus_area_m2 == pytest.approx(1.246, rel=1e-3)


def test_a_rod_as_thick_as_the_bore_is_refused() -> None:
    with pytest.raises(ValueError, match=r"rod_diameter_m must be smaller than bore_diameter_m \(0\.063 m\)"):
        Cylinder(name="solid", bore_diameter_m=0.063, rod_diameter_m=0.063, stroke_m=0.25, moving_mass_kg=6.0)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), "63 mm", None])
def test_a_length_that_is_no_positive_number_is_refused(value: Any) -> None:
    with pytest.raises(ValueError, match=f"'odd': stroke_m must be a positive number, but got {value!r}"):
        Cylinder(name="odd", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=value, moving_mass_kg=6.0)


def test_a_name_is_optional_and_the_repr_can_be_evaluated() -> None:
    cylinder = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
    assert cylinder.name == "cylinder"
    assert repr(cylinder) == (
        "Cylinder(name='cylinder', bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)"
    )
    assert eval(repr(cylinder)) == cylinder


def test_millimetres_are_refused() -> None:
    message = r"stroke_m must be in metres, at most 30, but got 250; if that is in millimetres, give 0\.25"
    with pytest.raises(ValueError, match=message):
        Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=250, moving_mass_kg=6.0)

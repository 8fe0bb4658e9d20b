"""Areas of the Bosch H160CA 63x28, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from cylinder_friction.cylinder import Cylinder


def test_areas_of_the_catalogue_cylinder(cylinder: Cylinder) -> None:
    assert cylinder.piston_area_m2 == pytest.approx(3.117e-3, rel=1e-3)
    assert cylinder.annulus_area_m2 == pytest.approx(2.501e-3, rel=1e-3)
    assert cylinder.piston_area_m2 / cylinder.annulus_area_m2 == pytest.approx(1.246, rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stroke_m": 250}, r"in metres, at most 30, but got 250; if that is in millimetres, give 0\.25"),
        *(
            ({"stroke_m": value}, f"'odd': stroke_m must be a positive number, but got {value!r}")
            for value in (0.0, -1.0, float("nan"), float("inf"), "63 mm", None)
        ),
    ],
)
def test_what_is_no_cylinder_is_refused(changes: dict[str, Any], message: str) -> None:
    sizes = {"bore_diameter_m": 0.063, "rod_diameter_m": 0.028, "stroke_m": 0.25, "moving_mass_kg": 6.0}
    with pytest.raises(ValueError, match=message):
        Cylinder(name="odd", **sizes | changes)


def test_a_name_is_optional_and_the_repr_can_be_evaluated() -> None:
    cylinder = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
    assert cylinder.name == "cylinder"
    assert eval(repr(cylinder)) == cylinder

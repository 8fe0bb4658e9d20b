"""Fixtures that many tests share: the cylinder, and labelled recordings whose friction is known in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from closed_form import closed_form_recording
from cylinder_friction.cylinder import Cylinder

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording


@pytest.fixture(scope="session")
def cylinder() -> Cylinder:
    return Cylinder(
        name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
    )


@pytest.fixture(scope="session")
def labelled_recordings(cylinder: Cylinder) -> list[Recording]:
    """Two recordings of each of four conditions, one session each."""
    return [
        closed_form_recording(
            cylinder,
            f"condition{condition}_session{take}",
            str(condition),
            f"test{condition}-{take}",
            10 * condition + take,
        )
        for condition in (1, 2, 3, 4)
        for take in (1, 2)
    ]

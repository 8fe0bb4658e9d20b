"""Fixtures that many tests share: the cylinder, and labelled recordings whose friction is known in closed form."""

import pytest

from cylinder_friction import Cylinder, Recording
from cylinder_friction.import_graph import remove_stale_machine_code
from made_recordings import take_of_each_condition

pytest_plugins = ("browser",)


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        remove_stale_machine_code()


@pytest.fixture(scope="session")
def cylinder() -> Cylinder:
    return Cylinder(
        name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
    )


@pytest.fixture(scope="session")
def labelled_recordings(cylinder: Cylinder) -> list[Recording]:
    """Two recordings of each of the four tests, one session each."""
    return take_of_each_condition(cylinder, (1, 2))

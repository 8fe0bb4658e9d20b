"""Labelled recordings whose friction is known in closed form, not from the rig, and fixtures of them."""

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

SAMPLE_TIME_S = 0.005


def made_recording(
    cylinder: Cylinder,
    name: str = "made",
    condition: str = "1",
    session: str = "s1",
    seed: int = 0,
    seconds: float = 20.0,
) -> Recording:
    """Return a labelled recording of a wandering sine with Stribeck friction and sensor noise; not from the rig."""
    generator = np.random.default_rng(seed)
    time_s = SAMPLE_TIME_S * np.arange(round(seconds / SAMPLE_TIME_S))
    rate = 2.0 * np.pi * generator.uniform(0.2, 0.5)
    amplitude_m = 0.03
    position_m = 0.125 + amplitude_m * np.sin(rate * time_s + seed)
    velocity_m_s = amplitude_m * rate * np.cos(rate * time_s + seed)
    acceleration_m_s2 = -amplitude_m * rate**2 * np.sin(rate * time_s + seed)
    pressure_2_pa = 9e5 * int(condition) + 2e5 * np.sin(0.3 * time_s)
    coulomb_n = 240.0 + 4.0 * (pressure_2_pa / 1e5)
    friction_n = (
        np.tanh(velocity_m_s / 2e-3) * (coulomb_n * (1.0 + 0.5 * np.exp(-((velocity_m_s / 8e-3) ** 2))))
        + 1500.0 * velocity_m_s
    )
    pressure_1_pa = (
        friction_n + pressure_2_pa * cylinder.annulus_area_m2 + cylinder.moving_mass_kg * acceleration_m_s2
    ) / cylinder.piston_area_m2
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": pressure_1_pa + generator.normal(0.0, 5e3, len(time_s)),
            "pressure_2_pa": pressure_2_pa + generator.normal(0.0, 5e3, len(time_s)),
            "position_m": position_m + generator.normal(0.0, 3e-5, len(time_s)),
            "velocity_m_s": velocity_m_s,
            "acceleration_m_s2": acceleration_m_s2,
            "friction_n": friction_n,
            "usable": np.ones(len(time_s), dtype=bool),
        }
    )
    return Recording(RecordingMetadata(name, condition, session, SAMPLE_TIME_S, cylinder.name), table)


def take_of_each_condition(cylinder: Cylinder, takes: tuple[int, ...]) -> list[Recording]:
    """Return recordings of each of the four tests, one session each."""
    return [
        made_recording(
            cylinder,
            f"condition{condition}_session{take}",
            str(condition),
            f"test{condition}-{take}",
            10 * condition + take,
        )
        for condition in (1, 2, 3, 4)
        for take in takes
    ]


@pytest.fixture(scope="session")
def cylinder() -> Cylinder:
    return Cylinder(
        name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
    )


@pytest.fixture(scope="session")
def labelled_recordings(cylinder: Cylinder) -> list[Recording]:
    """Two recordings of each of the four tests, one session each."""
    return take_of_each_condition(cylinder, (1, 2))

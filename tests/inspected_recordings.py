"""Recordings that the tests of the inspection look at, and the fixtures that they share."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.inspection.subject import Inspected
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.recording import Recording, RecordingMetadata, SensorUncertainty
from cylinder_friction.reporting.inspection.page import write_page
from cylinder_friction.reporting.inspection.recording_pane import Pane, Panes
from cylinder_friction.signals.methods import filters_by_method
from cylinder_friction.signals.smooth_signals import SignalFilter
from packed_pages import unpacked

SAMPLE_TIME_S = 0.005


@pytest.fixture(scope="session")
def filters(cylinder: Cylinder) -> dict[str, SignalFilter]:
    return filters_by_method(cylinder, {}, {}, {}, {})


@pytest.fixture(scope="session")
def labeller(cylinder: Cylinder) -> Labeller:
    return Labeller(cylinder)


def stated(recording: Recording, zero_pa: float = 5000.0) -> Recording:
    """Return a recording whose pressure sensors' zeros are stated as uncertain."""
    known = {name: SensorUncertainty(zero_pa, 0.0) for name in ("pressure_1_pa", "pressure_2_pa")}
    return replace(recording, metadata=replace(recording.metadata, uncertainty=known))


@pytest.fixture(scope="session")
def strokes(cylinder: Cylinder) -> Recording:
    return made_strokes(cylinder)


def made_strokes(
    cylinder: Cylinder, load_n: float = 0.0, rest_s: float = 3.0, seconds: float = 60.0, sign: float = 1.0
) -> Recording:
    """Return strokes at several speeds with 300 N of Coulomb and 1500 N s/m of viscous friction, after a rest.

    Args:
        cylinder: Whose areas make pressures of forces.
        load_n: Constant force that resists extension [N].
        rest_s: Standstill at the beginning [s].
        seconds: Length [s].
        sign: -1 for a position sensor that is mounted backwards.
    """
    generator = np.random.default_rng(1)
    time_s = SAMPLE_TIME_S * np.arange(round(seconds / SAMPLE_TIME_S))
    moving = np.clip(time_s - rest_s, 0.0, None)
    speed = 0.01 * 2.0 ** ((moving // 8.0) % 4.0)  # 10 to 80 mm/s
    velocity = np.where(moving > 0.0, speed * np.sign(np.sin(2.0 * np.pi * moving / 4.0)), 0.0)
    position = 0.05 + np.cumsum(velocity) * SAMPLE_TIME_S
    friction = np.where(velocity == 0.0, 0.0, 300.0 * np.sign(velocity) + 1500.0 * velocity)
    pressure_2 = np.full_like(time_s, 8e5)
    pressure_1 = (friction + load_n + pressure_2 * cylinder.annulus_area_m2) / cylinder.piston_area_m2
    noise = generator.normal(0.0, 1.0, (3, len(time_s)))
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": pressure_1 + 2e3 * noise[0],
            "pressure_2_pa": pressure_2 + 2e3 * noise[1],
            "position_m": sign * position + 2e-5 * noise[2],
        }
    )
    return Recording(RecordingMetadata("strokes", "1", "s1", SAMPLE_TIME_S, cylinder.name), table)


def made_panes(
    subjects: Iterable[Inspected], labeller: Labeller, filters: dict[str, SignalFilter], **options: Any
) -> tuple[list[Pane], Panes]:
    """Return the panes of subjects, and what made them."""
    found = list(subjects)
    making = Panes(labeller, filters, "savitzky_golay", **{"files": len(found), **options})
    return [making.pane(number, subject) for number, subject in enumerate(found, start=1)], making


def write_page_of(
    path: Path,
    subjects: Iterable[Inspected],
    labeller: Labeller,
    filters: dict[str, SignalFilter],
    offsets: Iterable[KnownOffset] = (),
) -> str:
    """Write the page of subjects and return its text, with every pane unpacked."""
    panes, making = made_panes(subjects, labeller, filters)
    write_page(path, panes, making, list(offsets))
    return unpacked(path.read_text(encoding="utf-8"))

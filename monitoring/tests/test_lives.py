"""Lives of a fleet: what each fate does to what the logger sees."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.campaign import RigRecording
from cylinder_friction_monitoring.fleet.demonstration import SIMULATED, write_life
from cylinder_friction_monitoring.lives import Fate, LifePlan, life

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
PLAN = LifePlan(sessions=2, begins=0, takes=1, duration_s=8.0, time_step_s=1e-4)


def lived(fate: Fate, plan: LifePlan = PLAN) -> list[RigRecording]:
    return list(life(CYLINDER, plan, 3, fate))


def friction_n(recording: RigRecording) -> float:
    truth = recording.truth[np.abs(recording.truth["velocity_m_s"]) > 0.005]
    return float(truth["friction_n"].abs().mean())


@pytest.fixture(scope="module")
def healthy() -> list[RigRecording]:
    return lived("healthy")


def test_equal_plans_give_equal_lives_with_a_session_a_day(healthy: list[RigRecording]) -> None:
    about = [(each.metadata.start, each.metadata.session, each.metadata.asset) for each in healthy]
    named = [f"cylinder03_2025010{day}T0600" for day in (6, 7)]
    days = [f"2025-01-0{day}T06:00:00Z" for day in (6, 7)]
    assert about == [(day, name, "cylinder03") for day, name in zip(days, named, strict=True)]
    for one, other in zip(healthy, lived("healthy"), strict=True):
        assert one.metadata == other.metadata
        assert one.logger.equals(other.logger)
    assert not healthy[0].logger.equals(lived("healthy", replace(PLAN, seed=1, sessions=1))[0].logger)


def test_drift_is_in_the_transmitter_alone_and_wear_changes_friction_by_work(healthy: list[RigRecording]) -> None:
    drifted = lived("drift")[1]

    def zero_bar(recording: RigRecording) -> float:
        return float((recording.logger["P1 [bar]"] - 1e-5 * recording.truth["pressure_1_pa"]).median())

    assert zero_bar(drifted) - zero_bar(healthy[1]) == pytest.approx(1.0, abs=0.1)
    assert friction_n(drifted) == pytest.approx(friction_n(healthy[1]), rel=1e-6)
    worn = lived("wear")
    assert friction_n(worn[0]) == pytest.approx(friction_n(healthy[0]), rel=1e-9)
    assert abs(friction_n(worn[1]) / friction_n(healthy[1]) - 1.0) > 0.005


@pytest.mark.parametrize("fate", ["load", "oil", "duty", "leak"])
def test_other_fates_change_what_is_measured_from_their_session_on(fate: Fate, healthy: list[RigRecording]) -> None:
    assert lived(fate, replace(PLAN, begins=1))[0].logger.equals(healthy[0].logger)
    assert not lived(fate)[1].logger.equals(healthy[1].logger)


def test_what_a_demonstration_simulates_is_kept_in_words(tmp_path: Path) -> None:
    write_life(tmp_path, 3, "leak", replace(PLAN, sessions=3, begins=1, takes=2))
    assert len(list(tmp_path.glob("*.csv"))) == 3
    words = "Simulated: the leak grows tenfold, friction stays; from 2025-01-07 on."
    assert (tmp_path / SIMULATED).read_text() == words
    with pytest.raises(ValueError, match=r"record.fate: got 'rust', but expected one of \['drift', 'duty'"):
        lived("rust")  # type: ignore[arg-type]

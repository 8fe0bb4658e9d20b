"""An offset is learned while running, as surely as stated."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.offset_tracker import fit_offset_tracker, zeros_are_known
from cylinder_friction.realtime.bounds import causal_velocity
from cylinder_friction.realtime.sensor_offset import BALANCE, EXTENDED, RETRACTED, ZERO, OffsetTracker
from cylinder_friction.recordings.columns import LOAD_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import IdentifiedZero, Recording, RecordingError, SensorUncertainty

PLACE = SAMPLE_COLUMNS.index("position_m")


@pytest.fixture(scope="module")
def tracker(cylinder: Cylinder, offset_recordings: list[Recording]) -> OffsetTracker:
    """Of all sessions but the last."""
    return fit_offset_tracker(offset_recordings[:-1], cylinder, SAMPLE_COLUMNS)


def offset_of(recording: Recording, cylinder: Cylinder) -> float:
    """Return the identified offset [N]."""
    zeros = recording.metadata.identified_zero
    areas = {"pressure_1_pa": cylinder.piston_area_m2, "pressure_2_pa": -cylinder.annulus_area_m2}
    return sum(area * zeros[column].offset for column, area in areas.items())


def learned(tracker: OffsetTracker, recording: Recording, *start: float) -> np.ndarray:
    state = tracker.new_state(*start)
    return tracker.rows(recording.samples(), causal_velocity(recording), PLACE, state)


def test_the_offset_of_an_unknown_session_is_learned(
    tracker: OffsetTracker, cylinder: Cylinder, offset_recordings: list[Recording]
) -> None:
    recording = offset_recordings[-1]
    found, true_n = learned(tracker, recording), offset_of(recording, cylinder)
    assert found[0, 0] == 0.0
    assert found[0, 1] > 1.1 * found[-1, 1], "three sessions do not show how much asymmetry differs"
    assert abs(found[-1, 0] - true_n) < 2.0 * found[-1, 1]
    assert abs(found[-1, 0] - true_n) < 5.0


@pytest.mark.extended
def test_the_zero_of_a_load_cell_is_learned_beside_a_load_that_makes_friction_uneven(
    cylinder: Cylinder, offset_recordings: list[Recording]
) -> None:
    """A load of ±1 kN, of which the pressures carry two hundredths more, as if friction resisted it unevenly."""
    loaded = [with_load(each, cylinder) for each in offset_recordings]
    columns = (*SAMPLE_COLUMNS, LOAD_FORCE)
    tracker = fit_offset_tracker(loaded[:-1], cylinder, columns)
    assert tracker.weights[BALANCE, 3] == pytest.approx(-1.02, abs=0.005)
    recording = loaded[-1].with_columns(load_force_n=loaded[-1].column(LOAD_FORCE) - 10.0)
    state, velocity = tracker.new_state(), causal_velocity(recording)
    found = tracker.rows(recording.samples(columns), velocity, PLACE, state)
    true_n = offset_of(offset_recordings[-1], cylinder) + 10.0
    assert abs(found[-1, 0] - true_n) < 5.0
    assert tracker.weights[ZERO] @ tracker.weights[BALANCE] == pytest.approx(1.0, abs=0.01)


def with_load(recording: Recording, cylinder: Cylinder) -> Recording:
    """Return a recording with a load that a cell measures, to a standard uncertainty of its zero of 8 N."""
    load_n = 1000.0 * np.sin(0.9 * recording.column("time_s"))
    metadata = recording.metadata
    stated = {**metadata.uncertainty, LOAD_FORCE: SensorUncertainty(8.0, 0.0)}
    zeros = {**metadata.identified_zero, LOAD_FORCE: IdentifiedZero(0.0, 3.0)}
    more = recording.with_columns(
        load_force_n=load_n,
        pressure_1_pa=recording.column("pressure_1_pa") + 1.02 * load_n / cylinder.piston_area_m2,
        friction_n=recording.column("friction_n") + 0.02 * load_n,
    )
    return replace(more, metadata=replace(metadata, uncertainty=stated, identified_zero=zeros))


def test_an_offset_far_beyond_what_was_stated_is_still_found(
    tracker: OffsetTracker, cylinder: Cylinder, offset_recordings: list[Recording]
) -> None:
    recording = offset_recordings[-1]
    shifted = recording.with_columns(pressure_1_pa=recording.column("pressure_1_pa") + 3e4)
    more_n = learned(tracker, shifted, 0.0, 300.0)[-1, 0] - learned(tracker, recording, 0.0, 300.0)[-1, 0]
    assert more_n == pytest.approx(3e4 * cylinder.piston_area_m2, rel=0.05)


def test_a_known_offset_is_kept_and_an_unknown_one_drifts(
    tracker: OffsetTracker, offset_recordings: list[Recording]
) -> None:
    resting = offset_recordings[-1]
    resting = resting.with_columns(position_m=np.full(len(resting), 0.1))
    found = learned(tracker, resting, 5.0, 10.0)
    assert set(found[:, 0]) == {5.0}
    assert np.all(np.diff(found[:, 1]) > 0.0)
    assert found[0, 1] == pytest.approx(10.0)


def test_rest_shows_no_offset(tracker: OffsetTracker, offset_recordings: list[Recording]) -> None:
    """Whatever holds the piston at rest, before the first stroke too, is learned by nobody."""
    resting = offset_recordings[-1]
    areas = tracker.weights[BALANCE]
    for held_n in (0.0, 30.0, -150.0, 300.0):
        pressure_1_pa = (held_n - areas[1] * resting.column("pressure_2_pa")) / areas[0]
        held = resting.with_columns(position_m=np.full(len(resting), 0.1), pressure_1_pa=pressure_1_pa)
        assert not learned(tracker, held)[:, 0].any()


def test_what_gives_no_tracker_is_refused(cylinder: Cylinder, offset_recordings: list[Recording]) -> None:
    with pytest.raises(RecordingError, match="an offset cannot be learned without pressure_2_pa among the inputs; got"):
        fit_offset_tracker(offset_recordings, cylinder, ("pressure_1_pa", "position_m"))
    bare = [offset_recordings[0].zeroed()]
    with pytest.raises(RecordingError, match="no zeros were identified; correct its offset first"):
        fit_offset_tracker(bare, cylinder, SAMPLE_COLUMNS)
    session = offset_recordings[0].metadata.session
    one_session = [each for each in offset_recordings if each.metadata.session == session]
    with pytest.raises(
        RecordingError, match=f"at least 2 of them, but got '{session}' alone; give recordings of another"
    ):
        fit_offset_tracker(one_session, cylinder, SAMPLE_COLUMNS)
    assert not zeros_are_known(one_session)


def test_zeros_as_uncertain_as_stated_are_not_known(offset_recordings: list[Recording]) -> None:
    vague = []
    for recording in offset_recordings:
        zeros = {name: replace(zero, uncertainty=2900.0) for name, zero in recording.metadata.identified_zero.items()}
        vague.append(replace(recording, metadata=replace(recording.metadata, identified_zero=zeros)))
    assert zeros_are_known(offset_recordings)
    assert not zeros_are_known(vague)
    assert not zeros_are_known([*offset_recordings, offset_recordings[0].zeroed()])


def test_a_fault_is_no_offset(tracker: OffsetTracker, offset_recordings: list[Recording]) -> None:
    """A pressure that reads 10 bar too much is far beyond what was stated: nothing is learned from it."""
    recording = offset_recordings[-1]
    faulty = recording.with_columns(pressure_1_pa=recording.column("pressure_1_pa") + 1e6)
    state = tracker.new_state()
    found = tracker.rows(faulty.samples(), causal_velocity(faulty), PLACE, state)
    assert set(found[:, 0]) == {0.0}
    assert state[EXTENDED] * state[RETRACTED] == 0.0

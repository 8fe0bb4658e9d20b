"""A load that the position of another cylinder decides too: found where strokes were, unknown elsewhere."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import TypeAdapter

from boom import boom_points, load_at_angle
from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import Labeller, label, position_load
from cylinder_friction.labelling.load import LoadIdentification, LoadPlan, identify_load
from cylinder_friction.labelling.pooled_load import pooled_load
from cylinder_friction.recordings.columns import OTHER_POSITIONS
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.signals.smooth_signals import filtered
from cylinder_friction.signals.zero_phase import default_filter

OTHER = OTHER_POSITIONS[:1]
CRANE = Path(__file__).parents[2] / "../shared/data/crane/scope"


def standing(at_m: float, seed: int = 0) -> LoadIdentification:
    """Return the load found in a session in which the other cylinder stands still."""
    points = boom_points(seed, other_m=lambda time_s, position_m: np.full(len(time_s), at_m))
    return identify_load(points, LoadPlan(), OTHER)


def wandering(time_s: Array, position_m: Array) -> Array:
    return np.asarray(0.6 + 0.03 * np.sin(0.05 * time_s))


def following(time_s: Array, position_m: Array) -> Array:
    """Return a position that follows the piston, a little late."""
    return np.asarray(0.5 + 0.5 * (np.roll(position_m, 3) - 0.125))


@pytest.mark.parametrize("other_m", [wandering, following])
def test_load_and_friction_are_found_where_strokes_went(  # type: ignore[no-untyped-def]
    other_m, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    points = boom_points(other_m=other_m)
    found = identify_load(points, LoadPlan(), OTHER)
    places = np.column_stack([points.position_m, points.others_m])
    known = found.knows(places)
    assert known.mean() > 0.9
    error_n = found.load_n(places)[known] - load_at_angle(*places[known].T)
    assert np.abs(error_n).max() < 60.0
    assert np.sqrt(np.mean(error_n**2)) < 15.0
    assert found.coulomb_n == pytest.approx(400.0, rel=0.03)
    assert (found.other_order > 0) == (other_m is wandering)
    assert not found.knows(places + np.array([0.0, 0.1])).any()
    assert TypeAdapter(LoadIdentification).validate_json(json.dumps(asdict(found))) == found
    assert f", {OTHER[0]} from 0." in found.sentence(labelled_recordings[0], cylinder)


def test_sessions_together_know_what_each_of_them_knows() -> None:
    at_m = [0.40, 0.405, 0.55, 0.6]
    sessions = [standing(each, seed) for seed, each in enumerate(at_m)]
    pooled = pooled_load(sessions)
    along = np.linspace(0.07, 0.18, 40)
    for each in at_m:
        places = np.column_stack([along, np.full(40, each)])
        error_n = pooled.at(places) - load_at_angle(*places.T)
        assert np.abs(error_n).max() < 80.0  # within a place of the table in the other position
    between = np.column_stack([along, np.full(40, 0.48)])
    recording = as_recording(between)
    assert not pooled.knows(recording).any()
    assert pooled.knows(as_recording(np.column_stack([along, np.full(40, 0.402)]))).mean() > 0.9
    assert pooled.known is not None
    assert "elsewhere it is not known" in pooled.in_words()


def as_recording(places: Array) -> Recording:
    columns = {"time_s": 0.01 * np.arange(len(places)), "pressure_1_pa": 1e5, "pressure_2_pa": 1e5}
    table = pd.DataFrame(columns | {"position_m": places[:, 0], OTHER[0]: places[:, 1]})
    return Recording(RecordingMetadata("made", "1", "1", 0.01), table)


def test_strokes_that_never_meet_are_refused() -> None:
    def apart(time_s: Array, position_m: Array) -> Array:
        return np.where(np.gradient(position_m) > 0.0, 0.4, 0.5)

    with pytest.raises(RecordingError, match="nowhere did strokes of both directions pass with the other pos"):
        identify_load(boom_points(other_m=apart), LoadPlan(), OTHER)


def test_the_mass_is_not_identified_beside_it(labelled_recordings: list[Recording], cylinder: Cylinder) -> None:
    recording = labelled_recordings[0].with_columns(**{OTHER[0]: np.full(len(labelled_recordings[0]), 0.5)})
    with pytest.raises(RecordingError, match="moving mass cannot be identified beside a load of several positions"):
        label([recording], cylinder, load="position", inertia="identified")


def test_labels_take_it_off(labelled_recordings: list[Recording], cylinder: Cylinder) -> None:
    loaded = []
    for number, recording in enumerate(labelled_recordings[:3]):
        other_m = np.full(len(recording), 0.45 + 0.004 * number)
        load_n = load_at_angle(recording.column("position_m"), other_m) / 4.0
        raw = recording.without_columns("velocity_m_s", "acceleration_m_s2", "friction_n", "usable")
        pressure_pa = raw.column("pressure_1_pa") + load_n / cylinder.piston_area_m2
        loaded.append(raw.with_columns(pressure_1_pa=pressure_pa, **{OTHER[0]: other_m}))
    common = position_load(loaded[:2], cylinder)
    assert common.columns == ("position_m", OTHER[0])
    for load in ("position", common):
        for labelled, true in zip(label(loaded, cylinder, load=load), labelled_recordings, strict=False):
            usable = labelled.usable()
            error_n = (labelled.column("friction_n") - true.column("friction_n"))[usable]
            assert usable.mean() > 0.3
            assert np.abs(np.mean(error_n)) < 50.0
            assert np.std(error_n) < 40.0


@pytest.mark.extended
def test_the_load_of_a_crane_holds_for_recordings_that_it_was_not_identified_on() -> None:
    """Each recording beside all others: where these know the load, it is right within its uncertainty (k = 2)."""
    if not CRANE.is_dir():
        pytest.skip("the recordings of a crane are not there")
    cylinder = Cylinder(name="jib", bore_diameter_m=0.15, rod_diameter_m=0.1, stroke_m=0.85, moving_mass_kg=60.0)
    channels = {
        "time_s": {"channel": "Name", "unit": "ms"},
        "pressure_1_pa": {"channel": "JibPaCyl", "unit": "bar"},
        "pressure_2_pa": {"channel": "JibPbCyl", "unit": "bar"},
        "position_m": {"channel": "JibPistonPosition", "unit": "m"},
        OTHER[0]: {"channel": "MainPistonPosition", "unit": "m"},
    }
    march = channels | {"time_s": {"channel": "time", "unit": "ms"}}
    recordings, smoothing = [], default_filter(cylinder)
    for name in ("Dual1*", "Dual2*", "JibSine*", "Ramp*", "JibSTD*"):
        recordings += read_recordings((CRANE / name).as_posix(), march if "STD" in name else channels, cylinder)
    assert len(recordings) == 7
    labeller, recordings = Labeller(cylinder, load="position"), [filtered(each, smoothing) for each in recordings]
    loads = {}
    for recording in recordings:
        identified = labeller.identify([recording], smoothing)
        assert identified.load is not None
        loads[recording.name] = identified.load
    shares = []
    for recording in recordings:
        own = loads[recording.name]
        others = pooled_load([each for name, each in loads.items() if name != recording.name])
        rows = recording.samples(others.columns)
        known = others.knows(recording) & own.knows(rows)
        if known.mean() < 0.05:
            continue
        stated_n = replace(others, load_n=others.uncertainty_n).of(recording)[known]
        error_n = (others.of(recording) - own.load_n(rows))[known]
        rms_n = float(np.sqrt(np.mean(error_n**2)))
        assert rms_n < 2.0 * np.sqrt(np.mean(stated_n**2))
        shares.append(rms_n / own.coulomb_n)
    assert len(shares) == 4  # to the others, no load is known to a fifth of friction
    assert max(shares) < 0.2

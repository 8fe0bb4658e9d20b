from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from boom import STEP_S, boom_load, motion
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller, label, position_load, usable_rows
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata, SensorUncertainty
from cylinder_friction.signals.smooth_signals import Support, smooth_columns
from cylinder_friction.signals.zero_phase import SavitzkyGolay

FILTER = SavitzkyGolay()
COULOMB_N, VISCOUS_N_S_M = 300.0, 1500.0


def true_friction(velocity: np.ndarray) -> np.ndarray:
    return COULOMB_N * np.sign(velocity) + VISCOUS_N_S_M * velocity


def boom_recording(cylinder: Cylinder, pressures: bool = True, uncertainty: Any = None, **columns: Any) -> Recording:
    """Return a filtered recording of a cylinder that carries a boom, by its pressures or by its drive force."""
    position_m, velocity, acceleration = motion()
    force_n = boom_load(position_m) + true_friction(velocity) + cylinder.moving_mass_kg * acceleration
    table = {"time_s": STEP_S * np.arange(len(position_m)), "position_m": position_m, **columns}
    if pressures:
        table["pressure_2_pa"] = np.full(len(position_m), 8e5)
        table["pressure_1_pa"] = (force_n + 8e5 * cylinder.annulus_area_m2) / cylinder.piston_area_m2
    else:
        table["drive_force_n"] = force_n
    metadata = RecordingMetadata("boom", "1", "s1", STEP_S, cylinder.name, uncertainty=uncertainty or {})
    recording = Recording(metadata, pd.DataFrame(table))
    return recording.with_columns(**smooth_columns(recording, FILTER))


def session(labeller: Labeller, recording: Recording) -> SessionIdentification:
    return labeller.identify([recording], FILTER)


def worst_error(labelled: Recording) -> float:
    """Return the mean error of friction away from reversals, of usable rows [N]."""
    velocity = motion()[1]
    rows = labelled.usable() & (np.abs(velocity) > 5e-3)
    return float(np.abs(labelled.column("friction_n") - true_friction(velocity))[rows].mean())


@pytest.mark.parametrize("pressures", [True, False], ids=["pressures", "drive force"])
def test_friction_comes_out_of_a_cylinder_that_carries_something(cylinder: Cylinder, pressures: bool) -> None:
    labeller = Labeller(cylinder, Stiffness(), 0.003, load="position")
    recording = boom_recording(cylinder, pressures)
    found = session(labeller, recording)
    labelled = labeller.label(recording, FILTER, found)
    assert worst_error(labelled) < 5.0
    assert labelled.usable().mean() > 0.8
    assert np.abs(labelled.column("load_force_n") - boom_load(motion()[0]))[labelled.usable()].max() < 20.0
    assert "friction_uncertainty_n" not in labelled.table.columns
    assert found.load is not None
    unknown = recording.column("position_m") < found.load.range_m[0]
    assert unknown.any()
    assert not labelled.usable()[unknown].any(), "the load is not known there"
    measured = boom_recording(cylinder, pressures, load_force_n=boom_load(motion()[0]))
    assert worst_error(Labeller(cylinder, Stiffness(), 0.003, load="measured").label(measured, FILTER)) < 1.0


def test_uncertainty_of_an_identified_load_goes_into_the_labels(cylinder: Cylinder) -> None:
    labeller = Labeller(cylinder, Stiffness(), 0.003, load="position")
    stated = {"pressure_1_pa": SensorUncertainty(1e3, 0.0), "pressure_2_pa": SensorUncertainty(1e3, 0.0)}
    recording = boom_recording(cylinder, uncertainty=stated)
    found = session(labeller, recording)
    assert found.load is not None
    labelled = labeller.label(recording, FILTER, found)
    expanded = labelled.column("friction_uncertainty_n")
    assert (expanded > 2.0 * found.load.asymmetry_n).all()
    assert expanded.max() < 2.0 * np.hypot(found.load.uncertainty_n(recording.column("position_m")).max(), 10.0)


LOADED = {"load_force_n": boom_load(motion()[0])}


@pytest.mark.parametrize(
    ("mode", "how", "recorded", "message"),
    [
        ("none", {}, LOADED, r"recording 'boom': load \(ingest\.load\) is none, but a load was measured"),
        ("none", {"load": "position"}, LOADED, r"load \(ingest\.load\) is position, but a load was measured"),
        ("none", {"load": "measured"}, {}, r"is measured, but there is no column 'load_force_n'; map the"),
        ("none", {"load": "position"}, {}, r"expected load and mass of its session .* but got None"),
        ("none", {"load": "gravity"}, {}, "load must be one of none, measured, position, but got 'gravity'"),
        ("none", {"inertia": "guessed"}, {}, "inertia must be one of given, identified, but got 'guessed'"),
        ("trapped_oil", {}, {"pressures": False}, "label.stiffness is trapped_oil, .* has drive_force_n"),
    ],
)
def test_what_cannot_be_labelled_is_refused(
    cylinder: Cylinder, mode: Any, how: dict[str, Any], recorded: dict[str, Any], message: str
) -> None:
    recording = boom_recording(cylinder, **recorded)
    with pytest.raises(ValueError, match=message):
        Labeller(cylinder, Stiffness(mode), 0.003, **how).label(recording, FILTER)


def test_end_stops_are_masked_as_far_as_the_filter_saw_them() -> None:
    """Row t looks at t - 30 to t + 20, so that it saw row 200 from 180 to 230."""
    expected = np.ones(400, dtype=bool)
    expected[:30] = expected[380:] = expected[180:231] = False
    for at_end_m in (0.002, 0.248):
        position_m = np.full(400, 0.1)
        position_m[200] = at_end_m
        np.testing.assert_array_equal(usable_rows(position_m, 0.25, 0.003, Support(before=30, after=20)), expected)
    assert not usable_rows(np.full(10, 0.1), 0.25, 0.003, Support(30, 30)).any(), "shorter than the filter"


def test_an_identified_mass_is_used(cylinder: Cylinder) -> None:
    heavy = replace(cylinder, moving_mass_kg=2000.0)
    recording = boom_recording(heavy, load_force_n=boom_load(motion()[0]))
    labeller = Labeller(cylinder, Stiffness(), 0.003, load="measured", inertia="identified")
    given = SessionIdentification(cylinder.moving_mass_kg)
    found = replace(given, moving_mass_kg=2000.0)
    assert worst_error(labeller.label(recording, FILTER, found)) < 1.0
    assert worst_error(labeller.label(recording, FILTER, given)) > 5.0


RAW = ["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]


def test_recordings_in_memory_share_the_load_of_their_session(cylinder: Cylinder) -> None:
    filtered = boom_recording(cylinder)
    raw = Recording(filtered.metadata, filtered.table[RAW])
    (labelled,) = label([raw], cylinder, load="position")
    assert worst_error(labelled) < 5.0
    known = position_load([raw], cylinder).at(labelled.column("position_m"))
    assert np.abs(known - labelled.column("load_force_n"))[labelled.usable()].max() < 1.0
    (common,) = label([raw], cylinder, load=position_load([raw], cylinder))
    usable = common.usable()
    assert worst_error(common) < 5.0
    np.testing.assert_allclose(common.column("load_force_n")[usable], known[usable])
    with pytest.raises(RecordingError, match="session 's1': load and friction cannot be separated"):
        label([raw.with_columns(position_m=np.full(len(raw), 0.1))], cylinder, load="position")
    with pytest.raises(ValueError, match="label: expected at least one recording, but got none"):
        label([], cylinder)

"""Stage ``offset``: identified where it can be, left alone where it must be; nothing of other sessions in training."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import hash_of, read_json, write_json
from cylinder_friction.labelling.load import LoadIdentification
from cylinder_friction.labelling.strokes import BINS, Covered
from cylinder_friction.recordings.recording import Recording, RecordingError, SensorUncertainty
from cylinder_friction.recordings.storage import read_stored, write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages import offset
from cylinder_friction.stages._stage import (
    ESTIMATORS_FILE,
    IDENTIFIED_FILE,
    INGESTED_FILE,
    LABELLED_FOLDER,
    OFFSET_FILE,
    PROCESSED_FOLDERS,
    SPLIT_FILE,
)
from shipped_params import shipped

STATED = {name: SensorUncertainty(3000.0, 0.0, zeroed=True) for name in ("pressure_1_pa", "pressure_2_pa")}
OFFSET_N = 12.0


@pytest.fixture
def workplace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> Path:
    """Five sessions for training, of which every other one has an offset, and one for each other role."""
    monkeypatch.chdir(tmp_path)
    names = [recording.name for recording in labelled_recordings]
    write_json(INGESTED_FILE, {"load": "none", "oil_temperature": "recorded", "other_positions": []})
    write_json(SPLIT_FILE, {"train": names[:5], "validation": names[5:6], "calibration": names[6:7], "test": names[7:]})
    for number, recording in enumerate(labelled_recordings):
        shift = OFFSET_N * (number % 2)
        written = recording.with_columns(
            pressure_1_pa=recording.column("pressure_1_pa") + shift / cylinder.piston_area_m2,
            friction_n=recording.column("friction_n") + shift,
            friction_uncertainty_n=np.full(len(recording), 26.0),
        )
        write_recording(LABELLED_FOLDER, replace(written, metadata=replace(recording.metadata, uncertainty=STATED)))
    return tmp_path


def run(load: str = "none", identify: str = "auto", *, common_load: bool = False, oil: str = "recorded") -> RunRecord:
    write_json(INGESTED_FILE, {"load": load, "oil_temperature": oil, "other_positions": []})
    return offset.run(shipped(offset={"identify": identify, "common_load": common_load}))


def change(role: str, **metadata: Any) -> None:
    for name in read_json(SPLIT_FILE)[role]:
        (recording,) = [each for each in read_stored(LABELLED_FOLDER) if each.name == name]
        write_recording(LABELLED_FOLDER, replace(recording, metadata=replace(recording.metadata, **metadata)))


def test_offsets_leave_the_labels_and_pressures_stay_as_measured(workplace: Path) -> None:
    run(identify="always")
    measured = {each.name: each for each in read_stored(LABELLED_FOLDER)}
    found = {each["session"]: each for each in read_json(OFFSET_FILE)["sessions"]}
    assert read_json(OFFSET_FILE)["left_alone_because"] == ""
    difference_n = []
    for role, folder in PROCESSED_FOLDERS.items():
        for recording in read_stored(folder):
            before, own = measured[recording.name], found[recording.metadata.session]
            assert own["role"] == role
            assert recording.samples().tolist() == before.samples().tolist()
            taken_n = before.column("friction_n") - recording.column("friction_n")
            np.testing.assert_allclose(taken_n, own["offset_n"], atol=1e-9)
            difference_n.append(own["offset_n"])
    # sessions with and without an offset alternate; their mean is not determined
    assert np.mean(difference_n[1::2]) - np.mean(difference_n[::2]) == pytest.approx(OFFSET_N, abs=4.0)
    assert read_json(ESTIMATORS_FILE)["offset_tracker"]["prior"][0] == pytest.approx(11.99, abs=0.01)
    train = hash_of(PROCESSED_FOLDERS["train"])
    for recording in read_stored(LABELLED_FOLDER)[5:]:
        write_recording(LABELLED_FOLDER, recording.with_columns(friction_n=2.0 * recording.column("friction_n")))
    run(identify="always")
    assert hash_of(PROCESSED_FOLDERS["train"]) == train, "other sessions change nothing in training"


FEW = (
    "offsets are not identified: strokes in both directions narrow it no further, as friction of each session may "
    "be asymmetric in its own way; give at least 12 sessions of the cylinder together"
)


@pytest.mark.parametrize(
    ("stated", "given", "reason"),
    [
        (STATED, ("none", "auto"), FEW),
        ({}, ("none", "auto"), "the uncertainty of the sensors' zeros is not stated"),
        (STATED, ("none", "never"), "offset.identify is never"),
        (STATED, ("position", "auto"), "has absorbed the sensors' offset"),
    ],
)
def test_offsets_are_left_alone_and_the_reason_is_kept(
    workplace: Path, stated: dict[str, SensorUncertainty], given: tuple[str, str], reason: str
) -> None:
    change("train", uncertainty=stated)
    write_loads(0.0)
    record = run(*given)
    content = read_json(OFFSET_FILE)
    assert content["sessions"] == []
    assert reason in content["left_alone_because"]
    assert record.tags["offsets"] == content["left_alone_because"]
    assert read_json(ESTIMATORS_FILE)["offset_tracker"] is None
    assert not any(each.metadata.identified_zero for each in read_stored(PROCESSED_FOLDERS["train"]))


@pytest.mark.extended
def test_beside_a_measured_load_the_load_cell_has_its_part_of_the_offset(workplace: Path) -> None:
    for recording in read_stored(LABELLED_FOLDER):
        write_recording(LABELLED_FOLDER, recording.with_columns(load_force_n=np.zeros(len(recording))))
    assert "the uncertainty of the sensors' zeros is not stated" in run("measured").tags["offsets"]
    assert read_json(ESTIMATORS_FILE)["offset_tracker"] is None
    for role in PROCESSED_FOLDERS:
        change(role, uncertainty={**STATED, "load_force_n": SensorUncertainty(5.0, 0.0, zeroed=True)})
    assert run("measured", "always").tags["offsets"] == "identified"
    given, sessions = read_json(ESTIMATORS_FILE), read_json(OFFSET_FILE)["sessions"]
    assert given["inputs"] == ["pressure_1_pa", "pressure_2_pa", "position_m", "load_force_n"]
    assert given["offset_tracker"]["weights"][0][3] == pytest.approx(-1.0, abs=0.05)
    tested = read_stored(PROCESSED_FOLDERS["test"])[0].metadata
    (found,) = (each for each in sessions if each["session"] == tested.session)
    assert found["prior_n"] == pytest.approx(np.hypot(11.99, 5.0), abs=0.01)
    assert set(tested.identified_zero) == {"pressure_1_pa", "pressure_2_pa", "load_force_n"}
    cell_n = tested.identified_zero["load_force_n"].offset
    assert cell_n == pytest.approx(-found["offset_n"] * 25.0 / found["prior_n"] ** 2)


def write_loads(spread_n: float) -> None:
    """Write what stage ``label`` would of loads by position: 300 N in the first session, more in each further one."""
    names = sorted({each.metadata.session for each in read_stored(LABELLED_FOLDER)})
    covered, interval = Covered((0.02, 0.2), 1.0, (), (), tuple(range(BINS))), (0.0, 0.0)
    load = LoadIdentification((0.0,), (0.02, 0.2), covered, (3.0,) * 51, 4.0, 4.0, interval, interval, 9, 9)
    loads = {name: replace(load, coefficients_n=(300.0 + spread_n * at,)) for at, name in enumerate(names)}
    write_json(IDENTIFIED_FILE, {name: {"load": asdict(each)} for name, each in loads.items()})


@pytest.mark.extended
def test_with_a_common_load_the_offset_of_each_session_is_identified_beside_it(
    workplace: Path, cylinder: Cylinder
) -> None:
    write_loads(1.0)
    loads = read_json(IDENTIFIED_FILE)
    for each in read_stored(LABELLED_FOLDER):
        own_n = np.full(len(each), loads[each.metadata.session]["load"]["coefficients_n"][0])
        pressure_pa = each.column("pressure_1_pa") + 302.0 / cylinder.piston_area_m2
        # the session's own load has absorbed its sensors' offset, too much or too little of it
        friction_n = each.column("friction_n") + 302.0 - own_n
        write_recording(
            LABELLED_FOLDER, each.with_columns(load_force_n=own_n, pressure_1_pa=pressure_pa, friction_n=friction_n)
        )
    run("position", "always", common_load=True)
    found = {each["session"]: each["offset_n"] for each in read_json(OFFSET_FILE)["sessions"]}
    values = [found[name] for name in sorted(found)]
    assert np.mean(values[1::2]) - np.mean(values[::2]) == pytest.approx(OFFSET_N, abs=4.0)
    given = read_json(ESTIMATORS_FILE)
    assert len(given["offset_tracker"]["weights"][0]) == 4
    (recording, *_) = read_stored(PROCESSED_FOLDERS["train"])
    inside = (recording.column("position_m") >= 0.02) & (recording.column("position_m") <= 0.2)
    assert recording.column("load_force_n")[inside] == pytest.approx(302.0)
    assert not recording.usable()[~inside].any()


def test_sessions_of_different_loads_have_no_common_one(workplace: Path) -> None:
    write_loads(10.0)
    with pytest.raises(
        RecordingError,
        match=r"sessions carry different loads: that of test1-1 is 20 N from the mean of the training sessions, known "
        r"to 5 N; expected at most 2 times that; set offset\.common_load to false",
    ):
        run("position", common_load=True)


def test_estimators_are_given_the_mean_load_of_the_training_sessions(workplace: Path) -> None:
    write_loads(10.0)
    run("position", oil="input")
    given = read_json(ESTIMATORS_FILE)
    assert given["inputs"] == ["pressure_1_pa", "pressure_2_pa", "position_m", "oil_temperature_c"]
    assert given["position_load"]["range_m"] == [0.02, 0.2]
    # the five sessions of training: 300 to 340 N, 15.8 N standard deviation; each is known to 5 N
    np.testing.assert_allclose(given["position_load"]["load_n"], 320.0)
    np.testing.assert_allclose(given["position_load"]["standard_uncertainty_n"], np.sqrt(250.0 + 25.0))


def test_what_is_to_be_identified_in_any_case_and_cannot_be_is_refused(workplace: Path) -> None:
    change("train", uncertainty={})
    with pytest.raises(RecordingError, match="the uncertainty of the zero of 'pressure_1_pa' is not stated"):
        run(identify="always")


def test_a_role_without_sessions_has_a_folder_that_is_not_empty(workplace: Path) -> None:
    write_json(SPLIT_FILE, {**read_json(SPLIT_FILE), "calibration": []})
    run(identify="never")
    (note,) = PROCESSED_FOLDERS["calibration"].iterdir()
    assert note.read_text(encoding="utf-8") == "No session has the role calibration.\n", "DVC warns of an empty folder"
    assert read_stored(PROCESSED_FOLDERS["calibration"]) == []


def test_a_recording_without_usable_rows_goes_no_further(workplace: Path) -> None:
    name = read_json(SPLIT_FILE)["train"][0]
    (recording,) = [each for each in read_stored(LABELLED_FOLDER) if each.name == name]
    write_recording(LABELLED_FOLDER, recording.with_columns(usable=np.zeros(len(recording), dtype=np.bool_)))
    run(identify="never")
    assert name not in [each.name for each in read_stored(PROCESSED_FOLDERS["train"])]
    assert len(read_stored(PROCESSED_FOLDERS["train"])) == 4

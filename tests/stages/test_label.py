from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.execution.workers import Workers
from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.params.checking import Params
from cylinder_friction.params.data import CylinderParams, FilterParams, LabelParams
from cylinder_friction.recordings.files import read_json, write_json
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import (
    read_metadata,
    read_recording,
    read_recordings,
    recording_paths,
    write_recording,
)
from cylinder_friction.signals.zero_phase import SavitzkyGolay
from cylinder_friction.stages import filter as filter_stage
from cylinder_friction.stages import label
from cylinder_friction.stages._stage import (
    AUDIT_FOLDER,
    INGESTED_FILE,
    LABELLED_FOLDER,
    RECORDINGS_FOLDER,
    RIG_TRUTH_FOLDER,
    SIGNALS_FOLDER,
)

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder

CONF = Path(__file__).parents[2] / "conf"
RAW = ["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]
TRUTH = ["time_s", "friction_n", "velocity_m_s"]


def params_for(cylinder: Cylinder, **label_changes: Any) -> Params:
    content = {
        "filter": yaml.safe_load((CONF / "filter/adaptive.yaml").read_text(encoding="utf-8")),
        "label": yaml.safe_load((CONF / "label/default.yaml").read_text(encoding="utf-8")) | label_changes,
    }
    return Params.model_construct(
        cylinder=CylinderParams(**cylinder.__dict__),
        filter=FilterParams.model_validate(content["filter"]),
        label=LabelParams.model_validate(content["label"]),
    )


@pytest.fixture
def made(labelled_recordings: list[Recording]) -> list[Recording]:
    """Three sessions of Test 1 and three of Test 2."""
    chosen = labelled_recordings[:3] + labelled_recordings[3:6]
    sessions = [("1", "1-a"), ("1", "1-b"), ("1", "1-c"), ("2", "2-a"), ("2", "2-b"), ("2", "2-c")]
    result = []
    for recording, (condition, session) in zip(chosen, sessions, strict=True):
        details = recording.metadata.to_dict() | {"name": f"r{session}", "condition": condition, "session": session}
        result.append(Recording(recording.metadata.from_dict(details), recording.table))
    return result


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cylinder: Cylinder, made: list[Recording]) -> Path:
    monkeypatch.chdir(tmp_path)
    RIG_TRUTH_FOLDER.mkdir(parents=True)
    for recording in made:
        write_recording(RECORDINGS_FOLDER, Recording(recording.metadata, recording.table[RAW]))
        recording.table[TRUTH].to_parquet(RIG_TRUTH_FOLDER / f"{recording.name}.parquet")
    write_json(INGESTED_FILE, {"source": "data/raw/rig", "truth": RIG_TRUTH_FOLDER.as_posix(), "load": "none"})
    filter_stage.run(params_for(cylinder))
    return tmp_path


def test_labels_are_near_friction(workplace: Path, cylinder: Cylinder, made: list[Recording]) -> None:
    record = label.run(params_for(cylinder))
    by_name = {recording.name: recording for recording in made}
    recordings = read_recordings(LABELLED_FOLDER)
    assert sorted(recording.name for recording in recordings) == sorted(by_name)
    assert record.metrics["recordings"] == len(recordings) == 6
    for recording in recordings:
        true_n = by_name[recording.name].column("friction_n")
        usable = recording.usable()
        assert not usable[:40].any()
        assert usable[40:-40].all()
        assert np.abs(recording.column("friction_n") - true_n)[usable].mean() < 0.05 * np.abs(true_n).mean()
        assert set(recording.table.columns) - set(RAW) == {"velocity_m_s", "friction_n", "usable"}
    assert record == label.run(params_for(cylinder))


def test_two_recordings_are_labelled_without_any_split(workplace: Path, cylinder: Cylinder) -> None:
    for path in recording_paths(SIGNALS_FOLDER)[2:]:
        path.unlink()
    assert label.run(params_for(cylinder)).metrics["recordings"] == 2.0


def test_audit_judges_every_filter_in_every_test(workplace: Path, cylinder: Cylinder) -> None:
    record = label.run(params_for(cylinder))
    audit = read_json(AUDIT_FOLDER / "audit.json")
    assert set(audit) == {"adaptive", "moving_average", "moving_average_centred", "savitzky_golay", "rts"}
    for conditions in audit.values():
        assert set(conditions) == {"1", "2", "all"}
        assert {"all", "steady", "events", "reversal"} <= set(conditions["1"])
        assert set(conditions["1"]["steady"]) == {"rows", "mae_n", "max_n", "bias_n", "mean_friction_n", "mae_percent"}
    # The causal chain is late, which shows where friction changes fast.
    late, in_time = (audit[name]["all"]["events"]["mae_n"] for name in ("moving_average", "savitzky_golay"))
    assert late > 2.0 * in_time
    rows = {audit[name]["all"]["all"]["rows"] for name in audit}
    assert len(rows) == 1
    table = pd.read_csv(AUDIT_FOLDER / "audit.csv")
    (line,) = table[(table["filter"] == "rts") & (table["condition"] == "2") & (table["stratum"] == "steady")].to_dict(
        "records"
    )
    assert line["mae_n"] == audit["rts"]["2"]["steady"]["mae_n"]
    assert record.metrics["label_mae_n/steady"] == audit[params_for(cylinder).filter.method]["all"]["steady"]["mae_n"]
    assert record.metrics["audited_recordings"] == 6.0


def test_labels_do_not_depend_on_the_truth(workplace: Path, cylinder: Cylinder) -> None:
    before = label.run(params_for(cylinder)).datasets
    for path in RIG_TRUTH_FOLDER.iterdir():
        path.unlink()
    record = label.run(params_for(cylinder))
    assert record.datasets == before
    assert read_json(AUDIT_FOLDER / "audit.json") == {"note": label.NO_TRUTH}
    assert record.metrics["audited_recordings"] == 0.0
    assert len((AUDIT_FOLDER / "audit.csv").read_text().splitlines()) == 1


def test_end_stop_margin_is_kept(workplace: Path, cylinder: Cylinder) -> None:
    label.run(params_for(cylinder, end_stop_margin_m=0.10))
    for recording in read_recordings(LABELLED_FOLDER):
        usable = recording.usable()
        assert np.abs(recording.column("position_m")[usable] - 0.125).max() < 0.025
        assert 0 < usable.sum() < 0.5 * len(usable)


def test_paper_literal_label_is_absurd(workplace: Path, cylinder: Cylinder) -> None:
    label.run(params_for(cylinder, stiffness="paper_literal"))
    for recording in read_recordings(LABELLED_FOLDER):
        assert np.abs(recording.column("friction_n")).mean() > 1e6


def test_nothing_is_identified_unless_it_is_asked(workplace: Path, cylinder: Cylinder) -> None:
    record = label.run(params_for(cylinder))
    assert read_json(label.IDENTIFIED_FILE) == {"note": label.NOTHING_IDENTIFIED}
    assert label.IDENTIFIED_FILE.as_posix() in record.artifacts


def test_load_and_mass_are_identified_session_by_session(workplace: Path, cylinder: Cylinder) -> None:
    """No load here: what is identified is flat, but for the asymmetry that goes into it."""
    labeller = Labeller(cylinder, Stiffness(), 0.003, load="position", inertia="identified")
    used = SavitzkyGolay()
    metadata = [read_metadata(path) for path in recording_paths(SIGNALS_FOLDER)]
    found = label.identify_sessions(metadata, labeller, used, Workers())
    assert sorted(found) == ["1-a", "1-b", "1-c", "2-a", "2-b", "2-c"]
    label.write_identified(found)
    before = label.IDENTIFIED_FILE.read_bytes()
    for session, content in read_json(label.IDENTIFIED_FILE).items():
        low, high = content["load"]["load_range_n"]
        assert max(abs(low), abs(high)) < 0.1 * content["load"]["coulomb_n"], session
        # Six kilograms beside 280 N of friction are beyond such motion: the given mass stays.
        assert content["motion"]["mass_known"] is False
        assert content["moving_mass_kg"] == cylinder.moving_mass_kg
    metrics = label.write_labelled(metadata[:1], labeller, used, found, Workers())
    (labelled,) = read_recordings(LABELLED_FOLDER)
    assert metrics["usable_rows"] == labelled.usable().sum() > 0.7 * len(labelled)
    assert {"load_force_n", "friction_n"} <= set(labelled.table.columns)
    label.write_identified(label.identify_sessions(metadata, labeller, used, Workers()))
    assert label.IDENTIFIED_FILE.read_bytes() == before


def test_a_session_that_does_not_tell_its_load_is_named(workplace: Path, cylinder: Cylinder) -> None:
    path = recording_paths(SIGNALS_FOLDER)[0]
    recording = read_recording(path)
    one_way = recording.with_columns(velocity_m_s=np.abs(recording.column("velocity_m_s")))
    write_recording(SIGNALS_FOLDER, one_way)
    labeller = Labeller(cylinder, Stiffness(), 0.003, load="position")
    metadata = [read_metadata(each) for each in recording_paths(SIGNALS_FOLDER)]
    problem = "load and friction cannot be separated"
    with pytest.raises(RecordingError, match=f"session '{recording.metadata.session}': {problem}"):
        label.identify_sessions(metadata, labeller, SavitzkyGolay(), Workers())


def test_truth_of_another_campaign_is_refused(workplace: Path, cylinder: Cylinder, made: list[Recording]) -> None:
    made[0].table[TRUTH].iloc[:-5].to_parquet(RIG_TRUTH_FOLDER / f"{made[0].name}.parquet")
    with pytest.raises(RecordingError, match="has 3995 rows, but recording 'r1-a' has 4000"):
        label.run(params_for(cylinder))

"""Stage ``label``: labels near friction, load and mass session by session, and the audit of every filter."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import hash_of, read_json, write_json
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_recording, read_stored, recording_paths, write_recording
from cylinder_friction.run_record import RunRecord
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
from shipped_params import shipped

RAW = ["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]
TRUTH = ["time_s", "friction_n", "velocity_m_s"]


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording]) -> list[Recording]:
    """Three sessions of each of two conditions, filtered, and their truth."""
    monkeypatch.chdir(tmp_path)
    result = []
    for recording, session in zip(labelled_recordings, ("1-a", "1-b", "1-c", "2-a", "2-b", "2-c"), strict=False):
        metadata = replace(recording.metadata, name=f"r{session}", condition=session[0], session=session)
        result.append(Recording(metadata, recording.table))
        write_recording(RECORDINGS_FOLDER, Recording(metadata, recording.table[RAW]))
        RIG_TRUTH_FOLDER.mkdir(parents=True, exist_ok=True)
        recording.table[TRUTH].to_parquet(RIG_TRUTH_FOLDER / f"{metadata.name}.parquet")
    filter_stage.run(shipped())
    return result


def run(load: str = "none", **changes: Any) -> RunRecord:
    write_json(INGESTED_FILE, {"source": "data/raw/rig", "truth": RIG_TRUTH_FOLDER.as_posix(), "load": load})
    return label.run(shipped(label=changes))


def test_labels_are_near_friction_and_know_no_truth(made: list[Recording]) -> None:
    record = run()
    assert record.metrics["recordings"] == len(made) == 6
    assert record.metrics["audited_recordings"] == 6.0
    for recording, original in zip(read_stored(LABELLED_FOLDER), made, strict=True):
        true_n, usable = original.column("friction_n"), recording.usable()
        assert recording.name == original.name
        assert not usable[:40].any()
        assert usable[40:-40].all()
        assert np.abs(recording.column("friction_n") - true_n)[usable].mean() < 0.05 * np.abs(true_n).mean()
        assert set(recording.table.columns) - set(RAW) == {"velocity_m_s", "friction_n", "usable"}
    assert read_json(label.IDENTIFIED_FILE) == {"note": label.NOTHING_IDENTIFIED}
    for path in RIG_TRUTH_FOLDER.iterdir():
        path.unlink()
    labelled = hash_of(LABELLED_FOLDER)
    again = run()
    assert hash_of(LABELLED_FOLDER) == labelled
    assert read_json(AUDIT_FOLDER / "audit.json") == {"note": label.NO_TRUTH}
    assert again.metrics["audited_recordings"] == 0.0
    assert len((AUDIT_FOLDER / "audit.csv").read_text().splitlines()) == 1


def test_the_audit_compares_every_filter_in_every_condition(made: list[Recording]) -> None:
    record = run()
    audit = read_json(AUDIT_FOLDER / "audit.json")
    assert set(audit) == {"adaptive", "moving_average", "moving_average_centred", "savitzky_golay", "rts"}
    for conditions in audit.values():
        assert set(conditions) == {"1", "2", "all"}
        assert {"all", "steady", "events", "reversal"} <= set(conditions["1"])
        assert set(conditions["1"]["steady"]) == {"rows", "mae_n", "max_n", "bias_n", "mean_friction_n", "mae_percent"}
    # The causal chain is late, which shows where friction changes fast.
    late, in_time = (audit[name]["all"]["events"]["mae_n"] for name in ("moving_average", "savitzky_golay"))
    assert late > 2.0 * in_time
    assert len({conditions["all"]["all"]["rows"] for conditions in audit.values()}) == 1
    table = pd.read_csv(AUDIT_FOLDER / "audit.csv").set_index(["filter", "condition", "stratum"])
    assert table.loc[("rts", "2", "steady"), "mae_n"] == audit["rts"]["2"]["steady"]["mae_n"]
    assert record.metrics["label_mae_n/steady"] == audit["adaptive"]["all"]["steady"]["mae_n"]


def test_end_stop_margin_is_kept_and_a_literal_reading_of_the_paper_is_absurd(made: list[Recording]) -> None:
    run(end_stop_margin_m=0.10, stiffness="paper_literal")
    for recording in read_stored(LABELLED_FOLDER):
        usable = recording.usable()
        assert np.abs(recording.column("position_m")[usable] - 0.125).max() < 0.025
        assert 0 < usable.sum() < 0.5 * len(usable)
        assert np.abs(recording.column("friction_n")).mean() > 1e6


def test_load_and_mass_are_identified_session_by_session(made: list[Recording], cylinder: Cylinder) -> None:
    """No load here: what is identified is flat, but for the asymmetry that goes into it."""
    record = run("position", inertia="identified")
    identified = read_json(label.IDENTIFIED_FILE)
    assert sorted(identified) == ["1-a", "1-b", "1-c", "2-a", "2-b", "2-c"]
    for session, content in identified.items():
        low, high = content["load"]["load_range_n"]
        assert max(abs(low), abs(high)) < 0.1 * content["load"]["coulomb_n"], session
        # Six kilograms beside 280 N of friction are beyond such motion: the given mass stays.
        assert content["motion"]["mass_known"] is False
        assert content["moving_mass_kg"] == cylinder.moving_mass_kg
    labelled = read_stored(LABELLED_FOLDER)
    assert record.metrics["usable_rows"] == sum(each.usable().sum() for each in labelled) > 0.7 * record.metrics["rows"]
    assert all({"load_force_n", "friction_n"} <= set(each.table.columns) for each in labelled)


def test_a_session_that_does_not_determine_its_load_is_named(made: list[Recording]) -> None:
    recording = read_recording(recording_paths(SIGNALS_FOLDER)[0])
    one_way = recording.with_columns(velocity_m_s=np.abs(recording.column("velocity_m_s")))
    write_recording(SIGNALS_FOLDER, one_way)
    problem = "load and friction cannot be separated"
    with pytest.raises(RecordingError, match=f"session '{recording.metadata.session}': {problem}"):
        run("position")


def test_truth_of_another_campaign_is_refused_and_nothing_is_written(made: list[Recording]) -> None:
    made[0].table[TRUTH].iloc[:-5].to_parquet(RIG_TRUTH_FOLDER / f"{made[0].name}.parquet")
    with pytest.raises(RecordingError, match="has 3995 rows, but recording 'r1-a' has 4000"):
        run()
    assert not LABELLED_FOLDER.exists()

"""The golden set as it is stored, and how it is recorded."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import record_golden

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.testing.golden import (
    MODEL_FOLDER,
    ROWS,
    golden_samples,
    read_trajectories,
    trace,
    write_trajectory,
)
from golden_fixtures import GOLDEN

FOLDERS = (GOLDEN, GOLDEN / "learns_offset")


def test_it_is_small() -> None:
    for folder in FOLDERS:
        assert sum(path.stat().st_size for path in folder.glob("*.npz")) < 300_000
        assert sum(path.stat().st_size for path in (folder / "model").iterdir()) < 200_000


def test_every_flag_is_raised_somewhere() -> None:
    trajectories = [each for folder in FOLDERS for each in read_trajectories(folder).values()]
    raised = np.bitwise_or.reduce(np.concatenate([each.flags for each in trajectories]))
    assert raised == sum(Flag) - Flag.INVALID_OTHER, "the models have no other input"


def test_an_offset_is_learned_in_both_directions() -> None:
    flags = read_trajectories(GOLDEN / "learns_offset")["bad_samples"].flags
    unknown = np.flatnonzero(flags & Flag.OFFSET_UNKNOWN)
    assert 100 < len(unknown) < len(flags) / 2


def test_what_is_written_is_read(tmp_path: Path) -> None:
    model = load_estimator(GOLDEN / MODEL_FOLDER).step_model()
    samples = np.array([[np.nan, 1e6, 0.1], [1e6, 1e6, 0.1], [1e6, np.inf, 0.1]])
    trajectory = trace(model, samples)
    for folder in ("one", "other"):
        write_trajectory(tmp_path / folder, "made", trajectory)
    stored = read_trajectories(tmp_path / "one")["made"]
    np.testing.assert_array_equal(stored.samples, samples)
    np.testing.assert_array_equal(stored.newtons, trajectory.newtons)
    assert list(stored.flags) == list(trajectory.flags)
    assert (tmp_path / "one/made.npz").read_bytes() == (tmp_path / "other/made.npz").read_bytes()


def test_a_folder_without_trajectories_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"holds no golden trajectory \(\.npz\); write some with `write_traj"):
        read_trajectories(tmp_path)


def test_what_is_cut_from_recordings_is_what_is_recorded(
    tmp_path: Path, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recordings = [each for each in labelled_recordings if len(each) >= 2 * ROWS]
    for recording in recordings:
        write_recording(Path("data/processed/test"), recording)
    shutil.copytree(GOLDEN / MODEL_FOLDER, tmp_path / "golden" / MODEL_FOLDER)
    record_golden.record(tmp_path / "golden")
    recorded, cut = read_trajectories(tmp_path / "golden"), golden_samples(recordings)
    assert set(recorded) == set(read_trajectories(GOLDEN)) == set(cut)
    model = load_estimator(GOLDEN / MODEL_FOLDER).step_model()
    for name, samples in cut.items():
        np.testing.assert_array_equal(recorded[name].samples, samples)
        np.testing.assert_array_equal(recorded[name].newtons, trace(model, samples).newtons)

"""The golden set as it is stored, and the command that checks it."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.commands import cli
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories, trace, write_trajectory
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


def test_the_command_tells_a_changed_trajectory_from_a_kept_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(GOLDEN / "model", tmp_path / "model")
    shutil.copy(GOLDEN / "end_stop.npz", tmp_path)
    assert cli.main(["golden", "check", "--folder", str(tmp_path)]) == 0
    assert "end_stop: python differs by 0 N and in 0 flags" in capsys.readouterr().out
    kept = read_trajectories(tmp_path)["end_stop"]
    kept.newtons[7, 0] += 0.25
    kept.flags[9] |= Flag.OUTSIDE
    write_trajectory(tmp_path, "end_stop", kept)
    assert cli.main(["golden", "check", "--folder", str(tmp_path)]) == 1
    assert "end_stop: python differs by 0.25 N and in 1 flags" in capsys.readouterr().out

"""Stage ``split``: labelled recordings are linked by role; too few sessions are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from cylinder_friction.params.checking import Params
from cylinder_friction.params.data import SplitParams
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_metadata, recording_paths, write_recording
from cylinder_friction.stages import split
from cylinder_friction.stages._stage import LABELLED_FOLDER, PROCESSED_FOLDERS

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording]) -> Path:
    """Three labelled sessions in each of two conditions."""
    monkeypatch.chdir(tmp_path)
    for number, recording in enumerate(labelled_recordings[:6]):
        condition = "12"[number // 3]
        name = f"{condition}-{'abc'[number % 3]}"
        metadata = replace(recording.metadata, name=f"r{name}", condition=condition, session=name)
        write_recording(LABELLED_FOLDER, Recording(metadata, recording.table))
    return tmp_path


def params_for(test_sessions: int = 1) -> Params:
    return Params.model_construct(split=SplitParams(test_sessions=test_sessions, validation_sessions=1, seed=1))


def test_every_recording_has_one_role_and_no_second_copy(workplace: Path) -> None:
    record = split.run(params_for())
    seen = []
    for role, folder in PROCESSED_FOLDERS.items():
        paths = recording_paths(folder)
        assert {read_metadata(path).condition for path in paths} == {"1", "2"}
        assert record.metrics[f"{role}.recordings"] == record.metrics[f"{role}.sessions"] == len(paths) == 2
        assert all(path.samefile(LABELLED_FOLDER / path.name) for path in paths)
        seen += [path.name for path in paths]
    assert sorted(seen) == sorted(path.name for path in recording_paths(LABELLED_FOLDER))
    assert split.run(params_for()) == record


def test_too_few_sessions_are_refused_and_nothing_is_written(workplace: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"condition '1' has 3 sessions \(1-a, 1-b, 1-c\), but 4 are needed: 2 for test"
    ):
        split.run(params_for(test_sessions=2))
    assert not PROCESSED_FOLDERS["train"].exists()

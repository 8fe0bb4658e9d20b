"""Stage ``split``: every labelled recording has one role; too few sessions are refused."""

from dataclasses import replace
from pathlib import Path

import pytest

from cylinder_friction.files.whole_files import read_json
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import recording_paths, write_recording
from cylinder_friction.stages import split
from cylinder_friction.stages._stage import LABELLED_FOLDER, SPLIT_FILE
from shipped_params import shipped


def test_every_recording_has_one_role_and_too_few_sessions_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording]
) -> None:
    monkeypatch.chdir(tmp_path)
    for number, recording in enumerate(labelled_recordings[:8]):  # four sessions in each of two conditions
        condition = "12"[number // 4]
        name = f"{condition}-{'abcd'[number % 4]}"
        metadata = replace(recording.metadata, name=f"r{name}", condition=condition, session=name)
        write_recording(LABELLED_FOLDER, Recording(metadata, recording.table))
    with pytest.raises(
        RecordingError, match=r"condition '1' has 4 sessions \(1-a, 1-b, 1-c, 1-d\), but 5 are needed: 2 for test, 1"
    ):
        split.run(shipped(split={"test_sessions": 2}))
    assert not SPLIT_FILE.exists()
    record = split.run(shipped(split={"test_sessions": 1}))
    roles = read_json(SPLIT_FILE)
    assert set(roles) == {"train", "validation", "calibration", "test"}
    for role, names in roles.items():
        assert {name[1] for name in names} == {"1", "2"}
        assert record.metrics[f"recordings/{role}"] == record.metrics[f"sessions/{role}"] == len(names) == 2
    written = sorted(path.stem for path in recording_paths(LABELLED_FOLDER))
    assert sorted(name for names in roles.values() for name in names) == written
    with pytest.raises(
        RecordingError, match=r"no recording of condition '9'; got conditions \['1', '2'\]; name one of th"
    ):
        split.run(shipped(split={"test_sessions": 1}, lugre={"condition": "9"}))

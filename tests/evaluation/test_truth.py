from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.evaluation.truth import read_truth
from cylinder_friction.recordings.recording import Recording, RecordingError


def test_truth_is_read_for_the_rows_of_the_recording(tmp_path: Path, labelled_recordings: list[Recording]) -> None:
    """Ingest may leave out rows at either end, for example where a sensor is late."""
    whole = labelled_recordings[0]
    assert read_truth(tmp_path, whole) is None
    whole.table.to_parquet(tmp_path / f"{whole.name}.parquet")
    for recording in (whole, replace(whole, columns=whole.table[4:-7].reset_index(drop=True))):
        truth = read_truth(tmp_path, recording)
        assert truth is not None
        np.testing.assert_array_equal(truth["friction_n"], recording.column("friction_n"))


@pytest.mark.parametrize("what", ["column", "rows", "times"])
def test_truth_of_something_else_is_refused(tmp_path: Path, labelled_recordings: list[Recording], what: str) -> None:
    recording = labelled_recordings[0]
    table, message = {
        "column": (recording.table.drop(columns="friction_n"), "column 'friction_n' is missing"),
        "rows": (recording.table.iloc[:-1], r"has 3999 rows, but recording 'condition1_session1' has 4000"),
        "times": (recording.table.assign(time_s=recording.column("time_s") * 2), "expected the truth of this very"),
    }[what]
    table.to_parquet(tmp_path / f"{recording.name}.parquet")
    with pytest.raises(RecordingError, match=message):
        read_truth(tmp_path, recording)

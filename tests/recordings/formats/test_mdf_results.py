"""Results beside a measurement file's channels: the original untouched, the same bytes again."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal

from cylinder_friction.recordings.formats.mdf_results import GROUP, write_mdf
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import Recording


def original(path: Path, recording: Recording, version: str) -> Path:
    """Write what a logger measured: pressures at the recording's rate, and a slower channel of its own."""
    time_s = recording.column("time_s")
    with MDF(version=version) as file:
        file.start_time = datetime(2026, 3, 27, 9, 15, tzinfo=UTC)
        file.append(
            [Signal(recording.column(f"pressure_{side}_pa") / 1e5, time_s, "bar", f"P{side}") for side in (1, 2)]
        )
        file.append([Signal(np.arange(5.0), np.arange(5.0), "kN", "cell")])
        return Path(file.save(path, overwrite=True))


@pytest.fixture
def parts(labelled_recordings: list[Recording]) -> list[Recording]:
    recording = labelled_recordings[0]
    recording = replace(recording, metadata=replace(recording.metadata, start="2026-03-27T09:15:00.000Z"))
    half = len(recording) // 2
    return [recording.rows(slice(0, half)), recording.rows(slice(half, None))]


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_results_stand_beside_what_was_measured(tmp_path: Path, parts: list[Recording], version: str) -> None:
    whole = np.concatenate([part.column("friction_n") for part in parts])
    time_s = np.concatenate([part.column("time_s") for part in parts])
    log = original(tmp_path / ("log.mdf" if version < "4" else "log.mf4"), parts[0], version)
    before = log.read_bytes()
    write_mdf(tmp_path / "result.mf4", parts, log)
    assert log.read_bytes() == before
    fast, slow, results = read_logged_file(tmp_path / "result.mf4")
    np.testing.assert_array_equal(fast.channels["P1"], parts[0].column("pressure_1_pa") / 1e5)
    np.testing.assert_array_equal(slow.channels["cell"], np.arange(5.0))
    assert results.name == GROUP
    np.testing.assert_array_equal(results.channels["time"], time_s)
    np.testing.assert_array_equal(results.channels["friction_n"], whole)
    assert (results.units["friction_n"], results.units["velocity_m_s"]) == ("N", "m/s")
    assert "pressure_1_pa" not in results.channels
    write_mdf(tmp_path / "again.mf4", parts, log)
    assert (tmp_path / "again.mf4").read_bytes() == (tmp_path / "result.mf4").read_bytes()


def test_of_another_log_the_recording_is_written(tmp_path: Path, parts: list[Recording]) -> None:
    (tmp_path / "log.csv").write_text("t,p\n0,1\n")
    write_mdf(tmp_path / "result.mf4", parts, tmp_path / "log.csv")
    (table,) = read_logged_file(tmp_path / "result.mf4")
    pressure_pa = np.concatenate([part.column("pressure_1_pa") for part in parts])
    np.testing.assert_array_equal(table.channels["pressure_1_pa"], pressure_pa)
    assert table.units["pressure_1_pa"] == "Pa"
    assert table.start is not None
    assert table.start.after(parts[0].column("time_s")[0]).text() == "2026-03-27T09:15:00.000Z"
    with MDF(tmp_path / "result.mf4") as file:
        assert '"start": "2026-03-27T09:15:00.000Z"' in file.groups[0].channel_group.comment

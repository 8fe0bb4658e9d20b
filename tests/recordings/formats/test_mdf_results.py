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
def measured(labelled_recordings: list[Recording]) -> Recording:
    recording = labelled_recordings[0]
    return replace(recording, metadata=replace(recording.metadata, start="2026-03-27T09:15:00.000Z"))


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_results_stand_beside_what_was_measured(tmp_path: Path, measured: Recording, version: str) -> None:
    log = original(tmp_path / ("log.mdf" if version < "4" else "log.mf4"), measured, version)
    before = log.read_bytes()
    write_mdf(tmp_path / "result.mf4", measured, log)
    assert log.read_bytes() == before
    fast, slow, results = read_logged_file(tmp_path / "result.mf4")
    np.testing.assert_array_equal(fast.channels["P1"], measured.column("pressure_1_pa") / 1e5)
    np.testing.assert_array_equal(slow.channels["cell"], np.arange(5.0))
    assert results.name == GROUP
    np.testing.assert_array_equal(results.channels["time"], measured.column("time_s"))
    np.testing.assert_array_equal(results.channels["friction_n"], measured.column("friction_n"))
    assert (results.units["friction_n"], results.units["velocity_m_s"]) == ("N", "m/s")
    assert "pressure_1_pa" not in results.channels
    write_mdf(tmp_path / "again.mf4", measured, log)
    assert (tmp_path / "again.mf4").read_bytes() == (tmp_path / "result.mf4").read_bytes()


def test_of_another_log_the_recording_is_written(tmp_path: Path, measured: Recording) -> None:
    (tmp_path / "log.csv").write_text("t,p\n0,1\n")
    write_mdf(tmp_path / "result.mf4", measured, tmp_path / "log.csv")
    (table,) = read_logged_file(tmp_path / "result.mf4")
    np.testing.assert_array_equal(table.channels["pressure_1_pa"], measured.column("pressure_1_pa"))
    assert table.units["pressure_1_pa"] == "Pa"
    assert table.start is not None
    assert table.start.after(measured.column("time_s")[0]).text() == "2026-03-27T09:15:00.000Z"
    with MDF(tmp_path / "result.mf4") as file:
        assert '"start": "2026-03-27T09:15:00.000Z"' in file.groups[0].channel_group.comment

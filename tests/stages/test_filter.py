"""Stage ``filter``: smooth signals beside the raw ones, by every recipe."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.commands.params import compose_params
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored, write_recording
from cylinder_friction.stages import filter as filter_stage
from cylinder_friction.stages._stage import RECORDINGS_FOLDER, SIGNALS_FOLDER
from shipped_params import shipped

CONF = Path(__file__).parents[2] / "conf"
METHODS = {
    "adaptive": "adaptive",
    "moving_average_centred": "moving_average_centred",
    "paper": "moving_average",
    "rts": "rts",
    "savitzky_golay": "savitzky_golay",
}
RAW = ["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]
ADDED = ["pressure_1_smooth_pa", "pressure_2_smooth_pa", "velocity_m_s", "acceleration_m_s2"]


@pytest.fixture(scope="module")
def recipes() -> dict[str, Params]:
    names = sorted(path.stem for path in (CONF / "filter").glob("*.yaml"))
    return {name: check_params(compose_params(CONF, [f"filter={name}"]), name) for name in names}


@pytest.fixture
def original(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording]) -> Recording:
    monkeypatch.chdir(tmp_path)
    recording = labelled_recordings[0]
    write_recording(RECORDINGS_FOLDER, Recording(recording.metadata, recording.table[RAW]))
    return recording


@pytest.mark.parametrize("name", METHODS)
def test_signals_are_added_and_a_drive_force_and_a_measured_load_are_smoothed_like_pressures(
    original: Recording, recipes: dict[str, Params], name: str
) -> None:
    force_n = original.column("pressure_1_pa") * 1e-3
    table = original.table[["time_s", "position_m"]].assign(drive_force_n=force_n, load_force_n=0.5 * force_n)
    write_recording(RECORDINGS_FOLDER, Recording(replace(original.metadata, name="drive"), table))
    assert filter_stage.run(recipes[name]).metrics == {"recordings": 2.0, "rows": 8000.0}
    by_name = {recording.name: recording for recording in read_stored(SIGNALS_FOLDER)}
    got, drive = by_name[original.name], by_name["drive"]
    assert list(got.table.columns) == RAW + ADDED
    np.testing.assert_array_equal(got.samples(), original.samples())
    error = (got.column("velocity_m_s") - original.column("velocity_m_s"))[200:-200]
    assert np.abs(error).mean() < (4e-3 if METHODS[name] == "moving_average" else 1e-3)
    added = ["drive_force_smooth_n", "velocity_m_s", "acceleration_m_s2", "load_force_smooth_n"]
    assert list(drive.table.columns) == [*table.columns, *added]
    smooth_n = drive.column("drive_force_smooth_n")
    if name != "adaptive":  # its windows for pressures are those of their force
        np.testing.assert_allclose(smooth_n, 1e-3 * got.column("pressure_1_smooth_pa"), rtol=1e-4)
    np.testing.assert_allclose(drive.column("load_force_smooth_n"), 0.5 * smooth_n, rtol=1e-9)
    np.testing.assert_array_equal(drive.column("velocity_m_s"), got.column("velocity_m_s"))


def test_published_windows_at_another_rate_are_warned_of(original: Recording) -> None:
    metadata = replace(original.metadata, name="slow", sample_time_s=0.02)
    write_recording(RECORDINGS_FOLDER, Recording(metadata, original.table[RAW]))
    with pytest.warns(UserWarning, match="chosen for 200 Hz, but recordings come at 50 Hz: window 10 lasts"):
        filter_stage.run(shipped(filter={"method": "moving_average"}))


def test_method_is_the_only_difference_of_the_recipes(recipes: dict[str, Params]) -> None:
    sections: dict[str, Any] = {name: params.filter.model_dump() for name, params in recipes.items()}
    assert {name: content.pop("method") for name, content in sections.items()} == METHODS
    assert all(content == sections["paper"] for content in sections.values())
    assert sections["paper"]["moving_average"] == {"window": 10, "acceleration_window": 30}, "as published"

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from cylinder_friction.params.checking import Params
from cylinder_friction.params.data import CylinderParams, FilterParams
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_recordings, write_recording
from cylinder_friction.stages import filter as filter_stage
from cylinder_friction.stages._stage import RECORDINGS_FOLDER, SIGNALS_FOLDER

CONF = Path(__file__).parents[2] / "conf/filter"
RECIPES = sorted(path.stem for path in CONF.glob("*.yaml"))
RAW = ["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]
ADDED = ["pressure_1_smooth_pa", "pressure_2_smooth_pa", "velocity_m_s", "acceleration_m_s2"]


def shipped(name: str) -> dict[str, Any]:
    """Return a recipe over those that it builds on, as Hydra composes it."""
    content: dict[str, Any] = yaml.safe_load((CONF / f"{name}.yaml").read_text(encoding="utf-8"))
    for base in content.pop("defaults", []):
        content = content if base == "_self_" else shipped(base) | content
    return content


def params_of(name: str) -> Params:
    cylinder = yaml.safe_load((CONF.parent / "cylinder/bosch_h160ca_63x28.yaml").read_text(encoding="utf-8"))
    return Params.model_construct(
        cylinder=CylinderParams.model_validate(cylinder), filter=FilterParams.model_validate(shipped(name))
    )


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording]) -> Path:
    monkeypatch.chdir(tmp_path)
    for recording in labelled_recordings[:2]:
        write_recording(RECORDINGS_FOLDER, Recording(recording.metadata, recording.table[RAW]))
    return tmp_path


@pytest.mark.parametrize("name", RECIPES)
def test_signals_are_added_and_raw_columns_stay(
    workplace: Path, labelled_recordings: list[Recording], name: str
) -> None:
    params = params_of(name)
    record = filter_stage.run(params)
    assert record.metrics == {"recordings": 2.0, "rows": 8000.0}
    for got, original in zip(read_recordings(SIGNALS_FOLDER), labelled_recordings, strict=False):
        assert list(got.table.columns) == RAW + ADDED
        np.testing.assert_array_equal(got.samples(), original.samples())
        inner = slice(200, -200)
        late = params.filter.method == "moving_average"
        error = got.column("velocity_m_s")[inner] - original.column("velocity_m_s")[inner]
        assert np.abs(error).mean() < (4e-3 if late else 1e-3)
    assert record == filter_stage.run(params)


def test_recordings_at_another_rate_are_warned_of(workplace: Path, labelled_recordings: list[Recording]) -> None:
    metadata = replace(labelled_recordings[0].metadata, name="slow", sample_time_s=0.02)
    write_recording(RECORDINGS_FOLDER, Recording(metadata, labelled_recordings[0].table[RAW]))
    with pytest.warns(UserWarning, match="chosen for 200 Hz, but recordings come at 50 Hz: velocity_window 21 lasts"):
        filter_stage.run(params_of("adaptive"))


def test_method_is_the_only_difference_of_the_recipes() -> None:
    methods = {name: shipped(name)["method"] for name in RECIPES}
    assert methods == {
        "adaptive": "adaptive",
        "moving_average_centred": "moving_average_centred",
        "paper": "moving_average",
        "rts": "rts",
        "savitzky_golay": "savitzky_golay",
    }
    assert len({str({**shipped(name), "method": ""}) for name in RECIPES}) == 1


def test_paper_recipe_has_the_published_windows() -> None:
    assert shipped("paper")["moving_average"] == {"window": 10, "acceleration_window": 30}


def test_impossible_windows_are_refused() -> None:
    content = shipped("savitzky_golay")
    content["savitzky_golay"]["velocity_window"] = 20
    with pytest.raises(ValidationError, match="for velocity: expected an odd window"):
        FilterParams.model_validate(content)


@pytest.mark.parametrize("name", RECIPES)
def test_a_drive_force_and_a_measured_load_are_smoothed_like_pressures(
    workplace: Path, labelled_recordings: list[Recording], name: str
) -> None:
    original = labelled_recordings[0]
    force_n = original.column("pressure_1_pa") * 1e-3
    table = original.table[["time_s", "position_m"]].assign(drive_force_n=force_n, load_force_n=0.5 * force_n)
    write_recording(RECORDINGS_FOLDER, Recording(replace(original.metadata, name="drive"), table))
    params = params_of(name)
    filter_stage.run(params)
    by_name = {recording.name: recording for recording in read_recordings(SIGNALS_FOLDER)}
    got, twin = by_name["drive"], by_name[original.name]
    added = ["drive_force_smooth_n", "velocity_m_s", "acceleration_m_s2", "load_force_smooth_n"]
    assert list(got.table.columns) == [*table.columns, *added]
    smooth_n = got.column("drive_force_smooth_n")
    if params.filter.method != "adaptive":  # its windows for pressures are those of their force
        np.testing.assert_allclose(smooth_n, 1e-3 * twin.column("pressure_1_smooth_pa"), rtol=1e-4)
    np.testing.assert_allclose(got.column("load_force_smooth_n"), 0.5 * smooth_n, rtol=1e-9)
    np.testing.assert_array_equal(got.column("velocity_m_s"), twin.column("velocity_m_s"))

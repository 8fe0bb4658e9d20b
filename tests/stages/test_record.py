from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest
from pydantic import ValidationError

from cylinder_friction.params.checking import Params
from cylinder_friction.params.data import CylinderParams, RecordParams
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.rig.campaign import TRUTH_COLUMNS
from cylinder_friction.stages import record
from cylinder_friction.stages._stage import RIG_FOLDER, RIG_TRUTH_FOLDER

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder

SETTINGS: dict[str, Any] = {
    "seed": 5,
    "sessions_per_condition": 1,
    "recordings_per_session": 1,
    "duration_s": 3.0,
    "sample_time_s": 0.005,
    "time_step_s": 5e-5,
    "supply": "industrial",
    "zeroed": True,
    "residual_offset_bar": 0.05,
    "asymmetry_sd": 0.0,
    "fault": "none",
    "external_load": "none",
    "load_delay_s": 0.0,
    "specimen": "default",
}


def params(cylinder: Cylinder, **changes: Any) -> Params:
    section = RecordParams(**{**SETTINGS, **changes})
    return Params.model_construct(cylinder=CylinderParams(**cylinder.__dict__), record=section)


@pytest.fixture(autouse=True)
def _workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_it_writes_what_a_logger_would_and_the_truth_elsewhere(cylinder: Cylinder) -> None:
    done = record.run(params(cylinder))
    names = [f"condition{condition}_session01_recording01" for condition in "1234"]
    assert sorted(path.name for path in RIG_FOLDER.iterdir()) == [f"{name}.csv" for name in names]
    assert sorted(path.name for path in RIG_TRUTH_FOLDER.iterdir()) == [f"{name}.parquet" for name in names]
    lines = (RIG_FOLDER / f"{names[0]}.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "Time [s],P1 [bar],P2 [bar],Position [mm],Oil temperature [degC]"
    assert [line.split(",")[0] for line in lines[1:4]] == ["0.000", "0.005", "0.010"]
    assert len(lines) == 601
    truth = pd.read_parquet(RIG_TRUTH_FOLDER / f"{names[3]}.parquet")
    assert tuple(truth.columns) == TRUTH_COLUMNS
    assert done.metrics["recordings"] == 4.0
    assert done.metrics["seconds"] == 12.0
    assert done.metrics["mean_friction_n/condition_4"] > 0.0
    assert {name: each.sha256 for name, each in done.datasets.items()} == {
        "rig": hash_of(RIG_FOLDER),
        "rig_truth": hash_of(RIG_TRUTH_FOLDER),
    }
    assert ",".join(done.datasets["rig"].columns) == lines[0]
    assert done.datasets["rig_truth"].rows == 4 * len(truth)


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(cylinder: Cylinder) -> None:
    first, second = (record.run(params(cylinder, duration_s=1.0)) for _ in range(2))
    assert first.to_dict() == second.to_dict()
    other = record.run(params(cylinder, duration_s=1.0, seed=6))
    assert other.datasets["rig"] != first.datasets["rig"]


def test_no_sessions_leave_a_note_in_both_folders(cylinder: Cylinder) -> None:
    record.run(params(cylinder, duration_s=1.0))
    done = record.run(params(cylinder, sessions_per_condition=0))
    assert [path.name for path in RIG_FOLDER.iterdir()] == ["README.txt"]
    assert [path.name for path in RIG_TRUTH_FOLDER.iterdir()] == ["README.txt"]
    assert done.metrics["recordings"] == 0.0


def test_a_load_is_logged_and_its_truth_kept(cylinder: Cylinder) -> None:
    record.run(params(cylinder, external_load="varied"))
    log = pd.read_csv(RIG_FOLDER / "condition2_session01_recording01.csv")
    assert list(log.columns)[-1] == "Load [N]"
    truth = pd.read_parquet(RIG_TRUTH_FOLDER / "condition2_session01_recording01.parquet")
    assert (log["Load [N]"] - truth["load_force_n"]).abs().mean() < 20.0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("time_step_s", 3e-5, "must divide one millisecond without remainder"),
        ("time_step_s", 1e-3, "less than or equal to 0.0002"),
        ("sample_time_s", 0.0005, "must be a whole number of milliseconds"),
        ("duration_s", 1.00005, "must be a whole number of milliseconds"),
        ("fault", "rust", "Input should be 'none', 'wear'"),
        ("external_load", "heavy", "Input should be 'none', 'varied' or 'boom'"),
        ("specimen", "narrow", "Input should be 'default' or 'wide'"),
    ],
)
def test_impossible_values_are_refused_by_name(key: str, value: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message) as refusal:
        RecordParams(**{**SETTINGS, key: value})
    assert refusal.value.errors()[0]["loc"] == (key,)

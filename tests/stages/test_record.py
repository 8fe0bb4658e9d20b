"""Stage ``record``: what a logger would write, and the truth elsewhere."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.params.checking import Params
from cylinder_friction.params.file import ParamsError
from cylinder_friction.rig.campaign import TRUTH_COLUMNS
from cylinder_friction.stages import record
from cylinder_friction.stages._stage import RIG_FOLDER, RIG_TRUTH_FOLDER
from shipped_params import shipped


def params(**changes: Any) -> Params:
    return shipped(record={"sessions_per_condition": 1, "recordings_per_session": 1, "duration_s": 1.0, **changes})


@pytest.fixture(autouse=True)
def _workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_it_writes_what_a_logger_would_and_the_truth_elsewhere() -> None:
    done = record.run(params(duration_s=3.0))
    names = [f"condition{condition}_session01_recording01" for condition in "1234"]
    assert sorted(path.name for path in RIG_FOLDER.iterdir()) == [f"{name}.csv" for name in names]
    assert sorted(path.name for path in RIG_TRUTH_FOLDER.iterdir()) == [f"{name}.parquet" for name in names]
    lines = (RIG_FOLDER / f"{names[0]}.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "Time [s],P1 [bar],P2 [bar],Position [mm],Oil temperature [degC]"
    assert [line.split(",")[0] for line in lines[1:4]] == ["0.000", "0.005", "0.010"]
    assert len(lines) == 601
    truth = pd.read_parquet(RIG_TRUTH_FOLDER / f"{names[3]}.parquet")
    assert tuple(truth.columns) == TRUTH_COLUMNS
    assert (done.metrics["recordings"], done.metrics["seconds"]) == (4.0, 12.0)
    assert done.metrics["mean_friction_n/condition_4"] == truth["friction_n"].abs().mean()
    assert done.metrics["rows"] == 4 * len(truth)


def test_the_same_seed_gives_the_same_bytes_and_no_sessions_a_note() -> None:
    made = [(record.run(params(seed=seed)), hash_of(RIG_FOLDER)) for seed in (5, 5, 6)]
    assert made[0] == made[1]
    assert made[2][1] != made[0][1]
    assert record.run(params(sessions_per_condition=0)).metrics["recordings"] == 0.0
    assert [path.name for folder in (RIG_FOLDER, RIG_TRUTH_FOLDER) for path in folder.iterdir()] == ["README.txt"] * 2


def test_a_load_is_logged_and_its_truth_kept() -> None:
    record.run(params(duration_s=3.0, external_load="varied"))
    log = pd.read_csv(RIG_FOLDER / "condition2_session01_recording01.csv")
    assert list(log.columns)[-1] == "Load [N]"
    truth = pd.read_parquet(RIG_TRUTH_FOLDER / "condition2_session01_recording01.parquet")
    assert (log["Load [N]"] - truth["load_force_n"]).abs().mean() < 20.0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("time_step_s", 3e-5, "must divide one millisecond without remainder"),
        ("duration_s", 1.00005, "must be a whole number of milliseconds"),
        ("specimen", "narrow", "Input should be 'default' or 'wide'"),
    ],
)
def test_impossible_values_are_refused_by_name(key: str, value: Any, message: str) -> None:
    with pytest.raises(ParamsError, match=rf"record\.{key}: .*{message}"):
        params(**{key: value})

"""Measurements of others, read where they lie; skipped where they are not there."""

from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.formats.registry import format_of

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def real(name: str) -> Path:
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{name} is not there")
    return path


def test_positioning_system_in_matlab(tmp_path: Path) -> None:
    path = real("emps/DATA_EMPS.mat")
    assert format_of(path).name == "matlab"
    (table,) = read_logged_file(path)
    assert list(table.channels.columns) == ["qg", "qm", "t", "vir"]
    assert len(table.channels) == 24841
    assert set(table.unread) == {"gtau", "kp", "kv"}
    assert np.isfinite(table.channels.to_numpy()).all()


def test_crane_in_gzipped_csv() -> None:
    (table,) = read_logged_file(real("crane/JibSineTest_230425__100Hz.csv.gz"), wanted=["t_s", "jib_x_m"])
    assert table.channels.shape == (5032, 2)
    assert len(table.unread) == 13
    assert table.channels["jib_x_m"].iloc[0] == 0.25012891


def test_pneumatic_cylinder_without_header() -> None:
    (table,) = read_logged_file(real("pneumatic-seals/NAPN_1bar.csv.gz"))
    assert list(table.channels.columns) == [f"column_{i}" for i in range(1, 8)]
    assert len(table.channels) == 7032
    assert (table.channels.dtypes == np.float64).all()


def test_tribometer_in_tabs_with_units() -> None:
    (table,) = read_logged_file(real("tribometer/test_data_2.txt"))
    assert table.units == {"Time [s]": "s", "Normal [uN]": "uN", "Position [mm]": "mm", "Friction [uN]": "uN"}
    assert len(table.channels) == 42579

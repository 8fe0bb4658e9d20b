from pathlib import Path

import h5py
import numpy as np
import pytest

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

T = np.arange(6.0)


def test_datasets_by_path_and_length(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["pressures/P1"] = T.astype(">f4")
        file["pressures/P1"].attrs["units"] = np.bytes_("bar")
        file["pressures/t"] = T
        file["pressures/t"].attrs.update({"scale_factor": np.array([0.1]), "add_offset": 0.0})
        file["motion/x"] = np.arange(3.0)
        file["motion/both"] = np.ones((3, 2), dtype=np.int16)
        file["serial"] = 7
        file["remarks"] = np.array(["ok"] * 6, dtype=h5py.string_dtype())
    short, long = read_logged_file(path)
    assert (short.name, list(short.channels.columns)) == ("motion", ["motion/both_1", "motion/both_2", "motion/x"])
    assert (long.name, list(long.channels.columns)) == ("pressures", ["pressures/P1", "pressures/t"])
    assert long.channels["pressures/P1"].dtype == np.float32
    assert long.units == {"pressures/P1": "bar", "pressures/t": "with scale_factor 0.1"}
    assert short.unread == ("remarks", "serial")


def test_a_compound_dataset_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    rows = np.zeros(6, dtype=[("t", "f8"), ("raw", "u2"), ("note", "S4")])
    rows["t"], rows["raw"] = T, 9
    with h5py.File(path, "w") as file:
        file["bench/log"] = rows
    (table,) = read_logged_file(path)
    assert table.name == "bench/log"
    assert list(table.channels.columns) == ["t", "raw"]
    assert table.channels["raw"].tolist() == [9] * 6


@pytest.mark.parametrize(("key", "value"), [("sampling_rate", 200), ("dt", 0.005), ("dt", np.float32(0.005))])
def test_a_stated_rate_makes_a_time_channel(tmp_path: Path, key: str, value: float) -> None:
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["bench/P1"] = T
        file["bench"].attrs[key] = value
    (table,) = read_logged_file(path)
    assert list(table.channels.columns) == ["time", "bench/P1"]
    np.testing.assert_allclose(table.channels["time"], T * 0.005, rtol=1e-7)
    assert table.units == {"time": "s"}
    with h5py.File(path, "a") as file:
        file["x"] = T
        file["x"].attrs.update({key: value, "t0": 0.5})
    with pytest.raises(RecordingError, match=r"begin at different times: 'bench/P1' at 0, 'x' at 0\.5; expected one"):
        read_logged_file(path)

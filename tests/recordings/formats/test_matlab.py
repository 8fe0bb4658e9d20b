from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

T = np.arange(6.0)


def saved(folder: Path, variables: dict[str, Any]) -> Path:
    scipy.io.savemat(folder / "log.mat", variables)
    return folder / "log.mat"


def test_vectors_matrices_and_structs_are_channels(tmp_path: Path) -> None:
    both = np.column_stack([T + 1, T + 2])
    path = saved(
        tmp_path,
        {
            "t": T[:, None],
            "row": T[None, :],
            "counts": T.astype(np.int16),
            "pressures": both,
            "lying": both.T,
            "log": {"P1": T + 3, "deep": {"x": T + 4}, "unit": "bar", "n": 6.0},
            "kp": {"data": T, "factor": 0.1, "unit": "bar"},
            "remark": "slow",
            "on": T > 2,
        },
    )
    (table,) = read_logged_file(path)
    names = ["t", "row", "counts", "pressures_1", "pressures_2", "lying_1", "lying_2"]
    names += ["log.P1", "log.deep.x", "kp.data", "on"]
    assert list(table.channels.columns) == names
    np.testing.assert_array_equal(table.channels["pressures_2"], T + 2)
    np.testing.assert_array_equal(table.channels["lying_2"], T + 2)
    assert table.channels["counts"].dtype == np.int16
    assert table.units == {"log.P1": "bar", "log.deep.x": "bar", "kp.data": "bar with factor 0.1"}
    assert set(table.unread) == {"kp.factor", "kp.unit", "remark", "log.n"}


def test_a_rate_among_variables_or_fields_makes_a_time_channel(tmp_path: Path) -> None:
    field = {"data": T, "dt": 0.005, "unit": "mm"}
    (table,) = read_logged_file(saved(tmp_path, {"fs": 200.0, "P1": T, "x": field}))
    np.testing.assert_allclose(table.channels["time"], 0.005 * T)
    with pytest.raises(RecordingError, match=r"begin at different times: 'P1' at 0, 'x\.data' at 0\.5; expected one"):
        read_logged_file(saved(tmp_path, {"fs": 200.0, "P1": T, "x": field | {"t0": 0.5}}))


def test_simulink_structure_with_time(tmp_path: Path) -> None:
    signals = np.zeros((2,), dtype=[("values", object), ("label", object), ("dimensions", object)])
    signals[0] = (T[:, None], "P1", 1.0)
    signals[1] = (np.arange(12.0).reshape(2, 6), "", np.array([1, 2]))
    scope = {"time": T[:, None], "signals": signals, "blockName": "m/s"}
    (table,) = read_logged_file(saved(tmp_path, {"scope": scope}))
    assert list(table.channels.columns) == ["scope.time", "scope.P1", "scope.signals_2_1", "scope.signals_2_2"]
    np.testing.assert_array_equal(table.channels["scope.signals_2_2"], np.arange(6.0, 12.0))
    assert table.units == {"scope.time": "s"}


TEXT_OBJECT = bytes.fromhex(
    "0e000000800000000600000008000000110000000000000001000400696e666f010004004d434f530100000006000000737472696e670000"
    "0e0000004800000006000000080000000d000000000000000500000008000000060000000100000001000000000000000600000018000000"
    "000000dd0200000001000000010000000100000001000000"
)
"""MATLAB's string ``info``, as version 7 writes it."""


@pytest.mark.parametrize("wanted", [None, ["P1"]])
def test_vectors_beside_a_string_or_a_date_are_read(tmp_path: Path, wanted: list[str] | None) -> None:
    path = saved(tmp_path, {"t": T, "P1": T + 1})
    path.write_bytes(path.read_bytes() + TEXT_OBJECT)
    (table,) = read_logged_file(path, wanted=wanted)
    np.testing.assert_array_equal(table.channels["P1"], T + 1)
    assert "an object" in table.unread


def test_channels_are_named_as_dspace_names_them(tmp_path: Path) -> None:
    y = np.zeros((2,), dtype=[("Name", object), ("Unit", object), ("Data", object), ("XIndex", object)])
    y[0], y[1] = ("Model Root/pA", "bar", T + 1, 1.0), ("Model Root/x", "mm", T + 2, 1.0)
    path = saved(
        tmp_path, {"rec1": {"X": {"Name": "Time", "Unit": "s", "Data": T}, "Y": y, "Capture": {"Length": 6.0}}}
    )
    for wanted in (None, ["Model Root/pA", "Time"]):
        (table,) = read_logged_file(path, wanted=wanted)
        np.testing.assert_array_equal(table.channels["Model Root/pA"], T + 1)
        assert table.units == {"Time": "s", "Model Root/pA": "bar", "Model Root/x": "mm"}


def test_a_file_without_vectors_says_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="holds no channels; got kp, name; expected vectors of numbers"):
        read_logged_file(saved(tmp_path, {"kp": 2.0, "name": "x"}))


def test_matlab_73_structs_text_and_arrays_of_structs(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = T[None, :]
        file["both"] = np.stack([T + 1, T + 2])
        log = file.create_group("log")
        log["P1"] = T[None, :] + 3
        text = log.create_dataset("unit", data=np.array([[98], [97], [114]], dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        hidden = file.create_group("#refs#")
        hidden["a"], hidden["b"] = T[None, :] + 5, T[None, :] + 6
        runs = file.create_group("run")
        runs.create_dataset("x", data=np.array([[hidden["a"].ref], [hidden["b"].ref]], dtype=h5py.ref_dtype))
        file["nothing"] = np.zeros(2, dtype=np.uint64)
        file["nothing"].attrs["MATLAB_empty"] = np.uint8(1)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: PCWIN64".ljust(124) + b"\x00\x02IM")
    (table,) = read_logged_file(path)
    first = {"both_1": 1.0, "both_2": 2.0, "log.P1": 3.0, "run_1.x": 5.0, "run_2.x": 6.0, "t": 0.0}
    assert table.channels.iloc[0].to_dict() == first
    assert table.units == {"log.P1": "bar"}
    assert table.unread == ("nothing",)

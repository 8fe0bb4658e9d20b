from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal, Source
from asammdf.blocks import v4_constants as v4
from asammdf.blocks.conversion_utils import from_dict

import format_writers
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

T = np.arange(6) * 0.01
START = datetime(2026, 3, 27, 9, 15, tzinfo=UTC)


def saved(file: MDF, folder: Path) -> Path:
    path = file.save(folder / "log.mf4" if file.version >= "4.00" else folder / "log.mdf", overwrite=True)
    file.close()
    return path


@pytest.mark.parametrize(("version", "utc"), [("3.30", False), ("4.10", True), ("4.20", True)])
def test_groups_conversions_text_and_start(tmp_path: Path, version: str, utc: bool) -> None:
    raw = np.arange(6, dtype=np.uint16)
    linear = from_dict({"a": 0.5, "b": 1.0})
    words = from_dict({"val_0": 0, "text_0": b"up", "val_1": 1, "text_1": b"down", "default": b"?"})
    file = MDF(version=version)
    file.start_time = START
    file.append(
        [Signal(raw, T, name="P1", unit="bar", conversion=linear), Signal(raw % 2, T, name="state", conversion=words)]
    )
    file.append([Signal(np.arange(3.0), np.arange(3) * 0.02, name="P1", unit="mm")])
    fast, slow = read_logged_file(saved(file, tmp_path))
    assert len(fast.channels) == 6
    assert len(slow.channels) == 3
    master = fast.channels.columns[0]
    assert fast.master == slow.master == master
    np.testing.assert_array_equal(fast.channels[master], T)
    assert fast.units[master] == "s"
    np.testing.assert_array_equal(fast.channels["P1"], raw * 0.5 + 1.0)
    assert fast.unread == ("state",)
    assert (fast.units["P1"], slow.units["P1"]) == ("bar", "mm")
    for start in (fast.start, slow.start):
        assert start is not None
        assert (start.at, start.utc) == (np.datetime64("2026-03-27T09:15:00"), utc)
        assert start.source == f"header of MDF {version}"


def test_samples_marked_invalid_are_missing(tmp_path: Path) -> None:
    invalid = np.array([0, 0, 1, 0, 0, 0], dtype=bool)
    file = MDF(version="4.10")
    file.append([Signal(np.arange(6, dtype=np.int16), T, name="P1", invalidation_bits=invalid)])
    (table,) = read_logged_file(saved(file, tmp_path))
    np.testing.assert_array_equal(table.channels["P1"], [0, 1, np.nan, 3, 4, 5])


def test_fewer_samples_than_stated_are_said(tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    format_writers.write_sample("mdf4", path, 40)
    content = bytearray(path.read_bytes())
    # The number of samples stands behind a channel group's header, six links and the record's number.
    place = content.index(b"##CG") + 24 + 6 * 8 + 8
    assert content[place] == 40
    content[place] = 60
    path.write_bytes(content)
    (read,) = read_logged_file(path)
    assert len(read.channels) == 40
    assert read.notes == ("the file is cut off: 40 of 60 samples are there",)


BAR = np.array([[20.0, 30.0], [20.5, 31.0], [21.0, 29.99]])


def bus_log(path: Path, signals: bool = False) -> Path:
    """Write frames of a CAN bus as loggers do, with two pressures in each; beside signals or alone."""
    kinds = [("BusChannel", "u1"), ("ID", "<u4"), ("IDE", "u1"), ("DLC", "u1"), ("DataLength", "u1")]
    names = [(f"CAN_DataFrame.{name}", kind) for name, kind in [*kinds, ("DataBytes", "(8,)u1")]]
    frames = np.zeros(3, np.dtype(names))
    for name, value in (("BusChannel", 1), ("ID", 256), ("DLC", 8), ("DataLength", 8)):
        frames[f"CAN_DataFrame.{name}"] = value
    frames["CAN_DataFrame.DataBytes"][:, :4] = np.rint(100.0 * BAR).astype("<u2").view("u1")
    source = Source("CAN", "CAN", "", v4.SOURCE_BUS, v4.BUS_TYPE_CAN)
    file = MDF(version="4.10")
    file.start_time = START
    file.append([Signal(frames, T[:3], name="CAN_DataFrame", source=source)], acq_source=source)
    file.groups[0].channel_group.flags |= v4.FLAG_CG_BUS_EVENT | v4.FLAG_CG_PLAIN_BUS_EVENT
    if signals:
        file.append([Signal(np.arange(6.0), T, name="P1", unit="bar")])
    return saved(file, path)


def test_frames_of_a_bus_are_no_signals(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"holds frames of a bus \(CAN, LIN\), .* give the bus's database \(--dbc"):
        read_logged_file(bus_log(tmp_path))
    (table,) = read_logged_file(bus_log(tmp_path, signals=True))
    assert list(table.channels) == ["time", "P1"]


DBC = """VERSION ""
BU_: LOGGER
BO_ 256 PRESSURES: 8 LOGGER
 SG_ P1 : 0|16@1+ (0.01,0) [0|400] "bar" LOGGER
 SG_ P2 : 16|16@1+ (0.01,0) [0|400] "bar" LOGGER
"""


def test_frames_of_a_bus_are_decoded_with_its_database(tmp_path: Path) -> None:
    path, database = bus_log(tmp_path), tmp_path / "bus.dbc"
    database.write_text(DBC)
    (table,) = read_logged_file(path, database=database)
    np.testing.assert_allclose(table.channels[["P1", "P2"]].to_numpy(), BAR)
    assert table.units == {"time": "s", "P1": "bar", "P2": "bar"}
    assert table.start is not None
    assert table.start.text() == "2026-03-27T09:15:00.000Z"
    database.write_text(DBC.replace("BO_ 256", "BO_ 512"))
    (tmp_path / "bus.yaml").write_text("a: 1")
    (tmp_path / "log.csv").write_text("t,p\n" + "1,2\n" * 30)
    for log, described, words in (
        (path, "bus.dbc", r"none of its bus frames is described in .*bus\.dbc; state the one of this"),
        (path, "gone.dbc", r"database .*gone\.dbc: no such file"),
        (path, "bus.yaml", r"bus\.yaml: cannot be read as one of a CAN bus; expected a \.dbc file"),
        (tmp_path / "log.csv", "bus.dbc", "is for an MDF file of bus frames, not for a text table"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_logged_file(log, database=tmp_path / described)

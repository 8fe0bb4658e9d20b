from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.recordings import RecordingError, reader_for
from cylinder_friction.recordings.mapping import ChannelMapping, apply_mapping

if TYPE_CHECKING:
    from pathlib import Path


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_channels_come_as_named(tmp_path: Path) -> None:
    table = reader_for("csv").read(written(tmp_path, "Time [s], P1 [bar] ,Note\n0.0,1.5,a\n0.005,,b\n"))
    assert list(table.columns) == ["Time [s]", "P1 [bar]", "Note"]
    np.testing.assert_array_equal(table["P1 [bar]"], [1.5, np.nan])


def test_decimal_comma_and_byte_order_mark(tmp_path: Path) -> None:
    table = reader_for("csv", delimiter=";", decimal=",").read(written(tmp_path, "\ufefft;T [°C]\n0,005;40,5\n"))
    assert table.to_dict("list") == {"t": [0.005], "T [°C]": [40.5]}


def test_under_a_decimal_comma_only_the_bad_cell_is_blamed(tmp_path: Path) -> None:
    read = reader_for("csv", delimiter=";", decimal=",").read
    table = read(written(tmp_path, "p [bar]\n3,845\n3,9\nbroken\n-1,5e1\n"))
    with pytest.raises(RecordingError, match=r"broken.* in row 3 \(1 such rows in all\); expected numbers in bar"):
        apply_mapping(table, {"pressure_1_pa": ChannelMapping("p [bar]", "bar", 1)})


def test_under_a_decimal_comma_a_point_is_no_decimal_sign(tmp_path: Path) -> None:
    table = reader_for("csv", delimiter=";", decimal=",").read(written(tmp_path, "p [bar]\n3.845\n3.9\n"))
    with pytest.raises(RecordingError, match=r"3\.845.* in row 1 \(2 such rows in all\)"):
        apply_mapping(table, {"pressure_1_pa": ChannelMapping("p [bar]", "bar", 1)})


def test_older_encodings(tmp_path: Path) -> None:
    table = reader_for("csv", encoding="latin-1").read(written(tmp_path, "T [°C]\r\n40.5\r\n".encode("latin-1")))
    assert table.to_dict("list") == {"T [°C]": [40.5]}
    with pytest.raises(RecordingError, match="unknown encoding: klingon"):
        reader_for("csv", encoding="klingon").read(written(tmp_path, "a\n1\n"))


def test_numbers_are_read_to_the_last_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(1).normal(size=200)
    path = written(tmp_path, "x\n" + "\n".join(map(repr, map(float, values))) + "\n")
    np.testing.assert_array_equal(reader_for("csv").read(path)["x"], values)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "Empty CSV file"),
        ("a,b\n1,2\n3,4\n5\n", "Expected 2 columns, got 1"),
        ("a,b\n1,2\n3,4", "its last line has no line end, so the log may have been cut"),
        ("a,b\n1,2\n3,4,5\n", "Expected 2 columns, got 3"),
        (b"a,\xff\n1,2\n", "cannot be read as CSV with delimiter ',' and encoding 'utf-8': .* byte 0xff"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, content: str | bytes, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        reader_for("csv").read(written(tmp_path, content))


def test_unknown_format_lists_the_known_ones() -> None:
    with pytest.raises(RecordingError, match="format 'tdms' is not known; expected one of csv"):
        reader_for("tdms")

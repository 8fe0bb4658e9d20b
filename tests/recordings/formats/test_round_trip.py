"""One recording written to every format and read back."""

from __future__ import annotations

import gzip
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

import format_writers
from cylinder_friction.recordings.formats.detect import FORMATS, format_of
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.formats.source import read_head
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

ROUNDED = {"excel": 1e-15}  # openpyxl writes 16 digits
TEXT = ("csv", "tsv", "decimal_comma", "csv_gz")
DETECTED = {
    "matlab5": "matlab",
    "matlab73": "matlab",
    "mdf4": "mdf",
    "tdms": "tdms",
    "hdf5": "hdf5",
    "parquet": "parquet",
    "excel": "excel",
}


@pytest.mark.parametrize("kind", format_writers.WRITERS)
def test_what_was_written_is_read_to_the_last_bit(tmp_path: Path, kind: str) -> None:
    table, units = format_writers.synthetic()
    path = tmp_path / "log.anything"
    format_writers.WRITERS[kind](path, table, units)
    (read,) = read_logged_file(path)
    assert len(read.channels.columns) == len(table.columns)
    for name in table.columns:
        channel = f"{name} [{units[name]}]" if kind in TEXT else name
        values = read.channels[channel].to_numpy()
        assert values.dtype == np.float64
        np.testing.assert_allclose(values, table[name], rtol=ROUNDED.get(kind, 0.0), atol=0.0)
        assert read.units[channel] == units[name]
    assert read.notes == ()


@pytest.mark.parametrize("kind", format_writers.WRITERS)
def test_only_what_is_wanted_is_loaded(tmp_path: Path, kind: str) -> None:
    table, units = format_writers.synthetic(40)
    path = tmp_path / "log"
    format_writers.WRITERS[kind](path, table, units)
    channel = "P2 [bar]" if kind in TEXT else "P2"
    (read,) = read_logged_file(path, wanted=[channel])
    assert list(read.channels.columns) == [channel]
    np.testing.assert_allclose(read.channels[channel], table["P2"], rtol=ROUNDED.get(kind, 0.0), atol=0.0)
    assert len([name for name in read.unread if name.split(" ")[0] in ("time", "P1", "pos")]) == 3


@pytest.mark.parametrize("kind", format_writers.WRITERS)
def test_where_nothing_is_wanted_all_is_named(tmp_path: Path, kind: str) -> None:
    table, units = format_writers.synthetic(40)
    path = tmp_path / "log"
    format_writers.WRITERS[kind](path, table, units)
    (read,) = read_logged_file(path, wanted=["no such channel"])
    assert read.channels.empty
    assert {name.split(" ")[0] for name in read.unread} >= set(table.columns)


@pytest.mark.parametrize("kind", format_writers.WRITERS)
def test_a_format_is_told_by_content_also_within_gzip(tmp_path: Path, kind: str) -> None:
    table, units = format_writers.synthetic(40)
    plain, zipped = tmp_path / "log.txt", tmp_path / "zipped.txt"
    format_writers.WRITERS[kind](plain, table, units)
    expected = DETECTED.get(kind, "csv")
    assert expected in FORMATS
    assert format_of(read_head(plain)) == expected
    if kind != "csv_gz":
        zipped.write_bytes(gzip.compress(plain.read_bytes()))
        assert format_of(read_head(zipped)) == expected
        assert len(read_logged_file(zipped)[0].channels) == 40


@pytest.mark.parametrize(
    ("kind", "module", "message"),
    [
        (
            "mdf4",
            "asammdf",
            r'reading MDF4 needs asammdf, which is not installed; pip install "cylinder-friction\[mdf\]"',
        ),
        (
            "tdms",
            "nptdms",
            r'reading TDMS needs npTDMS, which is not installed; pip install "cylinder-friction\[tdms\]"',
        ),
        ("hdf5", "h5py", r'reading HDF5 needs h5py, which is not installed; pip install "cylinder-friction\[hdf5\]"'),
        ("excel", "openpyxl", r"reading Excel workbooks needs openpyxl, .* pip install .cylinder-friction\[excel\]."),
        ("matlab73", "h5py", r"reading MATLAB 7.3 needs h5py, .* pip install .cylinder-friction\[hdf5\]."),
    ],
)
def test_a_missing_library_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, module: str, message: str
) -> None:
    table, units = format_writers.synthetic(40)
    format_writers.WRITERS[kind](tmp_path / "log", table, units)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RecordingError, match=message):
        read_logged_file(tmp_path / "log")


def test_an_unknown_format_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="format 'xlsx' is not known; expected auto or one of csv, matlab, mdf"):
        read_logged_file(tmp_path / "log", "xlsx")

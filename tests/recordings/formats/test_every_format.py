"""What holds for every format: one recording is written to each and read back, whole or damaged."""

import gzip
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.formats import isolated
from cylinder_friction.recordings.formats.layout import CsvOptions
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.formats.registry import FORMATS, SETTINGS, format_of
from cylinder_friction.recordings.recording import RecordingError
from format_writers import SAMPLES, synthetic, write_sample

_, UNITS = synthetic()
KINDS = pytest.mark.parametrize("kind", SAMPLES)
# Damage that hangs a library costs its time limit: examples stay the same ones.
calm = settings(derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def test_every_format_has_a_sample_and_a_row_in_the_guide() -> None:
    assert {sample.format for sample in SAMPLES.values()} == set(FORMATS)
    guide = (Path(__file__).parents[3] / "docs/logger-files.md").read_text(encoding="utf-8")
    assert [name for name in SETTINGS if f"| `{name}` |" not in guide] == []


@KINDS
def test_what_was_written_is_read_to_the_last_bit(tmp_path: Path, kind: str) -> None:
    table = write_sample(kind, tmp_path / "log.anything")
    (read,) = read_logged_file(tmp_path / "log.anything")
    assert len(read.channels.columns) == len(table.columns)
    for name in table.columns:
        channel = SAMPLES[kind].channel(name, UNITS[name])
        values = read.channels[channel].to_numpy()
        assert values.dtype == np.float64
        np.testing.assert_allclose(values, table[name], rtol=SAMPLES[kind].rounding, atol=0.0)
        assert read.units[channel] == UNITS[name]
    assert read.notes == ()


@KINDS
def test_only_what_is_wanted_is_loaded_and_what_may_be_time(tmp_path: Path, kind: str) -> None:
    table = write_sample(kind, tmp_path / "log", 40)
    channel = SAMPLES[kind].channel("P2", "bar")
    (read,) = read_logged_file(tmp_path / "log", wanted=[channel])
    assert [name for name in read.channels.columns if "time" not in name] == [channel]
    np.testing.assert_allclose(read.channels[channel], table["P2"], rtol=SAMPLES[kind].rounding, atol=0.0)
    assert len([name for name in read.unread if name.split(" ")[0] in ("P1", "pos")]) == 2
    (nothing,) = read_logged_file(tmp_path / "log", wanted=["no such channel"])
    assert nothing.channels.empty
    assert {name.split(" ")[0] for name in nothing.unread} >= set(table.columns)


@KINDS
def test_the_content_decides_the_format_also_within_gzip(tmp_path: Path, kind: str) -> None:
    plain, zipped = tmp_path / "log.txt", tmp_path / "zipped.txt"
    write_sample(kind, plain, 40)
    found = format_of(plain)
    assert found.name == SAMPLES[kind].format
    assert format_of(plain, found.configured) == found
    if kind != "csv_gz":
        zipped.write_bytes(gzip.compress(plain.read_bytes()))
        assert format_of(zipped) == found
        assert len(read_logged_file(zipped)[0].channels) == 40


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("mdf4", "reading MDF4 needs asammdf, which is not installed; "),
        ("tdms", "reading TDMS needs npTDMS, which is not installed; "),
        ("hdf5", "reading HDF5 needs h5py, which is not installed; "),
        ("excel", "reading Excel workbooks needs openpyxl, which is not installed; "),
        ("matlab73", "reading MATLAB 7.3 needs h5py, which is not installed; "),
    ],
)
def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, message: str) -> None:
    write_sample(kind, tmp_path / "log", 40)
    library = FORMATS[SAMPLES[kind].format].needs
    assert library is not None
    monkeypatch.setitem(sys.modules, library.module, None)
    with pytest.raises(RecordingError, match=rf'^{message}pip install "cylinder-friction\[{library.extra}\]"$'):
        read_logged_file(tmp_path / "log")


def test_an_unknown_format_lists_the_known_ones(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("t,x\n0,1\n")
    with pytest.raises(ValueError, match="format 'xlsx' is not known; expected auto or one of csv, matlab, mdf"):
        read_logged_file(tmp_path / "log", "xlsx")


@pytest.fixture
def little_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(isolated, "LIMIT_S", 5.0)


def is_tables_or_refusal(path: Path, file_format: str, options: CsvOptions | None = None) -> None:
    try:
        tables = read_logged_file(path, file_format, options or CsvOptions())
    except RecordingError:
        return
    for table in tables:
        assert isinstance(table, LoggedTable)
        assert isinstance(table.channels, pd.DataFrame)


@pytest.mark.usefixtures("little_patience")
@pytest.mark.parametrize("file_format", ["auto", *SETTINGS])
@settings(calm, max_examples=60)
@given(content=st.binary(min_size=1, max_size=300))
@example(content=b"MDF     4.10    ")
@example(content=b"TDSm" + bytes(24))
@example(content=b"PAR1PAR1")
@example(content=b"\x89HDF\r\n\x1a\n")
@example(content=b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
def test_any_bytes(tmp_path: Path, file_format: str, content: bytes) -> None:
    (tmp_path / "log").write_bytes(content)
    is_tables_or_refusal(tmp_path / "log", file_format)


@settings(calm, max_examples=300)
@given(
    content=st.text(alphabet="019.,;:-+eE/ \t|\"'#abn[]°\r\n", max_size=120),
    delimiter=st.sampled_from(["auto", ",", ";", "\t", "whitespace"]),
    decimal=st.sampled_from(["auto", ".", ","]),
    header=st.sampled_from(["auto", "none", "names", "names_units"]),
)
def test_any_text_under_any_options(tmp_path: Path, content: str, delimiter: str, decimal: str, header: str) -> None:
    (tmp_path / "log").write_bytes(content.encode() + b"\n")
    is_tables_or_refusal(tmp_path / "log", "csv", CsvOptions(delimiter, decimal, header=header))


@pytest.mark.usefixtures("little_patience")
@KINDS
@settings(calm, max_examples=60)
@given(data=st.data())
def test_a_damaged_file(tmp_path: Path, kind: str, data: st.DataObject) -> None:
    whole = tmp_path / f"{kind}.whole"
    if not whole.exists():
        write_sample(kind, whole, 40)
    content = bytearray(whole.read_bytes())
    # Headers are where damage does most; half of it falls there.
    size = data.draw(st.sampled_from([len(content), min(len(content), 1024)]))
    places = st.tuples(st.integers(0, size - 1), st.integers(0, 255))
    for place, byte in data.draw(st.lists(places, max_size=6)):
        content[place] = byte
    end = data.draw(st.one_of(st.just(len(content)), st.integers(1, len(content))))
    (tmp_path / "log").write_bytes(content[:end])
    is_tables_or_refusal(tmp_path / "log", "auto")


@pytest.mark.parametrize("kind", ["matlab5", "matlab73", "mdf4", "hdf5", "parquet", "excel"])
def test_a_file_cut_in_half_is_refused_and_says_so(tmp_path: Path, kind: str) -> None:
    write_sample(kind, tmp_path / "log")
    content = (tmp_path / "log").read_bytes()
    (tmp_path / "log").write_bytes(content[: len(content) // 2])
    with pytest.raises(RecordingError, match="damaged"):
        read_logged_file(tmp_path / "log")

"""What holds for every format: one recording is written to each and read back, whole or damaged."""

import gzip
import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.formats import isolated
from cylinder_friction.recordings.formats.format import LoggedTable, open_source
from cylinder_friction.recordings.formats.reading import FORMATS, format_of, read_logged_file
from cylinder_friction.recordings.recording import RecordingError
from format_writers import SAMPLES, synthetic, write_sample

_, UNITS = synthetic()
KINDS = pytest.mark.parametrize("kind", SAMPLES)


def test_every_format_has_a_sample_and_a_row_in_the_guide() -> None:
    assert {sample.format for sample in SAMPLES.values()} == set(FORMATS)
    guide = (Path(__file__).parents[3] / "docs/logger-files.md").read_text(encoding="utf-8")
    assert [name for name in FORMATS if f"| `{name}` |" not in guide] == []


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
    found = format_of(open_source(plain).head)
    assert found.name == SAMPLES[kind].format
    if kind != "csv_gz":
        zipped.write_bytes(gzip.compress(plain.read_bytes()))
        assert format_of(open_source(zipped).head) == found
        assert len(read_logged_file(zipped)[0].channels) == 40


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for kind, library, extra, message in (
        ("mdf4", "asammdf", "mdf", "an MDF file needs asammdf"),
        ("matlab73", "h5py", "hdf5", "a MATLAB 7.3 file needs h5py"),
    ):
        write_sample(kind, tmp_path / "log", 40)
        monkeypatch.setitem(sys.modules, library, None)
        install = rf'which is not installed; pip install "cylinder-friction\[{extra}\]"$'
        needs, source = FORMATS[SAMPLES[kind].format], open_source(tmp_path / "log")
        with pytest.raises(RecordingError, match=f"^reading {message}, {install}"):
            _ = needs.refuse_missing_library() if needs.library else needs.read(source, None)


@KINDS
@settings(derandomize=True, deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_file_gives_tables_or_a_refusal(tmp_path: Path, kind: str, data: st.DataObject) -> None:
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
    with suppress(RecordingError), pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolated, "LIMIT_S", 5.0)
        assert all(isinstance(table, LoggedTable) for table in read_logged_file(tmp_path / "log"))


@pytest.mark.parametrize("kind", ["matlab5", "matlab73", "mdf4", "hdf5", "parquet", "excel"])
def test_a_file_cut_in_half_is_refused_and_says_so(tmp_path: Path, kind: str) -> None:
    write_sample(kind, tmp_path / "log")
    content = (tmp_path / "log").read_bytes()
    (tmp_path / "log").write_bytes(content[: len(content) // 2])
    with pytest.raises(RecordingError, match="damaged"):
        read_logged_file(tmp_path / "log")


BINARY = bytes(range(256)) * 4


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("log.csv", b"", "the file is empty: 0 bytes"),
        ("log.csv", b"PK\x03\x04rest", r"is a ZIP file: unpack it; of a spreadsheet save .* CSV; expected one of csv"),
        ("log.csv", b"\xd0\xcf\x11\xe0\xa1\xb1", "is an old Excel or Word file"),
        ("log.csv", b"|CF,2,1,1;|CK,1,3,1,1;\n", "is an imc FAMOS recording: export it as text .ASCII, CSV.; expected"),
        ("log.csv", b"TDSh\x0e\0\0\0", r"is the index of a TDMS file: take the \.tdms file itself"),
        ("log.asc", b"date Sat Mar 14 08:15:00 2026\nbase hex\n", "is a trace of CAN frames .ASC.: export its signals"),
        ("log.csv", BINARY, r"neither text nor a known binary log: it begins with b'\\x00\\x01"),
        ("log.csv", b"\x1f\x8b\x08\0\0\0\0\0\0\0\xff\xff", "its gzip cannot be unpacked: .*; the file is damaged or c"),
    ],
)
def test_what_is_no_log_is_refused_by_name(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=message):
        read_logged_file(tmp_path / name)


def test_what_cannot_be_opened_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be opened: No such file"):
        read_logged_file(tmp_path / "gone.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path, tmp_path / "pipe.csv", Path("/dev/zero")):
        with pytest.raises(RecordingError, match="is no regular file; copy what comes from it into one"):
            read_logged_file(path)

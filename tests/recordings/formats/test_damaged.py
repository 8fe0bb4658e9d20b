"""Whatever bytes a file holds: tables, or the project's own error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import format_writers
from cylinder_friction.recordings.formats import isolated
from cylinder_friction.recordings.formats.detect import FORMATS
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

# Damage that hangs a library costs its time limit: examples stay the same ones.
calm = settings(derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(autouse=True)
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


@pytest.mark.parametrize("file_format", ["auto", *FORMATS])
@settings(calm, max_examples=60)
@given(content=st.binary(min_size=1, max_size=300))
@example(content=b"MDF     4.10    ")
@example(content=b"TDSm" + bytes(24))
@example(content=b"PAR1PAR1")
@example(content=b"\x89HDF\r\n\x1a\n")
@example(content=b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
def test_any_bytes(tmp_path: Path, file_format: str, content: bytes) -> None:
    path = tmp_path / "log"
    path.write_bytes(content)
    is_tables_or_refusal(path, file_format)


@settings(calm, max_examples=300)
@given(
    content=st.text(alphabet="019.,;:-+eE/ \t|\"'#abn[]°\r\n", max_size=120),
    delimiter=st.sampled_from(["auto", ",", ";", "\t", "whitespace"]),
    decimal=st.sampled_from(["auto", ".", ","]),
    header=st.sampled_from(["auto", "none", "names", "names_units"]),
)
def test_any_text_under_any_options(tmp_path: Path, content: str, delimiter: str, decimal: str, header: str) -> None:
    path = tmp_path / "log"
    path.write_bytes(content.encode() + b"\n")
    is_tables_or_refusal(path, "csv", CsvOptions(delimiter, decimal, header=header))


@pytest.mark.parametrize("kind", format_writers.WRITERS)
@settings(calm, max_examples=60)
@given(data=st.data())
def test_a_damaged_file(tmp_path: Path, kind: str, data: st.DataObject) -> None:
    table, units = format_writers.synthetic(40)
    path = tmp_path / "log"
    whole = tmp_path / f"{kind}.whole"
    if not whole.exists():
        format_writers.WRITERS[kind](whole, table, units)
    content = bytearray(whole.read_bytes())
    # Headers are where damage does most; half of it falls there.
    size = data.draw(st.sampled_from([len(content), min(len(content), 1024)]))
    places = st.tuples(st.integers(0, size - 1), st.integers(0, 255))
    for place, byte in data.draw(st.lists(places, max_size=6)):
        content[place] = byte
    end = data.draw(st.one_of(st.just(len(content)), st.integers(1, len(content))))
    path.write_bytes(content[:end])
    is_tables_or_refusal(path, "auto")


@pytest.mark.parametrize("kind", ["matlab5", "matlab73", "mdf4", "hdf5", "parquet"])
def test_a_file_cut_in_half_is_refused_and_says_so(tmp_path: Path, kind: str) -> None:
    table, units = format_writers.synthetic()
    path = tmp_path / "log"
    format_writers.WRITERS[kind](path, table, units)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(RecordingError, match="damaged"):
        read_logged_file(path)

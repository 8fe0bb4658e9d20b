import os
from pathlib import Path

import pytest

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

BINARY = bytes(range(256)) * 4


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("log.csv", b"", "the file is empty: 0 bytes"),
        ("log.csv", b"PK\x03\x04rest", r"is a ZIP file: unpack it; of a spreadsheet save .* CSV; expected one of csv"),
        ("log.csv", b"\xd0\xcf\x11\xe0\xa1\xb1", "is an old Excel or Word file"),
        ("log.csv", b"|CF,2,1,1;|CK,1,3,1,1;\n", "is an imc FAMOS recording: export it as text .ASCII, CSV.; expected"),
        ("log.csv", b"TDSh\x0e\0\0\0", r"is the index of a TDMS file: take the \.tdms file itself"),
        ("log.csv", BINARY, r"neither text nor a known binary log: it begins with b'\\x00\\x01"),
        ("log.csv", b"\x1f\x8b\x08\0\0\0\0\0\0\0\xff\xff", "its gzip cannot be unpacked: .*; the file is damaged or c"),
        ("rec.svdx", BINARY, "neither text .*; if it is a TwinCAT Scope's, export it as CSV with a time column for ea"),
        ("pda.DAT", BINARY, "neither text .*; if it is of iba, extract it as ASCII or TDMS; if of imc, export it as t"),
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

"""The formats that are read, and how a file shows which of them it has."""

from pathlib import Path

from cylinder_friction.recordings.formats import delimited, excel, hdf5, matlab, mdf, parquet, tdms
from cylinder_friction.recordings.formats.format import Format
from cylinder_friction.recordings.formats.source import GZIP, read_head
from cylinder_friction.recordings.formats.text import is_text
from cylinder_friction.recordings.recording import RecordingError

FORMATS = {
    each.name: each
    for each in (
        delimited.FORMAT,
        matlab.FORMAT,
        mdf.FORMAT,
        tdms.FORMAT,
        hdf5.FORMAT,
        matlab.FORMAT_73,  # HDF5 too, behind a block with MATLAB's name
        parquet.FORMAT,
        excel.FORMAT,
    )
}
"""Every format by its name."""

SETTINGS = tuple(dict.fromkeys(each.configured for each in FORMATS.values()))
"""What ``format`` may be in a configuration, beside ``auto``."""

_OTHERS = {
    b"PK": "a ZIP file: unpack it; of a spreadsheet save the table as .xlsx or CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel or Word file: save the table as .xlsx or CSV",
    b"|CF,": "an imc FAMOS recording: export it as text (ASCII, CSV)",
    b"%PDF": "a PDF: export the table as CSV",
    GZIP: "a gzip within a gzip: unpack it once",
    b"BZh": "packed with bzip2: unpack it, or pack it with gzip",
    b"\xfd7zXZ": "packed with xz: unpack it, or pack it with gzip",
    b"\x28\xb5\x2f\xfd": "packed with zstd: unpack it, or pack it with gzip",
    b"7z\xbc\xaf": "packed with 7-Zip: unpack it, or pack it with gzip",
    b"TDSh": "the index of a TDMS file: take the .tdms file itself",
    b"SQLite format 3": "an SQLite database: export the table as CSV",
    b"\x89PNG": "a picture",
    b"\x93NUMPY": "a NumPy array: export the table as CSV",
    b"{": "JSON: export the table as CSV",
    b"<?xml": "XML: export the table as CSV",
    b"<html": "a web page: export the table as CSV",
    b"<!DOCTYPE": "a web page: export the table as CSV",
}
_OWN_FILES = {
    (".svdx", ".svd", ".svb"): "if it is a TwinCAT Scope's, export it as CSV with a time column for each sample time",
    (".dat",): "if it is of iba, extract it as ASCII or TDMS; if of imc, export it as text (ASCII, CSV)",
    (".raw",): "if it is of imc, export it as text (ASCII, CSV)",
    (".bin",): "if it is catman's, export it as text (ASCII)",
    (".blf",): "if it is a trace of a bus, decode it with the bus's database and save the signals as MDF 4",
}
"""Endings of what measurement programs write for themselves, and what they export that is read here."""


def format_of(path: Path, setting: str = "auto", head: bytes = b"") -> Format:
    """Return the format of a file, by its first bytes (its ``head``) and what the configuration calls it.

    Raises:
        RecordingError: The file cannot be opened, or is of none of these formats.
        ValueError: The setting is not known.
    """
    if setting not in ("auto", *SETTINGS):
        raise ValueError(f"format {setting!r} is not known; expected auto or one of {', '.join(SETTINGS)}")
    head = head or read_head(path).content
    possible = [each for each in FORMATS.values() if setting in ("auto", each.configured)]
    found = [each for each in possible if head.startswith(each.starts)] or [
        each for each in possible if each.fits and each.fits(head)
    ]
    if found or setting != "auto":
        return (found or possible)[0]
    for start, name in _OTHERS.items():
        if head.startswith(start):
            raise _refusal(f"is {name}", path)
    if not is_text(head):
        raise _refusal(f"is neither text nor a known binary log: it begins with {head[:8]!r}", path)
    return delimited.FORMAT


def _refusal(problem: str, path: Path) -> RecordingError:
    """Return the error for a file of another format, with what to export in place of a logger's own file."""
    advice = next((f"; {text}" for endings, text in _OWN_FILES.items() if path.suffix.lower() in endings), "")
    return RecordingError(f"{problem}; expected one of {', '.join(SETTINGS)}{advice}")

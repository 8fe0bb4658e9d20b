"""Which format a file has, by its content."""

import codecs

from cylinder_friction.recordings.formats.source import GZIP
from cylinder_friction.recordings.recording import RecordingError

FORMATS = ("csv", "matlab", "mdf", "tdms", "hdf5", "parquet", "excel")
"""Every format by the name it goes by in the configuration; ``csv`` is any text table."""

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}

_STARTS = {
    b"MATLAB 5.0 MAT-file": "matlab",
    b"MATLAB 7.3 MAT-file": "matlab",
    b"MDF     ": "mdf",
    b"UnFinMF ": "mdf",
    b"TDSm": "tdms",
    b"PAR1": "parquet",
}
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


def format_of(head: bytes) -> str:
    """Return the format of a file that begins with ``head`` (unpacked); raises ``RecordingError`` if it has none."""
    for start, name in _STARTS.items():
        if head.startswith(start):
            return name
    # HDF5 may leave room for a user's block of 512 bytes or a power of two times that.
    if any(head[offset:].startswith(HDF5_SIGNATURE) for offset in (0, 512, 1024, 2048, 4096, 8192)):
        return "hdf5"
    if head.startswith(b"PK") and b"xl/" in head and b"xl/workbook.bin" not in head:
        return "excel"
    for start, name in _OTHERS.items():
        if head.startswith(start):
            raise RecordingError(f"is {name}; expected one of {', '.join(FORMATS)}")
    if not _is_text(head):
        raise RecordingError(
            f"is neither text nor a known binary log: it begins with {head[:8]!r}; expected one of {', '.join(FORMATS)}"
        )
    return "csv"


def advice(ending: str) -> str:
    """Return what to export in place of a logger's own file, by the ending of its name; empty for others."""
    return next((f"; {text}" for endings, text in _OWN_FILES.items() if ending.lower() in endings), "")


def _is_text(head: bytes) -> bool:
    """A text may end in zero bytes, which a logger that loses power leaves, and hold a rare damaged character."""
    if any(head.startswith(mark) for mark in BYTE_ORDER_MARKS if mark != codecs.BOM_UTF8):
        return True
    body = head.rstrip(b"\0")
    odd = len(body) - len(body.translate(None, bytes(range(9)) + bytes(range(14, 26)) + bytes(range(27, 32)) + b"\x7f"))
    return bool(body) and b"\0" not in body and odd <= 0.01 * len(body)

"""One call for every format."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.recordings.formats.delimited import read_delimited
from cylinder_friction.recordings.formats.detect import FORMATS, format_of
from cylinder_friction.recordings.formats.hdf5 import read_hdf5
from cylinder_friction.recordings.formats.libraries import guarded
from cylinder_friction.recordings.formats.matlab import read_matlab
from cylinder_friction.recordings.formats.mdf import read_mdf
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.formats.parquet import read_parquet
from cylinder_friction.recordings.formats.source import open_source
from cylinder_friction.recordings.formats.tdms import read_tdms
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection
    from pathlib import Path

    from cylinder_friction.recordings.formats.source import FileSource
    from cylinder_friction.recordings.logged import LoggedTable

_BINARY: dict[str, Callable[[FileSource, Collection[str] | None], list[LoggedTable]]] = {
    "matlab": read_matlab,
    "mdf": read_mdf,
    "tdms": read_tdms,
    "hdf5": read_hdf5,
    "parquet": read_parquet,
}
_AUTOMATIC = CsvOptions()
_IN_WORDS = {
    "csv": "a text table",
    "matlab": "a MATLAB file",
    "mdf": "an MDF file",
    "tdms": "a TDMS file",
    "hdf5": "an HDF5 file",
    "parquet": "a Parquet file",
}


def read_logged_file(
    path: Path,
    file_format: str = "auto",
    csv: CsvOptions = _AUTOMATIC,
    wanted: Collection[str] | None = None,
) -> list[LoggedTable]:
    """Returns what a logger's file holds, one table for channels that share their rows.

    Args:
        path: The file, gzipped or not.
        file_format: One of ``FORMATS``, or ``auto`` to go by the content.
        csv: How text is to be read; by default everything is found out.
        wanted: Names of the channels to load; the others are only named, as ``unread``. None loads all.

    Raises:
        RecordingError: The file cannot be opened or read, is damaged, or holds no channels with rows.
        ValueError: The format is not known.
    """
    if file_format not in ("auto", *FORMATS):
        raise ValueError(f"format {file_format!r} is not known; expected auto or one of {', '.join(FORMATS)}")
    source = open_source(path)
    file_format = format_of(source.head) if file_format == "auto" else file_format
    with guarded(_IN_WORDS[file_format]):
        tables = [read_delimited(source, csv, wanted)] if file_format == "csv" else _BINARY[file_format](source, wanted)
    if not any(len(table.channels) or table.unread for table in tables):
        raise RecordingError("holds no channel with a row; expected a table of numbers")
    return tables

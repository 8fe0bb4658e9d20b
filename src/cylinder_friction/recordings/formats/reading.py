"""One call for every format."""

from collections.abc import Collection
from pathlib import Path

from cylinder_friction.recordings.formats.delimited import read_delimited
from cylinder_friction.recordings.formats.detect import FORMATS, HDF5_SIGNATURE, advice, format_of
from cylinder_friction.recordings.formats.isolated import read_isolated
from cylinder_friction.recordings.formats.libraries import guarded
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.formats.parquet import read_parquet
from cylinder_friction.recordings.formats.source import open_source, read_head
from cylinder_friction.recordings.recording import RecordingError

_AUTOMATIC = CsvOptions()


def read_logged_file(
    path: Path,
    file_format: str = "auto",
    csv: CsvOptions = _AUTOMATIC,
    wanted: Collection[str] | None = None,
) -> list[LoggedTable]:
    """Return what a logger's file holds, one table for channels that share their rows.

    Args:
        file_format: One of ``FORMATS``, or ``auto`` to go by the content.
        csv: How text is to be read; by default everything is found out.
        wanted: Names of the channels to load; the others are only named, as ``unread``. None loads all.

    Raises:
        RecordingError: The file cannot be opened or read, is damaged, or holds no channels with rows.
        ValueError: The format is not known.
    """
    if file_format not in ("auto", *FORMATS):
        raise ValueError(f"format {file_format!r} is not known; expected auto or one of {', '.join(FORMATS)}")
    head = read_head(path)
    try:
        kind = format_of(head) if file_format == "auto" else file_format
    except RecordingError as error:
        raise RecordingError(f"{error}{advice(path.suffix)}") from None
    if kind == "matlab" and (head[512:].startswith(HDF5_SIGNATURE) or head.startswith(b"MATLAB 7.3")):
        kind = "matlab73"
    if kind == "csv":
        source = open_source(path)
        with guarded("a text table"):
            tables = read_delimited(source, csv, wanted)
    elif kind == "parquet":  # hundreds of hours come this way, and Arrow stands damage
        source = open_source(path)
        with guarded("a Parquet file"):
            tables = read_parquet(source, wanted)
    else:
        tables = read_isolated(path, kind, wanted)
    if not any(len(table.channels) or table.unread for table in tables):
        raise RecordingError("holds no channel with a row; expected a table of numbers")
    return tables

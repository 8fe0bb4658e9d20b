"""One reader a file format. A new format is a class with ``read`` and a line in ``READERS``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from cylinder_friction.recordings.csv_reader import CsvReader
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pandas as pd


class Reader(Protocol):
    """Reads a logger's file as it is: channels by the logger's names, in the logger's units, one row a sample."""

    def read(self, path: Path) -> pd.DataFrame:
        """Returns the channels; raises ``RecordingError`` if the file cannot be read."""


READERS: dict[str, Callable[..., Reader]] = {"csv": CsvReader}
"""Format name to what makes its reader from the format's options."""


def reader_for(file_format: str, **options: Any) -> Reader:
    """Returns the reader of a format.

    Raises:
        RecordingError: There is no reader of that format.
    """
    if file_format not in READERS:
        raise RecordingError(f"format {file_format!r} is not known; expected one of {', '.join(READERS)}")
    return READERS[file_format](**options)

"""Definition of a file format: how it is recognized, its reader, and the tables that the reader returns."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.extras import not_installed
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import Start
from cylinder_friction.wording import in_brief

Column = tuple[str, NDArray[Any]]
"""A channel's name and values."""


@dataclass(frozen=True)
class LoggedTable:
    """Channels of a file that share their rows, with the logger's names and units."""

    # One column per channel: numbers, time stamps (``datetime64[ns]``), or text if a cell is not a number. A missing
    # value is NaN. Names are stripped of blanks and may occur twice.
    channels: pd.DataFrame
    # The unit that the file itself states, by channel; a channel without one is absent
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = ""  # Name of the table or group in the file; empty if the file has only one
    unread: tuple[str, ...] = ()  # Names of channels that were not wanted
    notes: tuple[str, ...] = ()  # Repairs by the reader, one sentence each, for example a last line that was cut off
    start: Start | None = None  # When its clock was at 0 s, as the file states it outside the rows
    utc: bool = False  # Whether its time stamps are in UTC; otherwise their time zone is not stated
    # Reads the parts after this one, with the same channels, if the table is too long to be read at once
    more: Callable[[], Iterator[LoggedTable]] | None = None
    parts: int = 1  # Approximate number of parts


def named_columns(columns: Sequence[Column]) -> pd.DataFrame:
    """Make a table of columns without a copy; names may occur twice or be damaged."""
    table = pd.DataFrame(dict(enumerate(values for _, values in columns)), copy=False)
    table.columns = pd.Index([name for name, _ in columns], dtype=object)
    return table


@dataclass(frozen=True)
class Format:
    """One file format. A module beside this one defines it, and ``reading.FORMATS`` lists it."""

    name: str
    what: str  # Name in messages: ``an HDF5 file``
    # Reads the wanted channels of a ``FileSource``. ``takes`` names its further arguments: ``csv`` (``CsvOptions``),
    # ``rows`` (a longer table is read in parts of this size; None: whole), ``database`` (path of a DBC file or None)
    read: Callable[..., list[LoggedTable]]
    takes: tuple[str, ...] = ()
    starts: tuple[bytes, ...] = ()  # Bytes that its files begin with
    fits: Callable[[bytes], bool] | None = None  # Recognizes the format by a file's head, in addition to ``starts``
    library: str = ""  # The library that only this format needs, and the extra of this package that brings it
    extra: str = ""
    # Name in messages of the library that damaged files crash. Only such formats are read in an isolated process
    crashes: str = ""

    def refuse_missing_library(self) -> None:
        """Raise ``RecordingError`` with the command that installs the library this format needs."""
        if self.library and find_spec(self.library) is None:
            raise RecordingError(f"reading {self.what} needs {not_installed(self.library, self.extra)}")


@contextmanager
def guarded(what: str) -> Iterator[None]:
    """Convert a library's errors on a damaged file to ``RecordingError``, and suppress its warnings."""
    quiet = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except RecordingError:
        raise
    except Exception as error:
        message = f"{type(error).__name__}: {in_brief(error, 300)}".removesuffix(": ")
        raise RecordingError(
            f"cannot be read as {what} ({message}); it is damaged, cut off or of another kind"
        ) from None
    finally:
        logging.disable(quiet)

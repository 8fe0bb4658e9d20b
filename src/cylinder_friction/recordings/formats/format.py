"""Definition of a file format: how it is recognized, the bytes that its reader gets and the tables that it returns."""

from __future__ import annotations

import codecs
import gzip
import io
import logging
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.extras import not_installed
from cylinder_friction.recordings.recording import RecordingError, Start
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


HEAD_SIZE = 65536
"""Number of first bytes from which a file's format is detected."""
MOST_UNPACKED = 500 * 10**6
"""Largest gzipped file that is read, unpacked in memory [bytes]."""
GZIP = b"\x1f\x8b"
BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


@dataclass(frozen=True)
class FileSource:
    """The source of a reader's bytes: a path, or the unpacked bytes of a gzipped file."""

    origin: Path | bytes
    head: bytes  # The first ``HEAD_SIZE`` bytes
    size: int  # Size of the whole file, unpacked [bytes]

    def handle(self) -> str | io.BytesIO:
        """Return the path as text, or the bytes as a file, for a library to open."""
        return io.BytesIO(self.origin) if isinstance(self.origin, bytes) else str(self.origin)

    def opened(self) -> BinaryIO:
        """Open the bytes as a file that the caller closes, because libraries leave damaged files open."""
        return io.BytesIO(self.origin) if isinstance(self.origin, bytes) else self.origin.open("rb")

    @cached_property
    def all_bytes(self) -> bytes:
        return self.origin if isinstance(self.origin, bytes) else self.origin.read_bytes()


def open_source(path: Path) -> FileSource:
    """Open a file, unpacked if it is gzipped; refuse one that cannot be opened, unpacked or is empty."""
    if path.exists() and not path.is_file():
        raise RecordingError("is no regular file; copy what comes from it into one")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_SIZE)
        if not head:
            raise RecordingError("the file is empty: 0 bytes; expected a log")
        if not head.startswith(GZIP):
            return FileSource(path, head, path.stat().st_size)
        with gzip.open(path) as unpacked:
            content = unpacked.read(MOST_UNPACKED + 1)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise RecordingError(
            f"its gzip cannot be unpacked: {error}; the file is damaged or cut off; copy it again"
        ) from None
    except OSError as error:
        raise RecordingError(f"cannot be opened: {error.strerror or error}") from None
    if len(content) > MOST_UNPACKED:
        raise RecordingError(
            f"unpacks to more than {MOST_UNPACKED / 1e6:.0f} MB; unpack it, so that it can be read in parts"
        )
    return FileSource(content, content[:HEAD_SIZE], len(content))


def is_text(head: bytes) -> bool:
    """Check whether bytes are text, which may contain rare damaged characters and end with zero bytes (power loss)."""
    if any(head.startswith(mark) for mark in BYTE_ORDER_MARKS if mark != codecs.BOM_UTF8):
        return True
    body = head.rstrip(b"\0")
    odd = len(body) - len(body.translate(None, bytes(range(9)) + bytes(range(14, 26)) + bytes(range(27, 32)) + b"\x7f"))
    return bool(body) and b"\0" not in body and odd <= 0.01 * len(body)


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

"""Definition of a file format: how it is recognized, the bytes that its reader gets and the tables that it returns."""

from __future__ import annotations

import codecs
import gzip
import io
import logging
import os
import re
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
import pyarrow as pa
from numpy.typing import NDArray

from cylinder_friction.extras import not_installed
from cylinder_friction.recordings.recording import RecordingError, Start, expect
from cylinder_friction.wording import in_brief

Column = tuple[str, NDArray[Any]]  # A channel's name and values


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
    master: str = ""  # Channel that stamps the rows, if the file states it
    start: Start | None = None  # When its clock was at 0 s, as the file states it outside the rows
    utc: bool = False  # Whether its time stamps are in UTC; otherwise their time zone is not stated
    rate_hz: float | None = None  # Rate of its rows, if the file states it outside the rows [Hz]
    # Reads the parts after this one, with the same channels, if the table is too long to be read at once
    more: Callable[[], Iterator[LoggedTable]] | None = None
    parts: int = 1  # Approximate number of parts


@dataclass(frozen=True)
class CsvOptions:
    """Options for reading a text file; everything that is ``auto`` is detected."""

    delimiter: str = "auto"  # Delimiter of values: one character, ``whitespace`` (runs of blanks and tabs), or ``auto``
    decimal: str = "auto"  # Decimal sign: ``.``, ``,`` or ``auto``
    encoding: str = "auto"  # Character encoding, for example ``utf-8`` or ``cp1252``, or ``auto``
    # ``names_units`` (a line of names and a line of units are right above the rows), or ``auto``
    header: str = "auto"

    def __post_init__(self) -> None:
        one = self.delimiter in ("auto", "whitespace") or (len(self.delimiter) == 1 and self.delimiter not in '\r\n"')
        expect(one, "delimiter", "one character, 'whitespace' or 'auto'", self.delimiter)
        expect(self.decimal in ("auto", ".", ","), "decimal", "'.', ',' or 'auto'", self.decimal)
        expect(self.header in ("auto", "names_units"), "header", "one of auto, names_units", self.header)
        try:
            codecs.lookup("utf-8" if self.encoding == "auto" else self.encoding)
        except LookupError:
            expect(False, "encoding", "one that Python knows, such as utf-8 or cp1252, or 'auto'", self.encoding)


AUTOMATIC = CsvOptions()


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
    library: str = ""  # The library that only this format needs; this package's extra of the format's name brings it
    # Name in messages of the library that damaged files crash. Only such formats are read in an isolated process
    crashes: str = ""

    def refuse_missing_library(self) -> None:
        """Raise ``RecordingError`` with the command that installs the library this format needs."""
        if self.library and find_spec(self.library) is None:
            raise RecordingError(f"reading {self.what} needs {not_installed(self.library, self.name)}")


HEAD_SIZE = 65536  # Number of first bytes from which a file's format is detected
MOST_INDIVISIBLE = 256 * 10**6  # Largest text that is read whole if it cannot be read in parts [bytes]
MOST_UNPACKED = 500 * 10**6  # Largest gzipped file that is read, unpacked in memory [bytes]
GZIP = b"\x1f\x8b"
_TAIL = 1 << 16
_GBK = re.compile(rb"(?=.*(?:[\xa1-\xf7][\xa1-\xfe]){2})(?:[\x00-\x7f]|[\xa1-\xf7][\xa1-\xfe])*[\xa1-\xf7]?", re.DOTALL)
"""A Chinese text, which no cp1252 text is: letters beyond ASCII come in pairs, and two pairs in a row."""
_BLOCK = 1 << 20  # Bytes that are read at once
_EOF = re.compile(rb"(?<=[\r\n])[\s;,|\"]*EOF(?:[\s;,|\"]|EOF)*\Z")
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


@dataclass(frozen=True)
class Text:
    """A text as UTF-8."""

    file: Any  # A ``pyarrow.NativeFile``: the file itself, or its characters in memory
    start: int  # Byte where the text begins, after a byte order mark
    end: int  # Byte where its last whole line ends, without the line end
    notes: tuple[str, ...]  # What was left out, one sentence each


def open_text(source: FileSource, encoding: str) -> Text:
    """Open a text up to its last whole line.

    A last line without a line end is left out, because its last number may be cut off. Zero bytes that a logger leaves
    when it loses power are left out, too. ``notes`` reports both. ``auto`` takes the encoding from the byte order mark;
    without one it is UTF-8, or GB 18030 or cp1252 if the first character beyond ASCII is not UTF-8.
    """
    mark = next((mark for mark in BYTE_ORDER_MARKS if source.head.startswith(mark)), b"")
    named = BYTE_ORDER_MARKS.get(mark, "utf-8") if encoding == "auto" else encoding
    try:
        if codecs.lookup(named).name in ("utf-8", "utf-8-sig", "ascii"):
            in_memory = isinstance(source.origin, bytes)
            file = pa.BufferReader(source.origin) if in_memory else pa.OSFile(os.fsencode(source.origin))
            _check_utf8(file)
            return _up_to_whole_line(file, len(mark) if mark == codecs.BOM_UTF8 else 0)
        if source.size > MOST_INDIVISIBLE:
            raise RecordingError(
                f"its characters are {named} and it has {source.size / 1e6:.0f} MB; only UTF-8 is read in parts, other "
                f"text whole, up to {MOST_INDIVISIBLE / 1e6:.0f} MB; save it as UTF-8, or split it"
            )
        text = source.all_bytes.decode(named, errors="replace" if named == "cp1252" else "strict")
    except UnicodeDecodeError as error:
        if encoding == "auto" and not mark and (source.head.isascii() or error.start < len(source.head)):
            return open_text(source, "gb18030" if _GBK.fullmatch(source.head) else "cp1252")
        raise RecordingError(
            f"its characters are not {named.upper()}: {error.reason} at byte {error.start}; name the right encoding, "
            "such as csv: {encoding: cp1252} in the mapping, or save it as UTF-8"
        ) from None
    return _up_to_whole_line(pa.BufferReader(text.removeprefix("\ufeff").encode(errors="replace")), 0)


def _check_utf8(file: Any) -> None:
    """Raise ``UnicodeDecodeError`` at the first byte that is not UTF-8; the last character may be cut off."""
    decoder, place = codecs.getincrementaldecoder("utf-8")(), 0
    while block := file.read(_BLOCK):
        try:
            decoder.decode(block)
        except UnicodeDecodeError as error:
            error.start += place
            raise
        place += len(block)


def _up_to_whole_line(file: Any, start: int) -> Text:
    notes: list[str] = []
    size, length = file.size(), _TAIL
    while True:
        begin = max(start, size - length)
        tail: bytes = file.read_at(size - begin, begin)
        body = tail.rstrip(b"\0\x1a")
        if begin == start or b"\n" in body or b"\r" in body:
            break
        length *= 16
    if (zeros := len(tail) - len(body)) > 1:
        notes.append(f"{zeros} zero bytes at its end were left out, as a logger leaves them that loses power")
    if body.rstrip(b' \t\n\r\f\v;,|"').endswith(b"EOF") and (match := _EOF.search(body)):
        body = body[: match.start()]  # a last line that only marks the end, perhaps in every cell
    whole = max(body.rfind(b"\n"), body.rfind(b"\r")) + 1
    if 0 < whole < len(body):
        cut = body[whole:][:80].decode(errors="replace")
        left = f"it was left out: {cut!r}; copy the file again if its end is missing"
        notes.append(f"its last line has no line end and may be cut in a number; {left}")
    end = begin + len(body[:whole].rstrip(b"\r\n"))
    if end <= start:
        raise RecordingError(
            "holds not one whole line; expected a line of names and one line per sample, each with its end"
        )
    return Text(file, start, end, tuple(notes))


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
            f"cannot be read as {what} ({message}); it is damaged, cut off or of another kind; copy it again from the "
            "logger, or export it anew"
        ) from None
    finally:
        logging.disable(quiet)

"""Open a file's bytes, unpacked if they are gzipped, and its text up to the end of its last whole line."""

import codecs
import gzip
import io
import re
import shutil
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, BinaryIO

import pyarrow as pa

from cylinder_friction.recordings.recording import RecordingError

HEAD_SIZE = 65536
"""Number of first bytes from which a file's format is detected."""
MOST_IN_MEMORY = 1 << 26
"""Largest gzipped file that is unpacked in memory [bytes]; a larger one is unpacked on disk."""
GZIP = b"\x1f\x8b"
BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
MOST_INDIVISIBLE = 256 * 10**6
"""Largest text that is read whole if it cannot be read in parts [bytes]."""
_TAIL = 1 << 16
_READ_AT_ONCE = 1 << 22  # Largest file that is held in memory [bytes]
_EOF = re.compile(rb"(?<=[\r\n])[\s;,|\"]*EOF(?:[\s;,|\"]|EOF)*\Z")


@dataclass(frozen=True)
class FileSource:
    """The source of a reader's bytes: a path, or the unpacked bytes of a gzipped file."""

    origin: Path | bytes
    head: bytes  # The first ``HEAD_SIZE`` bytes
    size: int  # Size of the whole file, unpacked [bytes]
    kept: Any = None  # Keeps the temporary file alive that ``origin`` names

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
    """Open a file, unpacked if it is gzipped; refuse one that cannot be opened, is empty, or is a damaged gzip file."""
    if path.exists() and not path.is_file():
        raise RecordingError("is no regular file; copy what comes from it into one")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_SIZE)
        source = _unpacked(path) if head.startswith(GZIP) else FileSource(path, head, path.stat().st_size)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise RecordingError(
            f"its gzip cannot be unpacked: {error}; the file is damaged or cut off; copy it again"
        ) from None
    except OSError as error:
        raise RecordingError(f"cannot be opened: {error.strerror or error}") from None
    if not source.head:
        raise RecordingError("the file is empty: 0 bytes; expected a log")
    return source


def _unpacked(path: Path) -> FileSource:
    with gzip.open(path) as file:
        content = file.read(MOST_IN_MEMORY)
        head = content[:HEAD_SIZE]
        if len(content) < MOST_IN_MEMORY:
            return FileSource(content, head, len(content))
        unpacked = NamedTemporaryFile()  # noqa: SIM115 - it is removed with the source
        unpacked.write(content)
        shutil.copyfileobj(file, unpacked, HEAD_SIZE)
        unpacked.flush()
        return FileSource(Path(unpacked.name), head, Path(unpacked.name).stat().st_size, unpacked)


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
    quote: str | bool  # Quotation mark around cells; False without one


def open_text(source: FileSource, encoding: str) -> Text:
    """Open a text up to its last whole line.

    A last line without a line end is left out, because its last number may be cut off. Zero bytes that a logger leaves
    when it loses power are left out, too. ``notes`` reports both. ``auto`` takes the encoding from the byte order mark;
    without one it is UTF-8, or cp1252 if the beginning is not UTF-8.

    Raises:
        RecordingError: The bytes are not text in that encoding, or there is no whole line.
    """
    mark = next((mark for mark in BYTE_ORDER_MARKS if source.head.startswith(mark)), b"")
    if encoding == "auto":
        encoding = BYTE_ORDER_MARKS.get(mark, "utf-8")
        try:
            codecs.getincrementaldecoder(encoding)().decode(source.head, final=len(source.head) >= source.size)
        except UnicodeDecodeError:
            encoding = encoding if mark else "cp1252"
    start = len(codecs.BOM_UTF8) if mark == codecs.BOM_UTF8 else 0
    if codecs.lookup(encoding).name in ("utf-8", "utf-8-sig", "ascii"):
        if not isinstance(source.origin, bytes) and source.size > _READ_AT_ONCE:
            return _ended(pa.OSFile(str(source.origin)), start, '"')
        content = source.all_bytes
        return _ended(pa.BufferReader(content), start, '"' if b'"' in content else False)
    if source.size > MOST_INDIVISIBLE:
        raise RecordingError(
            f"its characters are {encoding} and it has {source.size / 1e6:.0f} MB; only UTF-8 is read in parts, other "
            f"text whole, up to {MOST_INDIVISIBLE / 1e6:.0f} MB; save it as UTF-8, or split it"
        )
    try:
        text = source.all_bytes.decode(encoding, errors="replace" if encoding == "cp1252" else "strict")
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"its characters are not {encoding}: {error.reason} at position {error.start}; name the right encoding, or "
            "leave it to be found out (auto)"
        ) from None
    content = text.removeprefix("\ufeff").encode(errors="replace")
    return _ended(pa.BufferReader(content), 0, '"' if b'"' in content else False)


def _ended(file: Any, start: int, quote: str | bool) -> Text:
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
        notes.append(f"its last line has no line end and may be cut in a number; it was left out: {cut!r}")
    end = begin + len(body[:whole].rstrip(b"\r\n"))
    if end <= start:
        raise RecordingError(
            "holds not one whole line; expected a line of names and one line per sample, each with its end"
        )
    return Text(file, start, end, tuple(notes), quote)

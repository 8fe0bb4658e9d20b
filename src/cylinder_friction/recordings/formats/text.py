"""Characters of a text file, whatever their encoding, and where its last whole line ends."""

import codecs
import io
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from tempfile import NamedTemporaryFile
from typing import Any

import pyarrow as pa

from cylinder_friction.recordings.formats.source import MOST_IN_MEMORY, FileSource
from cylinder_friction.recordings.recording import RecordingError

BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}

_TAIL = 1 << 16
_BLOCK = 1 << 12
_READ_AT_ONCE = 1 << 22  # A file up to this size is held in memory [bytes]
_AROUND_EOF = b' \t\n\r\f\v;,|"'
_EOF = re.compile(rb"(?<=[\r\n])[\s;,|\"]*EOF(?:[\s;,|\"]|EOF)*\Z")


def is_text(head: bytes) -> bool:
    """Return whether bytes are text: it may end in zero bytes, after a power loss, and hold rare damaged characters."""
    if any(head.startswith(mark) for mark in BYTE_ORDER_MARKS if mark != codecs.BOM_UTF8):
        return True
    body = head.rstrip(b"\0")
    odd = len(body) - len(body.translate(None, bytes(range(9)) + bytes(range(14, 26)) + bytes(range(27, 32)) + b"\x7f"))
    return bool(body) and b"\0" not in body and odd <= 0.01 * len(body)


@dataclass(frozen=True)
class Text:
    """A text as UTF-8."""

    file: Any  # A ``pyarrow.NativeFile``: the file itself, or its characters in memory where they had to be converted
    start: int  # Where the text begins, behind a byte order mark [bytes]
    end: int  # Where its last whole line ends, less the line end [bytes]
    notes: tuple[str, ...]  # What was left out to get there
    quote: str | bool = '"'  # What stands around cells; False where nothing does


def open_text(source: FileSource, encoding: str) -> Text:
    """Return the text up to its last whole line.

    A last line without its end is left out, for its last number may be cut; so are the zero bytes that a logger leaves
    behind when it loses power. Both are reported in ``notes``. Under ``auto`` the encoding is that of the byte order
    mark, or UTF-8, or cp1252 if it cannot be UTF-8.

    Raises:
        RecordingError: The bytes are no text in that encoding, or not one line is whole.
    """
    mark = next((mark for mark in BYTE_ORDER_MARKS if source.head.startswith(mark)), b"")
    if encoding == "auto":
        encoding = BYTE_ORDER_MARKS[mark] if mark else ("utf-8" if _is_utf8(source) else "cp1252")
    if codecs.lookup(encoding).name not in ("utf-8", "utf-8-sig", "ascii"):
        large = source.size > MOST_IN_MEMORY
        return _ended(_rewritten(source, encoding) if large else pa.BufferReader(converted(source, encoding)), 0)
    start = len(codecs.BOM_UTF8) if mark == codecs.BOM_UTF8 else 0
    if not isinstance(source.origin, bytes) and source.size > _READ_AT_ONCE:
        return _ended(pa.OSFile(str(source.origin)), start)
    content = source.all_bytes
    return replace(_ended(pa.BufferReader(content), start), quote='"' if b'"' in content else False)


def convert_text(source: FileSource) -> Text:
    """Return a text that began as UTF-8 but is none further down.

    If there was no character beyond ASCII at first it is cp1252; otherwise it is damaged UTF-8, and its bad characters
    become question marks.
    """
    if source.head.isascii():
        return _ended(pa.BufferReader(converted(source, "cp1252")), 0)
    return _ended(pa.BufferReader(source.all_bytes.decode("utf-8-sig", errors="replace").encode()), 0)


def converted(source: FileSource, encoding: str) -> bytes:
    content = source.all_bytes
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "cp1252":
            raise RecordingError(
                f"its characters are not {encoding}: byte 0x{content[error.start]:02x} at position {error.start}; "
                "name the right encoding, or leave it to be found out (auto)"
            ) from None
        text = content.decode("latin-1")
    return text.removeprefix("\ufeff").encode(errors="replace")


def _rewritten(source: FileSource, encoding: str) -> Any:
    """Return what ``converted`` does as an open temporary file, of which memory holds a little at a time."""
    with NamedTemporaryFile() as file:
        try:
            with io.TextIOWrapper(source.opened(), encoding, newline="") as text:
                while block := text.read(1 << 20):
                    file.write(block.removeprefix("\ufeff").encode(errors="replace"))
        except UnicodeDecodeError as error:
            if encoding == "cp1252":
                return _rewritten(source, "latin-1")
            raise RecordingError(
                f"its characters are not {encoding}: {error.reason}; name the right encoding"
            ) from None
        file.flush()
        return pa.OSFile(file.name)


def _is_utf8(source: FileSource) -> bool:
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        decoder.decode(source.head, final=len(source.head) >= source.size)
    except UnicodeDecodeError:
        return False
    return True


def _ended(file: Any, start: int) -> Text:
    notes: list[str] = []
    size = file.size()
    body = _last_byte_but(file, start, size, b"\0\x1a")
    if size - body > 1:
        notes.append(f"{size - body} zero bytes at its end were left out, as a logger leaves them that loses power")
    body = _before_eof(file, start, body)
    end = _last_byte_but(file, start, body, b"\r\n")
    if end == body and body > start:
        # Where the last line begins is where the one before it ends.
        whole = _from_end(file, start, body, lambda tail: max(tail.rfind(b"\n"), tail.rfind(b"\r")) + 1)
        cut = file.read_at(min(body - whole, 80), whole).decode(errors="replace")
        if whole > start:
            notes.append(f"its last line has no line end and may be cut in a number; it was left out: {cut!r}")
        end = _last_byte_but(file, start, whole, b"\r\n")
    if end <= start:
        raise RecordingError(
            "holds not one whole line; expected a line of names and one line per sample, each with its end"
        )
    return Text(file, start, end, tuple(notes))


def _before_eof(file: Any, start: int, end: int) -> int:
    """Return where a text ends before a last line that only states its end: ``EOF``, perhaps in every cell."""
    begin = max(start, end - _TAIL)
    tail = file.read_at(end - begin, begin)
    ends = tail.rstrip(_AROUND_EOF).endswith(b"EOF")  # the expression below takes many times as long
    match = _EOF.search(tail) if ends else None
    return begin + match.start() if match else end


def _last_byte_but(file: Any, start: int, end: int, stripped: bytes) -> int:
    """Return where the text ends without the bytes ``stripped`` at its end."""
    return _from_end(file, start, end, lambda tail: len(tail.rstrip(stripped)))


def _from_end(file: Any, start: int, end: int, find: Callable[[bytes], int]) -> int:
    """Return the last place that ``find`` gives, which returns 0 for none; ``start`` if there is none."""
    while end > start:
        length = min(_BLOCK, end - start)
        if place := find(file.read_at(length, end - length)):
            return int(end - length + place)
        end -= length
    return start

"""A file's bytes, unpacked if they are gzipped."""

import gzip
import io
import shutil
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, BinaryIO, NamedTuple

from cylinder_friction.recordings.recording import RecordingError

HEAD_SIZE = 65536  # so many bytes are looked at to find out what a file is [bytes]

MOST_IN_MEMORY = 1 << 26  # a file whose bytes must be unpacked or rewritten to be read, is so up to this size [bytes]

GZIP = b"\x1f\x8b"


@dataclass(frozen=True)
class FileSource:
    """Where a reader finds its bytes: the path, or the unpacked bytes of a gzipped file."""

    origin: Path | bytes
    head: bytes  # The first ``HEAD_SIZE`` bytes
    size: int  # Of the whole [bytes]
    kept: Any = None  # What keeps a temporary file that ``origin`` names

    def handle(self) -> str | io.BytesIO:
        """Return what a library opens: the path as text, or the bytes as a file."""
        return io.BytesIO(self.origin) if isinstance(self.origin, bytes) else str(self.origin)

    def opened(self) -> BinaryIO:
        """Return the bytes as a file that the caller closes; libraries leave their own open over a damaged file."""
        return io.BytesIO(self.origin) if isinstance(self.origin, bytes) else self.origin.open("rb")

    @cached_property
    def all_bytes(self) -> bytes:
        return self.origin if isinstance(self.origin, bytes) else self.origin.read_bytes()


class Head(NamedTuple):
    """How a file begins."""

    content: bytes  # The first ``HEAD_SIZE`` bytes, unpacked
    zipped: bool  # Whether the file is gzipped


def read_head(path: Path) -> Head:
    """Read how a file begins; refuse what cannot be opened, is empty, or a damaged gzip."""
    if path.exists() and not path.is_file():
        raise RecordingError("is no regular file; copy what comes from it into one")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_SIZE)
    except OSError as error:
        raise RecordingError(f"cannot be opened: {error.strerror or error}") from None
    if not head:
        raise RecordingError("the file is empty: 0 bytes; expected a log")
    if not head.startswith(GZIP):
        return Head(head, zipped=False)
    unpacked = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        head = unpacked.decompress(head, HEAD_SIZE)
    except zlib.error as error:
        raise _damaged_gzip(error) from None
    if not head:
        raise RecordingError("the gzipped file is empty or cut off: it holds 0 bytes; expected a log")
    return Head(head, zipped=True)


def open_source(path: Path, begin: Head | None = None) -> FileSource:
    """Open a file that begins so. A gzipped file is unpacked, a large one on disk; refused as by ``read_head``."""
    head, zipped = begin or read_head(path)
    try:
        if not zipped:
            return FileSource(path, head, path.stat().st_size)
        with gzip.open(path) as file:
            content = file.read(MOST_IN_MEMORY)
            if len(content) == MOST_IN_MEMORY:
                unpacked = NamedTemporaryFile()  # noqa: SIM115 - removed with the source
                unpacked.write(content)
                shutil.copyfileobj(file, unpacked, HEAD_SIZE)
                unpacked.flush()
                origin = Path(unpacked.name)
                return FileSource(origin, head, origin.stat().st_size, unpacked)
    except (OSError, EOFError, zlib.error) as error:
        raise _damaged_gzip(error) from None
    return FileSource(content, head, len(content))


def _damaged_gzip(error: Exception) -> RecordingError:
    return RecordingError(f"its gzip cannot be unpacked: {error}; the file is damaged or cut off; copy it again")

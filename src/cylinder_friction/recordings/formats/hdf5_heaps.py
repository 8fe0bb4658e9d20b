"""A guard before HDF5 files: over a damaged heap of texts the HDF5 library never comes to an end."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    import mmap

    from cylinder_friction.recordings.formats.source import FileSource

_HEADER = 16


def refuse_damaged_heaps(source: FileSource) -> None:
    """Refuses an HDF5 file with a global heap whose objects do not fill it one behind the other.

    Layout as in the HDF5 File Format Specification 3.0, III.E 'Disk Format: Level 1E - Global Heap': the signature
    GCOL, a version (1), the size of the collection; then objects of an index, a count, and a size.

    Raises:
        RecordingError: There is such a heap.
    """
    with source.mapped() as content:
        start = content.find(b"GCOL\x01\0\0\0")
        while start >= 0:
            if not _is_filled(content, start):
                raise RecordingError(f"its heap of texts at byte {start} is damaged; copy the file again")
            start = content.find(b"GCOL\x01\0\0\0", start + 1)


def _is_filled(content: bytes | mmap.mmap, start: int) -> bool:
    if start + _HEADER > len(content):
        return False
    (size,) = struct.unpack_from("<Q", content, start + 8)
    if size < _HEADER or start + size > len(content):
        return False
    place, end = start + _HEADER, start + size
    while end - place >= _HEADER:
        index, _, _, length = struct.unpack_from("<HHIQ", content, place)
        # Object 0 is the free space and counts its own header; the others are padded to 8 bytes.
        step = length if index == 0 else _HEADER + (length + 7) // 8 * 8
        if step < _HEADER or step > end - place:
            return False
        place += step
    return True

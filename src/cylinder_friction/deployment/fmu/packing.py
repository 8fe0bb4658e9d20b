"""The zip file that an FMU is: the same content gives the same bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

if TYPE_CHECKING:
    from collections.abc import Mapping

EARLIEST = (1980, 1, 1, 0, 0, 0)  # of a zip file; it would hold the time of writing
UNIX = 3
READABLE = 0o100644


def packed(content: Mapping[str, bytes]) -> bytes:
    """Return a zip file of ``content``, in alphabetical order of its paths, with no time of writing in it."""
    buffer = io.BytesIO()
    with ZipFile(buffer, "w") as archive:
        for path in sorted(content):
            entry = ZipInfo(path, EARLIEST)
            entry.compress_type, entry.create_system, entry.external_attr = ZIP_DEFLATED, UNIX, READABLE << 16
            archive.writestr(entry, content[path])
    return buffer.getvalue()

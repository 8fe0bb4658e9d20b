"""Pages whose panes are packed until they are chosen."""

from __future__ import annotations

import base64
import re
import zlib


def unpacked(page: str) -> str:
    """Return a page with the panes as a browser shows them once they are chosen."""
    packed = re.compile('<script type="text/plain">([^<]+)</script>')
    return packed.sub(lambda found: zlib.decompress(base64.b64decode(found[1])).decode(), page)

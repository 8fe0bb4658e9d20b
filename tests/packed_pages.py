"""Pages whose panes are packed until they are chosen, within them or beside them."""

from __future__ import annotations

import base64
import re
import zlib
from pathlib import Path


def unpacked(page: str) -> str:
    """Return a page with the panes as a browser shows them once they are chosen."""
    packed = re.compile('<script type="text/plain">([^<]+)</script>')
    return packed.sub(lambda found: zlib.decompress(base64.b64decode(found[1])).decode(), page)


def unpacked_pane(script: Path) -> str:
    """Return the HTML that a script beside a page hands to it."""
    return zlib.decompress(base64.b64decode(script.read_text().rsplit('"', 2)[1])).decode()

"""A guard before MDF files: blocks that point in a circle would be followed for ever."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    import mmap

    from cylinder_friction.recordings.formats.source import FileSource


def refuse_rings(source: FileSource) -> None:
    """Refuses an MDF 4 file in which a list of blocks comes back to a block it has already been at.

    In MDF 4 (ASAM MDF 4.1, 'general block structure') a block is an identification of four characters, its length, and
    links; the first link of a list's block leads to the next of its kind.

    Raises:
        RecordingError: Such a circle is there.
    """
    if source.head[64:68] != b"##HD":
        return
    with source.mapped() as content:
        _refuse_circle(_following(content))


def _following(content: bytes | mmap.mmap) -> dict[int, int]:
    """Returns where the blocks of lists lead to, by address."""
    following: dict[int, int] = {}
    waiting, seen = [64], {64}
    while waiting:
        address = waiting.pop()
        if address + 24 > len(content) or content[address : address + 2] != b"##":
            continue
        _, count = struct.unpack_from("<QQ", content, address + 8)
        count = min(count, (len(content) - address - 24) // 8)
        links = struct.unpack_from(f"<{count}Q", content, address + 24)
        kind = content[address : address + 4]
        if links and links[0] and content[links[0] : links[0] + 4] == kind:
            following[address] = links[0]
        fresh = {link for link in links if link and link not in seen}
        seen |= fresh
        waiting += fresh
    return following


def _refuse_circle(following: dict[int, int]) -> None:
    done: set[int] = set()
    for start in following:
        walked: set[int] = set()
        address = start
        while address in following and address not in done:
            if address in walked:
                raise RecordingError(f"its blocks point in a circle at byte {address}; it is damaged; copy it again")
            walked.add(address)
            address = following[address]
        done |= walked

"""A log too long for memory is cut into parts of some minutes; each part is read as a log of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from cylinder_friction.recordings.columns import TIME
from cylinder_friction.recordings.conversion import Recipe, part_suffix, pieces_from
from cylinder_friction.recordings.formats.logged_table import LoggedTable, LongTable
from cylinder_friction.recordings.recording import RecordingError, RecordingPiece

ROWS_AT_ONCE = 1 << 18
"""A longer log is cut into parts of about this many rows: 22 minutes at 200 Hz, 4 minutes at 1 kHz."""
LEAST_SHARE = 0.5
"""A last part shorter than this share of the part before it is joined to it."""


@dataclass(frozen=True)
class FilePiece:
    """A stretch of a file, or why a part of a long file gives none."""

    found: RecordingPiece | RecordingError
    suffix: str  # What the recording's name has beyond that of the file
    words: str  # Which piece of the file it is; empty if it is the only one


def file_pieces(tables: LongTable | Sequence[LoggedTable], recipe: Recipe) -> Iterator[FilePiece]:
    """Yield the pieces of a file in order; memory holds one part of a long file at a time.

    Raises:
        RecordingError: The file cannot be read, or a file that is not long gives no piece.
    """
    if isinstance(tables, LongTable):
        yield from _pieces_of_parts(tables, recipe)
        return
    pieces = pieces_from(tables, recipe)
    for number, piece in enumerate(pieces, start=1):
        words = f"piece {number} of {len(pieces)}" if len(pieces) > 1 else ""
        yield FilePiece(piece, part_suffix(number, len(pieces)), words)


def _pieces_of_parts(table: LongTable, recipe: Recipe) -> Iterator[FilePiece]:
    """Yield the pieces of each part in turn. The first part decides the sample rate of all."""
    number, rows, last_s, rules = 0, 0, -math.inf, recipe.time
    width, restarted = max(2, len(str(table.count))), False
    for part in _without_short_end(table.chunks()):
        first, rows = rows, rows + len(part.channels)
        found: Sequence[RecordingPiece | RecordingError]
        try:
            found = pieces_from([part], replace(recipe, time=rules), rows_before=first)
        except RecordingError as error:
            found = [RecordingError(f"in the part of rows {first + 1} to {rows}, rows counted from there: {error}")]
        for each in found:
            number += 1
            if isinstance(each, RecordingPiece):
                rules = replace(rules, rate_hz=rules.rate_hz or 1.0 / each.sample_time_s)
                restarted |= each.segment > 0 or float(each.columns[TIME][0]) < last_s
                last_s = float(each.columns[TIME][-1])
                each = replace(each, segment=int(restarted))
            yield FilePiece(each, part_suffix(number, 2, width), f"part {number:0{width}d}")


def _without_short_end(parts: Iterator[LoggedTable]) -> Iterator[LoggedTable]:
    held: LoggedTable | None = None
    try:
        for part in parts:
            if held is not None and len(part.channels) < LEAST_SHARE * len(held.channels):
                held = replace(held, channels=pd.concat([held.channels, part.channels], ignore_index=True))
                continue
            if held is not None:
                yield held
            held = part
    except RecordingError:  # below a part that is whole
        if held is not None:
            yield held
        raise
    if held is not None:
        yield held

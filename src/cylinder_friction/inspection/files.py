"""Files as ``ingest`` would take them, with every finding kept instead of the first refusal alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.inspection.subject import Inspected
from cylinder_friction.recordings import (
    Finding,
    PathNames,
    Recording,
    RecordingError,
    inspect_recording,
    metadata_of,
    name_of,
    pieces_of,
    zeroed,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from cylinder_friction.recordings import Piece, Recipe, RecordingMetadata


def inspect_files(files: Mapping[str, Path], recipe: Recipe) -> list[Inspected]:
    """Returns what was found in each file, in their order; a file that comes apart gives one entry a piece.

    Args:
        files: By the name that is shown, which is the path below the source where that is known.
        recipe: How a file becomes recordings.
    """
    bar = tqdm(files.items(), desc="inspect", unit="file", disable=None)
    return [subject for name, path in bar for subject in inspect_file(name, path, recipe)]


def inspect_file(name: str, path: Path, recipe: Recipe) -> list[Inspected]:
    """Returns what was found in one file. A path that tells no session is noted, for it may lie elsewhere later."""
    findings = []
    try:
        names = recipe.names.names(name)
    except RecordingError as error:
        findings.append(Finding("names", "noted", str(error)))
        names = PathNames(name_of(name), "", "", "")
    try:
        pieces = pieces_of(path, recipe)
    except (RecordingError, OSError) as error:
        return [Inspected(name, [*findings, Finding("file", "refused", str(error))])]
    found = []
    for number, piece in enumerate(pieces, start=1):
        metadata = metadata_of(piece, names, number, len(pieces), name, "", recipe.cylinder)
        found.append(_inspected(name, piece, metadata, recipe, findings))
    return found


def _inspected(
    name: str, piece: Piece, metadata: RecordingMetadata, recipe: Recipe, before: list[Finding]
) -> Inspected:
    try:
        table, metadata = zeroed(piece, metadata, recipe)
    except RecordingError as error:
        return Inspected(name, [*before, Finding("zero", "refused", str(error))], None, piece.repairs)
    findings = inspect_recording(table, recipe.limits, piece.sample_time_s)
    try:
        recording = Recording(replace(metadata, sample_time_s=piece.sample_time_s), table)
    except RecordingError:  # the findings say so already
        return Inspected(name, [*before, *findings], None, piece.repairs)
    return Inspected(name, [*before, *findings], recording, piece.repairs)

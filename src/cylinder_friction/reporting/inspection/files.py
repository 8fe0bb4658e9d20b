"""Files as ``ingest`` would take them, with every finding kept instead of the first refusal alone."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.checks.recording_checks import inspect_recording
from cylinder_friction.recordings.conversion import Recipe, metadata_of, pieces_of, zeroed
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.mapping.channel_mapping import wanted_channels
from cylinder_friction.recordings.mapping.mapped_file import map_signals
from cylinder_friction.recordings.path_names import PathNames, name_of
from cylinder_friction.recordings.recording import Piece, Recording, RecordingError, RecordingMetadata
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.reporting.inspection.subject import Inspected


def inspect_files(files: Mapping[str, Path], recipe: Recipe) -> Iterator[Inspected]:
    """Yield what was found in each file, in their order; a file that a gap splits gives one entry per piece.

    Args:
        files: By the name that is shown, which is the path below the source where that is known.
        recipe: How a file becomes recordings.
    """
    for name, path in tqdm(files.items(), desc="inspect", unit="file", disable=None):
        yield from inspect_file(name, path, recipe)


def inspect_file(name: str, path: Path, recipe: Recipe) -> list[Inspected]:
    """Return what was found in one file. A path without a session is noted, for it may lie elsewhere later.

    What is refused has its recording all the same wherever the signals can be read.
    """
    findings = []
    try:
        names = recipe.names.names(name)
    except RecordingError as error:
        findings.append(Finding("names", "noted", str(error)))
        names = PathNames(name_of(name), "", "", "")
    try:
        pieces = pieces_of(path, recipe)
    except (RecordingError, OSError) as error:
        findings.append(Finding("file", "refused", str(error)))
        pieces = _as_logged(path, recipe)
        if not pieces:
            return [Inspected(name, findings)]
    found = []
    for number, piece in enumerate(pieces, start=1):
        metadata = metadata_of(piece, names, number, len(pieces), name, "", recipe.cylinder)
        found.append(_inspected(name, piece, metadata, recipe, findings))
    return found


def _as_logged(path: Path, recipe: Recipe) -> list[Piece]:
    """Return the pieces of a refused file with its bad samples in it, to be looked at; none where it is unreadable."""
    with suppress(RecordingError, OSError):
        tables = read_logged_file(path, recipe.file_format, recipe.csv, wanted_channels(recipe.channels))
        return align(map_signals(tables, recipe.channels).signals, recipe.time)
    return []


def _inspected(
    name: str, piece: Piece, metadata: RecordingMetadata, recipe: Recipe, before: Sequence[Finding]
) -> Inspected:
    findings = list(before)
    try:
        table, metadata = zeroed(piece, metadata, recipe)
    except RecordingError as error:
        findings.append(Finding("zero", "refused", str(error)))
        table = piece.table
    findings += inspect_recording(table, recipe.limits, piece.sample_time_s)
    try:
        recording = Recording(replace(metadata, sample_time_s=piece.sample_time_s), table)
    except RecordingError:  # which the findings state already
        return Inspected(name, findings, None, piece.repairs)
    return Inspected(name, findings, recording, piece.repairs)

"""Files read as by ``ingest``, with all findings instead of the first refusal."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from cylinder_friction.evaluation.inspection.subject import Inspected, worst
from cylinder_friction.execution.progress import progress
from cylinder_friction.recordings.checks.limits import Finding
from cylinder_friction.recordings.checks.recording_checks import inspect_recording
from cylinder_friction.recordings.conversion import (
    SeenRecordings,
    metadata_of,
    open_tables,
    pieces_from,
    samples_hash,
)
from cylinder_friction.recordings.logs import Recipe, name_of
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.wording import printable


def inspect_files(files: Mapping[str, Path], recipe: Recipe) -> Iterator[Inspected]:
    """Yield what was found in each file, in their order; a file that a gap splits gives one entry per piece.

    As in ``ingest``, a duplicate of an earlier recording is refused.
    """
    duplicates = SeenRecordings()
    for name, path in progress(files.items(), "inspect", unit="file"):
        for piece, subject in _inspect_file(name, path, recipe):
            recording = subject.recording
            if piece is None or recording is None or subject.outcome == "refused":
                yield subject
                continue
            if problem := duplicates.problem(recording.name, printable(name), samples_hash(piece.columns)):
                subject = subject.with_findings(Finding("duplicate", "refused", problem))
            yield subject


def _inspect_file(name: str, path: Path, recipe: Recipe) -> Iterator[tuple[Recording | None, Inspected]]:
    """Yield what was found in one file. A path without a session is only noted, as the file may be moved later.

    A refused file has its recording too if the signals can be read.
    """
    findings = []
    try:
        names = recipe.names.names(name)
    except RecordingError as error:
        findings.append(Finding("names", "noted", str(error)))
        names = RecordingMetadata(name_of(printable(name)), "", "", math.nan)
    name = printable(name)  # pages hold it
    about = metadata_of(names, name, "", recipe)
    try:
        pieces = pieces_from(open_tables(path, recipe), recipe, about)
    except (RecordingError, OSError) as error:
        findings.append(Finding("file", "refused", str(error)))
        pieces = []
        with suppress(RecordingError, OSError):  # With its bad samples, to inspect them
            pieces = pieces_from(open_tables(path, recipe), recipe, about, screened=False)
        if not pieces:
            yield None, Inspected(name, findings)
    for number, piece in enumerate(pieces, start=1):
        found, recording = _checked(piece, recipe)
        yield piece, Inspected(name, [*findings, *found], recording, number if len(pieces) > 1 else 0)


def _checked(piece: Recording, recipe: Recipe) -> tuple[Sequence[Finding], Recording | None]:
    about = piece.metadata
    findings = [Finding("repair", "repaired", text) for text in about.repairs]
    if about.start_source and not about.start:
        findings.append(Finding("start", "noted", about.start_source))
    findings += inspect_recording(piece.columns, recipe.limits, piece.sample_time_s)
    try:
        return findings, Recording(piece.metadata, piece.columns)
    except RecordingError as error:
        if worst(finding.outcome for finding in findings) != "refused":
            findings.append(Finding("recording", "refused", str(error)))
        return findings, None

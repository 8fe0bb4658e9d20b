"""A folder of logged files becomes a folder of recordings; what is unusable is set aside with the reason."""

from __future__ import annotations

import shutil
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from cylinder_friction.execution.workers import Died, Workers
from cylinder_friction.recordings.checks.duplicate_detection import DuplicateDetection, Hashes, window_hashes
from cylinder_friction.recordings.conversion import Recipe, checked, metadata_of
from cylinder_friction.recordings.files import hash_of, whole_folder, write_json
from cylinder_friction.recordings.long_logs import (
    Draft,
    LongRecording,
    on_disk,
    pieces_in_turn,
    pieces_or_drafts,
)
from cylinder_friction.recordings.mapping.calibration import ZeroReading, find_zero, session_zero
from cylinder_friction.recordings.mapping.channel_mapping import check_mapping
from cylinder_friction.recordings.progress import shown
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata, RecordingPiece
from cylinder_friction.recordings.storage import write_recording


@dataclass(frozen=True)
class Source:
    """Where logged files lie (``pattern`` is a glob, with ``**`` for folders below) and what they mean."""

    folder: Path
    pattern: str
    recipe: Recipe


@dataclass(frozen=True)
class Quarantined:
    """A file, by its path below the source, or a ``piece`` of one, that did not become a recording, and why."""

    file: str
    reason: str
    piece: str = ""

    @property
    def where(self) -> str:
        return f"{self.file} ({self.piece})" if self.piece else self.file


@dataclass
class Ingested:
    """What became of the files, in the order of their paths."""

    files: int = 0
    notes: list[str] = field(default_factory=list)
    recordings: list[tuple[RecordingMetadata, int]] = field(default_factory=list)
    quarantined: list[Quarantined] = field(default_factory=list)

    def repaired(self) -> list[RecordingMetadata]:
        return [metadata for metadata, _ in self.recordings if metadata.repairs]

    def summary(self) -> str:
        """Return what happened, for a person: one line in all, one a repair and one a refusal."""
        seconds = sum(rows * metadata.sample_time_s for metadata, rows in self.recordings)
        lines = [
            f"{len(self.recordings)} recordings ({seconds / 3600.0:.3g} h) from {self.files} files; "
            f"{len(self.repaired())} repaired or noted, {len(self.quarantined)} quarantined"
        ]
        lines += [f"  note         {note}" for note in self.notes]
        lines += [f"  used         {entry.name}: {'; '.join(entry.repairs)}" for entry in self.repaired()]
        lines += [f"  quarantined  {entry.where}: {entry.reason}" for entry in self.quarantined]
        return "\n".join(lines)


def ingest_folder(source: Source, into: Path, quarantine_file: Path, workers: Workers | None = None) -> Ingested:
    """Write ``into`` whole, one Parquet file per usable recording, and the others' reasons as ``quarantine_file``.

    One bad file never stops the others, and memory holds one file at a time, or one in each of the ``workers``.

    Raises:
        RecordingError: The mapping is wrong, there is no file, or none is usable.
    """
    check_mapping(source.recipe.channels)
    # A dangling link is a file too: one that cannot be read.
    found = (path for path in source.folder.glob(source.pattern) if not path.is_dir())
    paths = sorted(path for path in found if path != source.recipe.names.table)
    if not paths:
        raise RecordingError(
            f"{source.folder}: no file matches {source.pattern!r}; put recordings there, or name their folder as "
            "ingest.source and their pattern as ingest.pattern in params.yaml"
        )
    files = {path.relative_to(source.folder).as_posix(): path for path in paths}
    notes = [*source.recipe.names.lines_without_file(files), *_not_read(source, paths)]
    result = Ingested(len(files), notes)
    with whole_folder(into) as folder:
        elsewhere = folder / ".converted"
        for outcome in convert_in_parts(files, source.recipe, elsewhere, workers=workers):
            if isinstance(outcome, Quarantined):
                result.quarantined.append(outcome)
                continue
            if isinstance(outcome, Recording):
                write_recording(folder, outcome)
            else:
                outcome.paths[0].rename(folder / f"{outcome.metadata.name}.parquet")
            result.recordings.append((outcome.metadata, len(outcome)))
        shutil.rmtree(elsewhere, ignore_errors=True)
        others = other_rates([metadata for metadata, _ in result.recordings])
        for name in others:
            (folder / f"{name}.parquet").unlink()
        result.recordings = [entry for entry in result.recordings if entry[0].name not in others]
        result.quarantined = sorted([*result.quarantined, *others.values()], key=lambda each: (each.file, each.piece))
        write_json(quarantine_file, [asdict(entry) for entry in result.quarantined])
        if not result.recordings:
            raise none_usable(source.folder.as_posix(), len(files), result.quarantined[0])
    return result


def convert_in_parts(
    files: Mapping[str, Path],
    recipe: Recipe,
    folder: Path | None = None,
    rows: int | None = None,
    workers: Workers | None = None,
) -> Iterator[Recording | LongRecording | Quarantined]:
    """Yield the recordings of each file in turn, those of a long one in parts, and for what is unusable the reason.

    Also refused: a copy of a file already read, the same measurement exported twice, and a second recording of one
    name.

    Args:
        files: By their paths below the source, with ``/``, from which condition and session are taken.
        recipe: Its channels have passed ``check_mapping``.
        folder: Where the parts of long files are kept, and what workers elsewhere convert.
        rows: A longer file is processed in parts of about so many rows; None: every file is read whole.
        workers: Convert files side by side; None: one after the other, here.
    """
    for each in worked_on(files, recipe, folder, rows, workers or Workers(), DuplicateDetection(), None):
        yield each if isinstance(each, Quarantined) else each.result


def worked_on(
    files: Mapping[str, Path],
    recipe: Recipe,
    folder: Path | None,
    rows: int | None,
    workers: Workers,
    seen: DuplicateDetection,
    work: Callable[[Recording | LongRecording], Any] | None,
) -> Iterator[ConvertedPiece | Quarantined]:
    """Yield what ``work`` makes of each recording, beside the worker that converts its file.

    Of a recording that is then refused nothing is yielded. ``seen`` is what was converted before, to which these are
    added; the other arguments are those of ``convert_in_parts``.
    """
    zeros = {} if recipe.zero.method == "none" else session_zeros(files, recipe, rows, workers)
    kept = None if workers.here else folder
    pieces = [
        partial(convert_file, relative, path, recipe, _zero_of(relative, recipe, zeros), folder, rows, kept, work)
        for relative, path in files.items()
    ]
    converted = workers.in_order(pieces)
    for relative, file in zip(files, shown(converted, "ingest", len(files), "file"), strict=True):
        if isinstance(file, Died):
            yield Quarantined(relative, file.reason)
            continue
        digest, outcomes = file
        if digest in seen.digests:
            reason = f"holds the same bytes as {seen.digests[digest]}; a copy would be counted twice"
            yield Quarantined(relative, reason)
            continue
        if digest:
            seen.digests[digest] = relative
        for outcome in outcomes:
            if isinstance(outcome, Quarantined):
                yield outcome
                continue
            try:
                seen.refuse(outcome.metadata.name, relative, outcome.hashes)
            except RecordingError as error:
                yield Quarantined(relative, str(error), outcome.where)
            else:
                yield outcome


@dataclass(frozen=True)
class ConvertedPiece:
    """A piece of a file that is usable as far as the file itself shows."""

    metadata: RecordingMetadata
    result: Any  # What was made of it; by default the recording
    hashes: dict[int, Hashes]  # Of its windows, by which a duplicate is known
    where: str  # Which piece of the file; empty where it is the only one


def convert_file(
    relative: str,
    path: Path,
    recipe: Recipe,
    zero: ZeroReading | None,
    folder: Path | None,
    rows: int | None,
    kept: Path | None,
    work: Callable[[Recording | LongRecording], Any] | None = None,
) -> tuple[str, list[ConvertedPiece | Quarantined]]:
    """Return the SHA-256 of a file, empty if it cannot be read, and what became of each piece, whatever others hold.

    Args:
        relative, path, recipe, folder, rows: As in ``convert_in_parts``.
        zero: What the pressure sensors of its session read while vented.
        kept: Recordings are written there rather than returned; None: they are returned.
        work: What is made of each recording, instead.
    """
    digest = ""
    try:
        digest = hash_of(path)
        names = recipe.names.names(relative)
        pieces: Sequence[RecordingPiece | Draft] = pieces_or_drafts(path, recipe, rows, folder)
    except (RecordingError, OSError) as error:
        return digest, [Quarantined(relative, str(error))]
    outcomes: list[ConvertedPiece | Quarantined] = []
    for number, found in enumerate(pieces, start=1):
        piece = found.first() if isinstance(found, Draft) else found
        metadata = metadata_of(piece, names, number, len(pieces), relative, digest, recipe)
        finish = found.checked if isinstance(found, Draft) else partial(checked, piece)
        where = f"piece {number} of {len(pieces)}" if len(pieces) > 1 else ""
        try:
            recording = finish(metadata, recipe, zero)
        except RecordingError as error:
            outcomes.append(Quarantined(relative, str(error), where))
            continue
        result = recording
        if work is not None:
            result = work(recording)
        elif kept is not None and isinstance(recording, Recording):
            result = on_disk(recording, kept)
        outcomes.append(ConvertedPiece(recording.metadata, result, window_hashes(piece.columns), where))
    return digest, outcomes


def other_rates(metadata: Sequence[RecordingMetadata]) -> dict[str, Quarantined]:
    """Return, by name, the recordings that do not share the commonest sample time: no estimator takes two rates."""
    counts = Counter(entry.sample_time_s for entry in metadata)
    common, count = counts.most_common(1)[0] if counts else (0.0, 0)
    return {
        entry.name: Quarantined(
            entry.source_file,
            f"has a sample time of {entry.sample_time_s:.9g} s, but {count} of {counts.total()} recordings have "
            f"{common:.9g} s; name one rate for all as time.rate_hz in the mapping, or take it on its own",
        )
        for entry in metadata
        if entry.sample_time_s != common
    }


def none_usable(where: str, files: int, first: Quarantined) -> RecordingError:
    """Return the error for a run in which every file was refused."""
    return RecordingError(f"{where}: none of {files} files is usable; the first, {first.file}: {first.reason}")


def _not_read(source: Source, matching: list[Path]) -> list[str]:
    """Return a sentence on the files that the pattern leaves out: among logs in .csv, one may end in .CSV."""
    beside = {path for path in source.folder.rglob("*") if not path.is_dir() and not path.name.startswith(".")}
    left_out = sorted(beside - set(matching) - {source.recipe.names.table})
    if not left_out:
        return []
    first = left_out[0].relative_to(source.folder).as_posix()
    files = "1 file" if len(left_out) == 1 else f"{len(left_out)} files"
    return [f"{files} not read, for {source.pattern!r} does not match (first: {first}); see ingest.pattern"]


def session_zeros(
    files: Mapping[str, Path], recipe: Recipe, rows: int | None = None, workers: Workers | None = None
) -> dict[str, ZeroReading]:
    """Return what the pressure sensors of each session read while vented, from the recordings that show it.

    A session has one calibration, so that a recording without a vented stretch is zeroed by its neighbours. What
    cannot be read is skipped here; the run over the files reports why. A file of more ``rows`` is read in parts.
    """
    readings: defaultdict[str, list[ZeroReading]] = defaultdict(list)
    found = (workers or Workers()).in_order([partial(zeros_of, *each, recipe, rows) for each in files.items()])
    for own in shown(found, "zeros", len(files), "file"):
        for session, reading in () if isinstance(own, Died) else own:
            readings[session].append(reading)
    return {session: session_zero(read) for session, read in readings.items()}


def _zero_of(relative: str, recipe: Recipe, zeros: Mapping[str, ZeroReading]) -> ZeroReading | None:
    with suppress(RecordingError):
        return zeros.get(recipe.names.names(relative).session)
    return None


def zeros_of(relative: str, path: Path, recipe: Recipe, rows: int | None) -> list[tuple[str, ZeroReading]]:
    """Return the session of one file and what its pressure sensors read while vented, piece by piece."""
    readings: list[tuple[str, ZeroReading]] = []
    with suppress(RecordingError, OSError):
        names = recipe.names.names(relative)
        readings.extend(  # piece by piece, so that those before an error are kept
            (names.session, find_zero(piece.columns, recipe.zero, recipe.channels, names.name))
            for piece in pieces_in_turn(path, recipe, rows)
        )
    return readings

"""A folder of logged files becomes a folder of recordings; what is unusable is set aside with the reason."""

from __future__ import annotations

import shutil
import sys
import uuid
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from cylinder_friction.execution.workers import LostPiece, Workers
from cylinder_friction.files.whole_files import hash_of, whole_folder, write_json
from cylinder_friction.recordings.checks.duplicates import Samples, SeenRecordings
from cylinder_friction.recordings.conversion import Recipe, checked, metadata_of, open_tables, pieces_of_tables
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.mapping.channel_mapping import check_mapping
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
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
        """Describe for a person what happened: one line in all, one per repair and one per refusal."""
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
    result, seen = Ingested(len(files)), SeenRecordings()
    with whole_folder(into) as folder:
        elsewhere = folder / ".converted"
        work = partial(_written, folder=elsewhere)
        for outcome in usable(files, source.recipe, work, seen, workers=workers):
            if isinstance(outcome, Quarantined):
                result.quarantined.append(outcome)
                continue
            path, rows = outcome.result
            path.rename(folder / f"{outcome.metadata.name}.parquet")
            result.recordings.append((outcome.metadata, rows))
        notes = *source.recipe.names.lines_without_file(files), *_not_read(source, paths), seen.overlaps()
        result.notes = [note for note in notes if note]
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


def _written(file: LoggedFile, folder: Path) -> list[Converted | Quarantined]:
    """Write the recordings of a file into a folder; in place of each return its path and its number of rows."""

    def written(each: Converted) -> Converted:
        path = write_recording(folder, each.result, uuid.uuid4().hex)
        return replace(each, result=(path, len(each.result)))

    return [each if isinstance(each, Quarantined) else written(each) for each in converted(file)]


@dataclass(frozen=True)
class LoggedFile:
    """A file to be converted, and all that its conversion depends on.

    ``name`` is its path below the source, with ``/``, from which condition and session are taken.
    """

    name: str
    path: Path
    recipe: Recipe
    digest: str = ""  # SHA-256 of its bytes
    rows: int | None = None  # If it has more rows, it is cut into parts of about this many; None: it is read whole
    tables: tuple[LoggedTable, ...] = ()  # What it holds, if it was read before


@dataclass(frozen=True)
class Converted:
    """A recording of a file, usable as far as the file itself shows, or what a later step made of it."""

    metadata: RecordingMetadata
    result: Any  # The recording
    samples: Samples  # By which a copy is known


def converted(file: LoggedFile) -> Iterator[Converted | Quarantined]:
    """Read, map, screen, align and check a file; yield each recording, or why there is none."""
    piece = ""
    try:
        about = metadata_of(file.recipe.names.names(file.name), file.name, file.digest, file.recipe)
        tables = file.tables or open_tables(file.path, file.recipe, file.rows)
        for found, piece in pieces_of_tables(tables, file.recipe, about):
            try:
                if isinstance(found, RecordingError):
                    raise found
                recording = checked(found, file.recipe)
            except RecordingError as error:
                yield Quarantined(file.name, str(error), piece)
                continue
            yield Converted(recording.metadata, recording, Samples.of(found.metadata, found.columns))
    except (RecordingError, OSError) as error:
        yield Quarantined(file.name, str(error), piece and f"after {piece}")


def recordings_of(
    files: Mapping[str, Path],
    recipe: Recipe,
    rows: int | None = None,
    tables: Mapping[str, Sequence[LoggedTable]] | None = None,
) -> Iterator[Recording | Quarantined]:
    """Yield the recordings of each file in turn, and for what is unusable the reason; see ``usable``."""
    seen = SeenRecordings()
    for each in usable(files, recipe, converted, seen, rows=rows, tables=tables):
        yield each.result if isinstance(each, Converted) else each
    if overlaps := seen.overlaps():
        warnings.warn(overlaps, stacklevel=3)


def digest_of(path: Path) -> str:
    """Hash a file's bytes (SHA-256); a file that cannot be read gets an empty text, and reading it states why."""
    try:
        return hash_of(path)
    except OSError:
        return ""


OfFile = TypeVar("OfFile", bound=Converted)
Item = TypeVar("Item")


def shown(items: Iterable[Item], words: str, total: int, unit: str, **look: Any) -> Iterable[Item]:
    """Return the items, with a bar on standard error if that is a terminal; further options are those of tqdm."""
    if not (sys.stderr and sys.stderr.isatty()):
        return items
    from tqdm import tqdm  # Only who watches waits for it

    return tqdm(items, words, total, unit=unit, **look)


def usable(
    files: Mapping[str, Path],
    recipe: Recipe,
    work: Callable[[LoggedFile], Iterable[OfFile | Quarantined]],
    seen: SeenRecordings,
    *,
    rows: int | None = None,
    digests: Mapping[str, str] | None = None,
    tables: Mapping[str, Sequence[LoggedTable]] | None = None,
    workers: Workers | None = None,
) -> Iterator[OfFile | Quarantined]:
    """Do the ``work`` on each file; yield what it finds in order, without copies of a file or a recording.

    Args:
        files: By their paths below the source, with ``/``.
        recipe: By which they are converted; its channels have passed ``check_mapping``.
        work: Converts one file; what it returns can be pickled if there are ``workers``.
        seen: What was converted before; these recordings are added.
        rows: As in ``LoggedFile``.
        digests: SHA-256 of each file, if it is known.
        tables: What was read of some files already.
        workers: Work on files side by side; None: one after the other, here.
    """
    workers, copies, own = workers or Workers(), list[Quarantined](), list[LoggedFile]()
    for name, path in files.items():
        digest = digest_of(path) if digests is None else digests[name]
        if digest in seen.digests:
            reason = f"holds the same bytes as {seen.digests[digest]}; a copy would be counted twice"
            copies.append(Quarantined(name, reason))
            continue
        if digest:
            seen.digests[digest] = name
        read = tuple((tables or {}).get(name, ()))
        own.append(LoggedFile(name, path, recipe, digest, rows, read))
    done = workers.in_order([partial(work, file) for file in own])
    for file, outcomes in zip(own, shown(done, "ingest", len(own), "file"), strict=True):
        if isinstance(outcomes, LostPiece):
            yield Quarantined(file.name, outcomes.reason)
            continue
        found = list(outcomes)
        for each in found:
            if not isinstance(each, Quarantined):
                try:
                    seen.refuse(each.metadata.name, file.name, each.samples)
                except RecordingError as error:
                    yield Quarantined(file.name, str(error), each.metadata.name if len(found) > 1 else "")
                    continue
            yield each
    yield from copies


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
    """Name the files that the pattern leaves out: among logs in .csv, one may end in .CSV."""
    beside = {path for path in source.folder.rglob("*") if not path.is_dir() and not path.name.startswith(".")}
    left_out = sorted(beside - set(matching) - {source.recipe.names.table})
    if not left_out:
        return []
    first = left_out[0].relative_to(source.folder).as_posix()
    files = "1 file" if len(left_out) == 1 else f"{len(left_out)} files"
    return [f"{files} not read, for {source.pattern!r} does not match (first: {first}); see ingest.pattern"]

"""Convert a folder of logged files to a folder of recordings; list unusable files and copies with the reason."""

from __future__ import annotations

import hashlib
import shutil
import sys
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cylinder_friction.execution.workers import LostPiece, Workers
from cylinder_friction.files.whole_files import hash_of, whole_folder, write_json
from cylinder_friction.recordings.columns import DRIVE_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.conversion import Recipe, checked, metadata_of, open_tables, pieces_of_tables
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.mapping.channel_mapping import check_mapping
from cylinder_friction.recordings.recording import Columns, Recording, RecordingError, RecordingMetadata
from cylinder_friction.recordings.storage import write_recording

RESOLUTION = {"position_m": 1e-9, DRIVE_FORCE: 1e-6}
"""Largest difference of samples that count as equal, because units or formats differ [m, N]; pressures: 1e-3 Pa."""
OVERLAP_S = 2.0
"""Shortest overlap that is named [s], because starts are rounded."""
MOST_NAMED = 3  # Most pairs that a sentence names


def samples_hash(columns: Columns) -> str:
    """Hash a recording's samples as logged (SHA-256), because a zero that is subtracted may differ from run to run."""
    digest = hashlib.sha256()
    for name in (*SAMPLE_COLUMNS, DRIVE_FORCE):
        if name in columns:
            digest.update(np.rint(columns[name] / RESOLUTION.get(name, 1e-3)).astype(np.int64).tobytes())
    return digest.hexdigest()


@dataclass
class SeenRecordings:
    """Recordings of this run and of earlier runs, among which copies are searched for."""

    files: dict[str, str] = field(default_factory=dict)  # File by name of its recording
    digests: dict[str, str] = field(default_factory=dict)  # File by SHA-256 of its bytes
    names: dict[str, str] = field(default_factory=dict)  # Name of the recording by ``samples_hash``

    def refuse(self, name: str, file: str, samples: str) -> None:
        """Remember a recording, its file and its ``samples_hash``; raise ``RecordingError`` if one of them is known."""
        if name in self.files:
            raise RecordingError(f"has the name {name!r}, which {self.files[name]} has already")
        if (copy := self.names.get(samples)) is not None:
            raise RecordingError(
                f"holds the same samples as recording {copy!r} of {self.files[copy]}; a copy would be counted twice, "
                "and a model could be tested on its own training data; keep one of them"
            )
        self.files[name], self.names[samples] = file, name


def overlaps_in_words(recordings: Iterable[tuple[str, str, str, float]]) -> str:
    """Name recordings of one session that overlap in time; empty if none do.

    A recording is stated by name, session, start (as in ``RecordingMetadata``) and duration [s].
    """
    sessions: dict[tuple[str, bool], list[tuple[float, float, str]]] = {}
    for name, session, start, duration_s in recordings:
        if "T" in start:  # a day without a time shows no overlap
            begin_s = float(np.datetime64(start.rstrip("Z"), "ms").astype(np.int64)) * 1e-3
            sessions.setdefault((session, start.endswith("Z")), []).append((begin_s, begin_s + duration_s, name))
    pairs: list[str] = []
    for spans in map(sorted, sessions.values()):
        ends_s, longest = spans[0][1:]
        for begin_s, end_s, name in spans[1:]:
            if ends_s - begin_s > OVERLAP_S:
                pairs.append(f"{longest} and {name} by {min(ends_s, end_s) - begin_s:.4g} s")
            if end_s > ends_s:
                ends_s, longest = end_s, name
    if not pairs:
        return ""
    more = f" and {len(pairs) - MOST_NAMED} more" if len(pairs) > MOST_NAMED else ""
    return (
        f"recordings of one session overlap in time: {', '.join(pairs[:MOST_NAMED])}{more}; if they are of the same "
        "stretch, keep one of them; otherwise correct the clock, or the session in the names"
    )


@dataclass(frozen=True)
class Source:
    """The folder of logged files, a glob ``pattern`` for them (``**`` for folders below), and their recipe."""

    folder: Path
    pattern: str
    recipe: Recipe


@dataclass(frozen=True)
class Quarantined:
    """A file (its path below the source), or a ``piece`` of one, that did not become a recording, and why."""

    file: str
    reason: str
    piece: str = ""

    @property
    def where(self) -> str:
        return f"{self.file} ({self.piece})" if self.piece else self.file


@dataclass
class Ingested:
    """The outcome of ingesting, in the order of the files' paths."""

    files: int = 0
    notes: list[str] = field(default_factory=list)
    recordings: list[tuple[RecordingMetadata, int]] = field(default_factory=list)
    quarantined: list[Quarantined] = field(default_factory=list)

    def repaired(self) -> list[RecordingMetadata]:
        return [metadata for metadata, _ in self.recordings if metadata.repairs]

    def summary(self) -> str:
        """Summarize the outcome for a person: one line in total, one per repair and one per refusal."""
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
    """Write one Parquet file per usable recording into ``into``, and the reasons of refusals as ``quarantine_file``.

    A bad file does not stop the others. Memory holds one file at a time, or one in each of the ``workers``.

    Raises:
        RecordingError: The mapping is wrong, no file is found, or no file is usable.
    """
    check_mapping(source.recipe.channels)
    # A dangling link counts as a file that cannot be read.
    paths = sorted(path for path in source.folder.glob(source.pattern) if not path.is_dir())
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
        spans = ((each.name, each.session, each.start, rows * each.sample_time_s) for each, rows in result.recordings)
        result.notes = [*_not_read(source, paths), *filter(None, [overlaps_in_words(spans)])]
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
    """Write the recordings of a file into a folder; replace each by its path and number of rows."""

    def written(each: Converted) -> Converted:
        path = write_recording(folder, each.result, uuid.uuid4().hex)
        return replace(each, result=(path, len(each.result)))

    return [each if isinstance(each, Quarantined) else written(each) for each in converted(file)]


@dataclass(frozen=True)
class LoggedFile:
    """A file to be converted, and everything that its conversion depends on.

    ``name`` is its path below the source, with ``/``. It states condition and session.
    """

    name: str
    path: Path
    recipe: Recipe
    digest: str = ""  # SHA-256 of its bytes
    rows: int | None = None  # Approximate number of rows of the parts that a longer file is cut into; None: not cut
    tables: tuple[LoggedTable, ...] = ()  # Its tables, if it was read before


@dataclass(frozen=True)
class Converted:
    """A recording that passed the checks of its file, or the result of a later step."""

    metadata: RecordingMetadata
    result: Any  # The recording, or the result of a later step
    samples: str  # Its ``samples_hash``, by which copies are found


def converted(file: LoggedFile) -> Iterator[Converted | Quarantined]:
    """Read, map, screen, align and check a file; yield each recording, or the reason why there is none."""
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
            yield Converted(recording.metadata, recording, samples_hash(found.columns))
    except (RecordingError, OSError) as error:
        yield Quarantined(file.name, str(error), piece and f"after {piece}")


def recordings_of(
    files: Mapping[str, Path],
    recipe: Recipe,
    rows: int | None = None,
    tables: Mapping[str, Sequence[LoggedTable]] | None = None,
) -> Iterator[Recording | Quarantined]:
    """Yield the recordings of each file in turn, or the reason why they are unusable; see ``usable``."""
    for each in usable(files, recipe, converted, SeenRecordings(), rows=rows, tables=tables):
        yield each.result if isinstance(each, Converted) else each


def digest_of(path: Path) -> str:
    """Hash a file's bytes (SHA-256); empty for a file that cannot be read, which a later step then refuses."""
    try:
        return hash_of(path)
    except OSError:
        return ""


OfFile = TypeVar("OfFile", bound=Converted)
Item = TypeVar("Item")


def shown(items: Iterable[Item], words: str, total: int, unit: str, **look: Any) -> Iterable[Item]:
    """Show a progress bar over the items if standard error is a terminal; further options are passed to tqdm."""
    if not (sys.stderr and sys.stderr.isatty()):
        return items
    from tqdm import tqdm  # slow to import, so only if a bar is shown

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
    """Do the ``work`` on each file; yield its results in order, and refuse copies of a file or a recording.

    Args:
        files: Files by their paths below the source, with ``/``.
        recipe: Recipe for converting them; its channels have passed ``check_mapping``.
        work: Converts one file. With ``workers``, its results must be picklable.
        seen: Recordings that were converted before; the new ones are added.
        rows: As in ``LoggedFile``.
        digests: SHA-256 of each file, if known.
        tables: Tables of files that were already read.
        workers: Process files in parallel. None processes them one after the other in this process.
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
    """Refuse, by name, recordings without the commonest sample time, because an estimator has one rate."""
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
    """Make the error for a run in which every file was refused."""
    return RecordingError(f"{where}: none of {files} files is usable; the first, {first.file}: {first.reason}")


def _not_read(source: Source, matching: list[Path]) -> list[str]:
    """Name files that the pattern may leave out by mistake, such as .CSV among .csv files."""
    beside = {path for path in source.folder.rglob("*") if not path.is_dir() and not path.name.startswith(".")}
    left_out = sorted(beside - set(matching))
    if not left_out:
        return []
    first = left_out[0].relative_to(source.folder).as_posix()
    files = "1 file" if len(left_out) == 1 else f"{len(left_out)} files"
    return [f"{files} not read, for {source.pattern!r} does not match (first: {first}); see ingest.pattern"]

"""Convert logger files to recordings: read, map, screen, align and check each; refuse copies, and name overlaps.

A log that is too long for memory is cut into parts of some minutes. Each part is read as a separate log.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cylinder_friction.execution.progress import progress
from cylinder_friction.execution.workers import LostPiece, Workers
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.recordings.checks.recording_checks import checked_recording
from cylinder_friction.recordings.checks.screening import screen_signals
from cylinder_friction.recordings.columns import DRIVE_FORCE, PRESSURES, SAMPLE_COLUMNS, TIME
from cylinder_friction.recordings.formats.cells import is_future
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.logs import Logs, Recipe
from cylinder_friction.recordings.mapping.channel_mapping import (
    channel_corrections,
    sensor_limits,
    sensor_uncertainty,
    wanted_channels,
)
from cylinder_friction.recordings.mapping.mapped_file import map_signals
from cylinder_friction.recordings.recording import (
    Columns,
    Recording,
    RecordingError,
    RecordingMetadata,
)
from cylinder_friction.recordings.timeline.aligning import RowsLeftOut, align
from cylinder_friction.wording import printable

RESOLUTION = {"position_m": 1e-9, DRIVE_FORCE: 1e-6}
"""Largest difference of samples that count as equal, because units or formats differ [m, N]; pressures: 1e-3 Pa."""
OVERLAP_S = 2.0  # Shortest overlap that is named [s], because starts are rounded
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
    names: dict[str, str] = field(default_factory=dict)  # Name of the recording by ``samples_hash``

    def problem(self, name: str, file: str, samples: str) -> str:
        """State whether name or ``samples_hash`` of a recording are known; if not, remember them and return nothing."""
        if name in self.files:
            return f"has the name {name!r}, which {self.files[name]} has already"
        if (copy := self.names.get(samples)) is not None:
            return (
                f"holds the same samples as recording {copy!r} of {self.files[copy]}; a copy would be counted twice, "
                "and a model could be tested on its own training data; keep one of them"
            )
        self.files[name], self.names[samples] = file, name
        return ""


def overlaps_in_words(recordings: Iterable[tuple[Any, float]]) -> str:
    """Name recordings (metadata or entry, and duration [s]) of one session that overlap in time; else empty."""
    sessions: dict[tuple[str, bool], list[tuple[float, float, str]]] = {}
    for who, duration_s in recordings:
        if "T" in who.start:  # a day without a time shows no overlap
            begin_s = float(np.datetime64(who.start.rstrip("Z"), "ms").astype(np.int64)) * 1e-3
            clock = who.session, who.start.endswith("Z")
            sessions.setdefault(clock, []).append((begin_s, begin_s + duration_s, who.name))
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
class Quarantined:
    """A file (its path below the source), or a ``piece`` of one, that did not become a recording, and why.

    Bytes of the path that are not UTF-8, and control characters, are escaped, because pages and JSON hold it.
    """

    file: str
    reason: str
    piece: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", printable(self.file))

    @property
    def where(self) -> str:
        return f"{self.file} ({self.piece})" if self.piece else self.file


@dataclass(frozen=True)
class LoggedFile:
    """A file to be converted, named by its path below the source with ``/``, and what its conversion depends on."""

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


def open_tables(path: Path, recipe: Recipe, rows: int | None = None) -> list[LoggedTable]:
    """Read a file's tables with the mapped channels. A single table of more than ``rows`` rows is read in parts."""
    return read_logged_file(path, recipe.csv, wanted_channels(recipe.channels), database=recipe.database, rows=rows)


def metadata_of(named: RecordingMetadata, source_file: str, digest: str, recipe: Recipe) -> RecordingMetadata:
    """Add to the names of a file what else its recordings share; each has its own sample time and start."""
    cylinder = recipe.limits.cylinder
    areas_m2 = dict(zip(PRESSURES, (cylinder.piston_area_m2, cylinder.annulus_area_m2), strict=True))
    sensors = {column: each.sensor for column, each in recipe.channels.items() if each.sensor is not None}
    return replace(
        named,
        cylinder=cylinder.name,
        uncertainty=sensor_uncertainty(recipe.channels),
        source_file=source_file,
        source_sha256=digest,
        asset=named.asset or recipe.asset,
        sensors={column: sensor.identity for column, sensor in sensors.items() if sensor.identity},
        corrections=channel_corrections(recipe.channels),
        line_loss={
            name: replace(loss, area_m2=areas_m2[name]) for name, own in sensors.items() if (loss := own.line_loss)
        },
    )


def pieces_from(
    tables: Sequence[LoggedTable], recipe: Recipe, about: RecordingMetadata, *, screened: bool = True, above: int = 0
) -> list[Recording]:
    """Map, screen and align tables. Return unbroken pieces in SI units at a constant rate, which are not checked yet.

    Without ``screened``, bad samples are kept for inspection, and only repairs of time are reported. If the tables are
    a part of a file, ``above`` counts the rows above them; a clock made from a stated rate continues from there.
    """
    mapped = map_signals(tables, recipe.channels)
    signals, notes, rules = mapped.signals, tuple[str, ...](), recipe.start
    start, unknown = mapped.start, ""
    if start is not None and is_future(start.at):
        unknown, start = f"its clock started in the future, {start.text()} ({start.source}); its start is unknown", None
    start = start or rules.named(about.source_file)
    rate_hz = recipe.channels[TIME].rate_hz
    if above and rate_hz is not None:
        later = {id(each.time_s): each.time_s + above / rate_hz for each in signals.values()}
        signals = {name: replace(each, time_s=later[id(each.time_s)]) for name, each in signals.items()}
    if screened:
        limits = sensor_limits(recipe.channels)
        signals, bad = screen_signals(signals, limits, recipe.limits.cylinder.stroke_m)
        notes = (*mapped.notes, *bad)
    if start is None and rules.pattern is not None:
        none = f"finds no date in {about.source_file!r}; correct it or the name; until then its start is not known"
        unknown = f"start.pattern '{rules.pattern}' {none}"
    about = replace(about, repairs=notes, start_source=unknown)
    pieces = align(signals, recipe.time, about, rules.in_utc(start))
    if recipe.limits.stated_load is not None:
        pieces = list(map(recipe.limits.stated_load.added, pieces))
    if len(pieces) == 1:
        return pieces
    return [each.described(name=f"{each.name}_part{number}") for number, each in enumerate(pieces, start=1)]


def pieces_of_tables(
    tables: Sequence[LoggedTable], recipe: Recipe, about: RecordingMetadata
) -> Iterator[tuple[Recording | RecordingError, str]]:
    """Yield the pieces of a file, numbered, or errors of parts; memory holds one part of a long file."""
    if tables[0].more is None:
        pieces = pieces_from(tables, recipe, about)
        yield from (
            (each, f"piece {n} of {len(pieces)}" if len(pieces) > 1 else "") for n, each in enumerate(pieces, 1)
        )
        left = (note for note in pieces[0].metadata.repairs if isinstance(note, RowsLeftOut))
        yield from ((RecordingError(f"{note}; if the rate changed, cut the file there"), "rest") for note in left)
        return
    number, rows, last, rules = 0, 0, "", recipe.time
    width, restarted = max(2, len(str(tables[0].parts))), False
    for part in chain(tables, tables[0].more()):
        first, rows = rows, rows + len(part.channels)
        found: Sequence[Recording | RecordingError]
        try:
            found = pieces_from([part], replace(recipe, time=rules), about, above=first)
        except RecordingError as error:
            found = [RecordingError(f"in the part of rows {first + 1} to {rows}, rows counted from there: {error}")]
        for each in found:
            number += 1
            if isinstance(each, Recording):
                rules = replace(rules, rate_hz=rules.rate_hz or 1.0 / each.sample_time_s)  # the first part sets it
                restarted |= each.metadata.start < last  # an earlier start shows a restarted clock
                last = each.metadata.start
                each = each.described(name=f"{about.name}_part{number:0{width}d}")
                each = each.described(start="", start_source="") if restarted else each
            yield each, f"part {number:0{width}d}"


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
                recording = checked_recording(found, file.recipe.limits)
            except RecordingError as error:
                yield Quarantined(file.name, str(error), piece)
                continue
            yield Converted(recording.metadata, recording, samples_hash(found.columns))
    except (RecordingError, OSError) as error:
        yield Quarantined(file.name, str(error), piece and f"after {piece}")


def recordings_of(logs: Logs, rows: int | None = None) -> Iterator[Recording | Quarantined]:
    """Yield the recordings of each log in turn, or the reason why they are unusable; see ``logged_files``."""
    for each in usable(logged_files(logs, rows), converted, SeenRecordings()):
        yield each.result if isinstance(each, Converted) else each


def logged_files(logs: Logs, rows: int | None = None) -> list[LoggedFile]:
    """List logs with their hashes. A file that cannot be read has none, and a later step refuses it."""
    files = []
    for name, path in logs.files.items():
        try:
            digest = hash_of(path) if path.is_file() else ""  # opening a pipe would wait for a writer
        except OSError:
            digest = ""
        files.append(LoggedFile(name, path, logs.recipe, digest, rows, tuple(logs.tables.get(name, ()))))
    return files


OfFile = TypeVar("OfFile", bound=Converted)


def usable(
    files: Sequence[LoggedFile],
    work: Callable[[LoggedFile], Iterable[OfFile | Quarantined]],
    seen: SeenRecordings,
    workers: Workers | None = None,
) -> Iterator[OfFile | Quarantined]:
    """Do the ``work`` on each file; yield its results in order, refuse copies, and add recordings to ``seen``."""
    done = (workers or Workers()).in_order([partial(work, file) for file in files])
    for file, outcomes in zip(files, progress(done, "ingest", len(files), unit="file"), strict=True):
        if isinstance(outcomes, LostPiece):
            yield Quarantined(file.name, outcomes.reason)
            continue
        found = list(outcomes)
        for each in found:
            if isinstance(each, Quarantined):
                yield each
            elif problem := seen.problem(each.metadata.name, file.name, each.samples):
                yield Quarantined(file.name, problem, each.metadata.name if len(found) > 1 else "")
            else:
                yield each


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
    return RecordingError(f"{where}: no file is usable (of {files}); the first, {first.file}: {first.reason}")

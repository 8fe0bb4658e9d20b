"""A log too long for memory, part by part: read, mapped, screened and put on one sample grid as a whole one would be.

Each part sees rows of its neighbours beside its own, further than any filter looks, and its border lies where the clock
runs undisturbed, so that gaps, restarts and damaged stamps are never cut in two. What is decided for a whole file is
decided once: its sample rate by the first part, what counts as a spike by rows spread over the file, and how many bad
samples are too many at its end.
"""

import math
import tempfile
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.checks.position_faults import without_position_faults
from cylinder_friction.recordings.checks.recording_checks import (
    checked_recording,
    findings_of_parts,
    inspect_recording,
    length_finding,
)
from cylinder_friction.recordings.checks.screening import Screen
from cylinder_friction.recordings.columns import TIME
from cylinder_friction.recordings.conversion import Recipe, open_tables, pieces_from, pieces_of
from cylinder_friction.recordings.formats.logged_table import MOST_INDIVISIBLE, LoggedTable, LongTable
from cylinder_friction.recordings.mapping.calibration import ZeroReading, apply_zero, find_zero
from cylinder_friction.recordings.mapping.channel_mapping import sensor_limits
from cylinder_friction.recordings.mapping.mapped_file import map_signals, take_delays
from cylinder_friction.recordings.progress import shown
from cylinder_friction.recordings.recording import (
    Columns,
    Recording,
    RecordingError,
    RecordingMetadata,
    RecordingPiece,
    Signal,
)
from cylinder_friction.recordings.start import Start
from cylinder_friction.recordings.storage import read_recording, write_recording, write_scratch
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.recordings.timeline.timestamps import stamps_to_datetimes, stamps_to_seconds

ROWS_AT_ONCE = 1 << 18
"""A longer log is processed in parts of about so many rows."""
EXCERPT_ROWS = 1 << 20
"""What holds for a whole recording is found from at most so many of its rows, in parts spread evenly over it."""

CONTEXT_ROWS, CONTEXT_S = 8192, 1.0
"""Rows of its neighbours that a part sees on either side, and the time that they last at least."""
UNDISTURBED_ROWS = 64
"""Around a border between two parts so many stamps to either side increase without a gap."""
SAME_STEP = 0.25
"""Where the sample time between two parts is off by more than this share, they become two recordings."""
MOST_REPAIRS = 5
"""So many sentences about repairs in single parts are kept."""


class IndivisibleError(RecordingError):
    """A log that cannot be cut into parts; the message states why, and what to do."""


@dataclass(frozen=True)
class LogPart:
    """Part of a long log. Some rows of its piece are its own, the others belong to its neighbours."""

    piece: RecordingPiece
    own: slice
    continues: bool  # Whether its own rows follow on those of the part before
    of_file: tuple[str, ...]  # What was found in single samples of the whole file; empty until the last section


def own_columns(part: LogPart) -> Columns:
    """Return the columns of a part's own rows."""
    return {name: values[part.own] for name, values in part.piece.columns.items()}


def parts_of(table: LongTable, recipe: Recipe, rows: int, name: str) -> Iterator[LogPart]:
    """Yield the parts of a long log in order, of about this many rows; their pieces state the repairs.

    The progress bar shows the file's ``name``.

    Raises:
        RecordingError: As for a file that is read whole, for single bad samples at the end; or it cannot be cut.
    """
    mapped = _Mapped(recipe)
    screen = Screen(sensor_limits(recipe.channels), recipe.screen, recipe.limits.stroke_m, _heights(table, recipe))
    rules, step_s, last_s, origin_s = recipe.time, 0.0, math.nan, None
    chunks = shown(table.chunks(), name, table.count, "part", leave=False)
    for section in _sections(map(mapped.of, chunks), rows, rules.longest_bridge_samples):
        pieces = _aligned(section, screen, replace(recipe, time=rules), origin_s)
        step_s, origin_s = step_s or pieces[0].sample_time_s, pieces[-1].origin_s
        rules = replace(rules, rate_hz=rules.rate_hz or 1.0 / step_s)
        notes, of_file = mapped.take_notes(), screen.notes() if section.last else ()
        for piece, own in _own_rows(pieces, section):
            time_s = piece.columns[TIME]
            follows = piece.segment == 0 and abs((time_s[own.start] - last_s) / step_s - 1.0) <= SAME_STEP
            last_s = float(time_s[own.stop - 1])
            repairs = (*notes, *piece.repairs)
            yield LogPart(
                replace(piece, sample_time_s=step_s, repairs=repairs, start=mapped.start), own, follows, of_file
            )


class _Mapped:
    """Maps one chunk after the other, and keeps what continues from one to the next: the rows and the clock's start."""

    def __init__(self, recipe: Recipe) -> None:
        # Delays are taken when a section is put on the grid.
        self.channels = {
            column: replace(source, sensor=source.sensor and replace(source.sensor, delay_s=0.0))
            for column, source in recipe.channels.items()
        }
        self.rows = 0
        self.origin: pd.Timestamp | None = None
        self.start: Start | None = None  # When its clock was at 0 s
        self._notes: list[str] = []

    def of(self, table: LoggedTable) -> pd.DataFrame:
        """Return time and columns of the next chunk, which share one clock."""
        try:
            mapped = map_signals([self._since_start(table)], self.channels)
            self.start = self.start or mapped.start
        except RecordingError as error:
            where = f"below row {self.rows}, from which rows count here: " if self.rows else ""
            raise RecordingError(f"{where}{error}") from None
        self._notes += mapped.notes
        time_s, *others = {id(signal.time_s): signal.time_s for signal in mapped.signals.values()}.values()
        if others:
            raise IndivisibleError("it has channels with clocks of their own; export it with one time channel")
        if (rate_hz := self.channels["time_s"].rate_hz) is not None:
            time_s = (self.rows + np.arange(len(time_s))) / rate_hz
        self.rows += len(time_s)
        columns = {column: signal.values for column, signal in mapped.signals.items()}
        return pd.DataFrame({"time_s": time_s, **columns}, copy=False)

    def take_notes(self) -> list[str]:
        """Return what the reader repaired since the last call."""
        notes, self._notes = list(dict.fromkeys(self._notes)), []
        return notes

    def _since_start(self, table: LoggedTable) -> LoggedTable:
        """Return dates as seconds since the first one of the file; in a chunk alone they would count from its own."""
        dates = table.channels.select_dtypes(["datetime", "datetimetz"])
        if not len(dates.columns):
            return table
        if self.origin is None:
            self.origin = dates.min().min()
            at, utc = stamps_to_datetimes(pd.Series([self.origin]))[0], table.utc or self.origin.tzinfo is not None
            self.start = Start(at, utc, f"time stamps of {dates.columns[0]!r}", dated_rows=True)
        seconds = {str(name): stamps_to_seconds(dates[name], self.origin) for name in dates.columns}
        units = {**table.units, **dict.fromkeys(seconds, "s")}
        return replace(table, channels=table.channels.assign(**seconds), units=units)


def _heights(table: LongTable, recipe: Recipe) -> dict[str, float]:
    """Return how high a spike is in each column, without chunks that cannot be mapped: reading them states why."""
    mapped, found = _Mapped(recipe), [pd.DataFrame()]
    for chunk in table.spread():
        with suppress(RecordingError):
            found.append(mapped.of(chunk).drop(columns="time_s"))
    screen = Screen(sensor_limits(recipe.channels), recipe.screen, recipe.limits.stroke_m)
    columns = pd.concat(found[1:] or found)
    return {str(column): screen.height(str(column), values.dropna().to_numpy()) for column, values in columns.items()}


@dataclass(frozen=True)
class _Section:
    """Rows of a log as they were logged: time and columns."""

    table: pd.DataFrame
    own: slice  # Rows that no other section has
    before: int  # Rows of the log before the first of these
    last: bool = False  # Whether the log ends here


def _sections(chunks: Iterator[pd.DataFrame], rows: int, longest_bridge: int) -> Iterator[_Section]:
    """Yield sections of about this many rows, with rows of their neighbours, cut where the clock is undisturbed."""
    held = pd.DataFrame()
    first = before = 0
    for chunk in chunks:
        held = pd.concat([held, chunk], ignore_index=True) if len(held) else chunk
        context = _context_rows(held["time_s"].to_numpy())
        while len(held) >= first + rows + 2 * context:
            cut = _undisturbed(held["time_s"].to_numpy(), first, rows, context, longest_bridge)
            if cut is None:
                if len(held) - first > 4 * (rows + context):
                    raise IndivisibleError(
                        f"in {len(held) - first} rows from row {before + first + 1} on, time increases nowhere "
                        f"without a gap over {2 * UNDISTURBED_ROWS} rows, far from any restart; log time with a finer "
                        "resolution"
                    )
                break
            yield _Section(held.iloc[: cut + context], slice(first, cut), before)
            dropped = max(cut - context, 0)
            held, first, before = held.iloc[dropped:], cut - dropped, before + dropped
    if len(held):
        yield _Section(held, slice(first, len(held)), before, last=True)


def _context_rows(time_s: Array) -> int:
    steps_s = np.diff(time_s[:CONTEXT_ROWS])
    usual_s = float(np.median(steps_s[steps_s > 0.0])) if (steps_s > 0.0).any() else CONTEXT_S
    return max(CONTEXT_ROWS, round(CONTEXT_S / usual_s))


def _undisturbed(time_s: Array, first: int, rows: int, context: int, longest_bridge: int) -> int | None:
    """Return the row nearest to ``first + rows`` around which the clock is undisturbed, or None.

    Stamps increase without a gap over ``UNDISTURBED_ROWS`` to either side, and the clock does not restart in
    ``context``: there, medians over as many stamps increase, which single damaged ones do not change.
    """
    steps_s = np.diff(time_s)
    known = steps_s[steps_s > 0.0]
    usual_s = float(np.median(known)) if len(known) else 0.0
    bad = np.append(False, ~((steps_s > 0.0) & (steps_s <= (longest_bridge + 1.5) * usual_s)))
    if not bad.any():
        return min(first + rows, len(bad) - context - 1)
    medians_s = np.nanmedian(time_s[: len(bad) // UNDISTURBED_ROWS * UNDISTURBED_ROWS].reshape(-1, UNDISTURBED_ROWS), 1)
    restarts = UNDISTURBED_ROWS * (1 + np.flatnonzero(~(np.diff(medians_s) > 0.0)))
    counted, row = np.concatenate([[0], np.cumsum(bad)]), np.arange(len(bad))
    around = [np.clip(row + side, 0, len(bad)) for side in (-UNDISTURBED_ROWS, UNDISTURBED_ROWS)]
    good = counted[around[0]] == counted[around[1]]
    for restart in restarts:
        good[max(restart - context - 2 * UNDISTURBED_ROWS, 0) : restart + context + 2 * UNDISTURBED_ROWS] = False
    good[: first + rows // 2], good[len(good) - context :] = False, False
    possible = np.flatnonzero(good)
    return int(possible[np.argmin(np.abs(possible - first - rows))]) if len(possible) else None


def _aligned(section: _Section, screen: Screen, recipe: Recipe, origin_s: float | None) -> list[RecordingPiece]:
    time_s, own = section.table["time_s"].to_numpy(), section.own
    columns = section.table.drop(columns="time_s").items()
    signals = {str(column): Signal(time_s, values.to_numpy()) for column, values in columns}
    try:
        signals = screen.screened(signals, own, section.before)
        signals, faults = without_position_faults(signals, recipe.limits.stroke_m)
        notes = [*faults, *take_delays(signals, recipe.channels)]
        pieces = align(signals, recipe.time, origin_s)
    except RecordingError as error:
        first, last = section.before + own.start + 1, section.before + own.stop
        raise RecordingError(f"rows {first} to {last}: {error}") from None
    return [replace(piece, repairs=(*notes, *piece.repairs)) for piece in pieces]


def _own_rows(pieces: Sequence[RecordingPiece], section: _Section) -> Iterator[tuple[RecordingPiece, slice]]:
    """Yield each piece that has rows of its own, and which rows these are."""
    stamps_s = section.table["time_s"].to_numpy()
    for piece in pieces:
        time_s = piece.columns[TIME]
        first, end = 0, len(time_s)
        # Multiples of the sample time may miss a stamp by rounding.
        slack_s = 1e-6 * piece.sample_time_s
        if section.before + section.own.start > 0 and piece.segment == 0:
            first = int(np.searchsorted(time_s, stamps_s[section.own.start] - slack_s))
        if not section.last and piece.segment == pieces[-1].segment:
            end = int(np.searchsorted(time_s, stamps_s[section.own.stop] - slack_s))
        if first < end:
            yield piece, slice(first, end)


@dataclass(frozen=True)
class LongRecording:
    """A recording on disk, in parts."""

    metadata: RecordingMetadata
    paths: tuple[Path, ...]
    own: tuple[slice, ...]  # Rows of each part that no other has; the others are its neighbours'
    zeros: Mapping[str, float] = field(default_factory=dict)  # To be taken off each column, in its unit
    noise: Mapping[str, float] = field(default_factory=dict)  # As in ``Recording``
    in_parts: bool = True  # Whether it was read so; otherwise it is a whole one that was put there

    def __len__(self) -> int:
        return sum(own.stop - own.start for own in self.own)

    def parts(self) -> Iterator[tuple[Recording, slice]]:
        """Yield each part with rows of its neighbours, and which rows are its own."""
        for path, own in zip(self.paths, self.own, strict=True):
            yield self._read(path), own

    def excerpt(self) -> list[Recording]:
        """Return the recording as one if it is short enough, else parts that are spread evenly over it."""
        count = len(self.paths)
        most = min(max(1, EXCERPT_ROWS * count // len(self)), count)
        chosen = [(2 * place + 1) * count // (2 * most) for place in range(most)]
        found = [self._read(self.paths[index]).rows(self.own[index]) for index in chosen]
        if most < count or count == 1:
            return found
        joined = {name: np.concatenate([part.columns[name] for part in found]) for name in found[0].columns}
        return [replace(found[0], columns=joined)]

    def remove(self) -> None:
        """Remove the parts from the disk."""
        for path in self.paths:
            path.unlink()

    def _read(self, path: Path) -> Recording:
        recording = read_recording(path, self.metadata, self.noise)
        zeroed = {name: recording.column(name) - zero for name, zero in self.zeros.items()}
        return recording.with_columns(**zeroed) if zeroed else recording


def on_disk(
    recording: Recording, folder: Path, write: Callable[[Path, Recording, str], Path] = write_recording
) -> LongRecording:
    """Write a recording into a folder, under a name of its own; return it as one that lies there."""
    path = write(folder, recording, uuid.uuid4().hex)
    return LongRecording(recording.metadata, (path,), (slice(0, len(recording)),), in_parts=False)


class Draft:
    """A recording of a long log while that is read: its parts, and what each of them shows."""

    def __init__(self, folder: Path, stem: str) -> None:
        self.folder, self.stem = folder, stem
        self.paths: list[Path] = []
        self.own: list[slice] = []
        self.findings: list[tuple[float, list[Finding]]] = []
        self.zeros: list[ZeroReading] = []
        self.repairs: list[str] = []
        self.start: Start | None = None
        self.segment = 0

    def add(self, part: LogPart, recipe: Recipe) -> None:
        """Keep a part on disk."""
        columns, step_s = own_columns(part), part.piece.sample_time_s
        self.start, self.segment = part.piece.start, part.piece.segment if not self.paths else self.segment
        found = inspect_recording(columns, recipe.limits, step_s)
        self.findings.append((float(columns[TIME][0]), [each for each in found if each.check != "length"]))
        self.zeros.append(find_zero(columns, recipe.zero, recipe.channels))
        self.repairs += [each for each in part.piece.repairs if each not in self.repairs]
        metadata = RecordingMetadata(f"{self.stem}.{len(self.paths):06d}", "", "", step_s)
        self.paths.append(write_scratch(self.folder, Recording(metadata, part.piece.columns), metadata.name))
        self.own.append(part.own)

    def first(self) -> RecordingPiece:
        """Return the own rows of the first part."""
        recording = read_recording(self.paths[0]).rows(self.own[0])
        repairs, more = self.repairs[:MOST_REPAIRS], len(self.repairs) - MOST_REPAIRS
        if more > 0:
            repairs.append(f"{more} more repairs in other parts of the file")
        return RecordingPiece(
            recording.columns, recording.sample_time_s, tuple(repairs), self.segment, start=self.start
        )

    def checked(self, metadata: RecordingMetadata, recipe: Recipe, session: ZeroReading | None) -> LongRecording:
        """Return the recording, with what ``conversion.checked`` does; of its zeros that of the longest stretch counts.

        Raises:
            RecordingError: A check is not passed; see ``findings_of_parts``.
        """
        columns, rows = self.first().columns, sum(own.stop - own.start for own in self.own)
        read = [each for each in self.zeros if each.offsets]
        zero = max(read, key=lambda each: each.to_s - each.from_s) if read else session or self.zeros[0]
        _, metadata = apply_zero(columns, metadata, zero, recipe.channels)
        length = length_finding(rows, metadata.sample_time_s, recipe.limits)
        findings = [length, *findings_of_parts(self.findings)]
        metadata = checked_recording(metadata, columns, findings).metadata
        return LongRecording(metadata, tuple(self.paths), tuple(self.own), metadata.zero_offset)


def pieces_or_drafts(
    path: Path, recipe: Recipe, rows: int | None, folder: Path | None
) -> list[RecordingPiece] | list[Draft]:
    """Return the unbroken stretches of a file, as drafts kept in a folder if it has more rows than these."""
    tables = open_tables(path, recipe, rows)
    if not isinstance(tables, LongTable):
        return pieces_from(tables, recipe)
    assert rows is not None
    assert folder is not None
    drafts: list[Draft] = []
    folder.mkdir(parents=True, exist_ok=True)
    own_folder = Path(tempfile.mkdtemp(dir=folder))
    try:
        for part in parts_of(tables, recipe, rows, path.name):
            if not (part.continues and drafts):
                drafts.append(Draft(own_folder, f"{len(drafts):06d}"))
            drafts[-1].add(part, recipe)
    except IndivisibleError as error:
        return _whole(path, recipe, error)
    for draft in drafts:
        draft.repairs[:0] = part.of_file
    return drafts


def pieces_in_turn(path: Path, recipe: Recipe, rows: int | None) -> Iterator[RecordingPiece]:
    """Yield the unbroken stretches of a file, and those of a file of more rows than these part by part."""
    tables = open_tables(path, recipe, rows)
    if not isinstance(tables, LongTable):
        yield from pieces_from(tables, recipe)
        return
    assert rows is not None
    try:
        for part in parts_of(tables, recipe, rows, path.name):
            yield replace(part.piece, columns=own_columns(part))
    except IndivisibleError as error:
        yield from _whole(path, recipe, error)


def _whole(path: Path, recipe: Recipe, error: IndivisibleError) -> list[RecordingPiece]:
    if path.stat().st_size > MOST_INDIVISIBLE:
        raise RecordingError(
            f"is too large to be read whole ({path.stat().st_size / 1e6:.0f} MB, at most {MOST_INDIVISIBLE / 1e6:.0f} "
            f"MB), and cannot be processed in parts: {error}, or split the file"
        )
    return pieces_of(path, recipe)

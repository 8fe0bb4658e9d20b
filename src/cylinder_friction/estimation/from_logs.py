"""Logger files become files of friction and one page; memory holds one recording, or one part of a long one."""

from __future__ import annotations

import hashlib
import math
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.earlier import (
    Earlier,
    Processed,
    read_earlier,
    result_files,
    sort_logs,
    write_earlier,
)
from cylinder_friction.estimation.results import FrictionOfLogs, FrictionOfRecording, known_number, table_rows
from cylinder_friction.evaluation.friction_levels import friction_levels
from cylinder_friction.evaluation.inspection.friction_view import view_of_labelled
from cylinder_friction.execution.workers import Died, Workers
from cylinder_friction.labelling.known_offset import (
    STROKES,
    KnownOffset,
    OffsetEvidence,
    known_offsets,
    offset_evidence,
)
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.load import pooled_load
from cylinder_friction.labelling.offset_identification import MOST_SEARCHED
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.labelling.sliding_blocks import LOADED, OffsetPlan
from cylinder_friction.labelling.up_and_down import holds_load, up_and_down
from cylinder_friction.realtime.flags import Flag, unknown_in_words
from cylinder_friction.recordings.checks.duplicate_detection import DuplicateDetection
from cylinder_friction.recordings.checks.limits import LoadMode
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, DRIVE_FORCE, LOAD_FORCE, PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.files import hash_of, whole_file, write_json, write_text
from cylinder_friction.recordings.ingesting import ConvertedPiece, Quarantined, worked_on
from cylinder_friction.recordings.long_logs import ROWS_AT_ONCE, LongRecording, on_disk
from cylinder_friction.recordings.mapping.channel_mapping import sensor_uncertainty
from cylinder_friction.recordings.reading_logs import Logs, find_logs
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.recordings.result_folder import ResultFolder, existing
from cylinder_friction.recordings.storage import write_parts, write_recording, write_scratch
from cylinder_friction.reporting.friction_page import friction_pane, pane_file, write_friction_page
from cylinder_friction.reporting.level_tables import level_tables
from cylinder_friction.reporting.page import PLOTTED
from cylinder_friction.signals.methods import default_filter, warn_of_rates
from cylinder_friction.signals.noise import noise_deviation
from cylinder_friction.signals.smooth_signals import SignalFilter, filtered, has_pressures, smooth_recording

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

FileFormat = Literal["parquet", "csv", "mdf"]
SUFFIXES = {"parquet": ".parquet", "csv": ".csv", "mdf": ".mf4"}
TYPICAL_CLASS = 0.5
"""Accuracy of most pressure sensors of machines, ± percent of full scale."""
SUMMARY_FILE, PAGE_FILE = "summary.json", "friction.html"
LABEL_BOUNDS = (
    "friction lies between them in about 95 % of the rows (k = 2: sensors as stated, smoothing, load, sensor offset)"
)


def estimate_logs(
    files: str | Path | Iterable[str | Path],
    cylinder: Cylinder,
    into: str | Path = "friction",
    *,
    channels: str | Path | Mapping[str, Any] | None = None,
    model: FrictionEstimator | str | Path | None = None,
    load: LoadMode | None = None,
    names: str | None = None,
    units: Mapping[str, str] | None = None,
    sensor_class: float | None = None,
    database: str | Path | None = None,
    other_cylinder: bool = False,
    file_format: FileFormat = "parquet",
    rows_at_once: int = ROWS_AT_ONCE,
    workers: Workers | None = None,
) -> FrictionOfLogs:
    """Write the friction of logger files into a folder: one file per recording, ``summary.json`` and one page.

    Each file has a row per sample: what was measured, in SI units, ``velocity_m_s`` (extension positive),
    ``friction_n`` (positive when it opposes positive velocity), ``lower_n``, ``upper_n``, ``usable``, and
    ``load_force_n`` where a load was taken off. Without a model friction is the off-line label, which looks ahead, less
    the sensors' offset where strokes determine it. With one it is the real-time estimate; its ``flags`` and the label,
    ``label_n``, stand beside it. Of logs that an earlier call wrote into this folder only those are processed that are
    new.

    Args:
        files, channels, load, names, units, sensor_class: As in ``read_recordings``.
        database: Of a bus (DBC), for measurement files of CAN frames.
        cylinder: Whose recordings they are.
        into: A new folder, or one that an earlier call wrote. Files that no earlier call wrote stay in it.
        model: An estimator or the folder of a saved one; logs are resampled to its rate. None: the off-line label.
        other_cylinder: Whether a model may be of a cylinder of other areas.
        file_format: ``parquet``, ``csv`` or ``mdf``: all that a measurement file holds, with the results beside it.
        rows_at_once: A log of more rows is processed in parts of about so many, so that memory holds one of them.
        workers: Work on recordings side by side; None: one after the other, here.

    Raises:
        OtherCylinderError: The model was trained for a cylinder of other areas.
        RecordingError: No file is found, or the mapping is wrong or cannot be guessed. Single files that cannot be
            used are listed in ``refused``.
        FileExistsError: The folder holds something else, or is, holds or lies in what is read, or another call is
            writing it.

    Example:
        >>> logs = "data/raw/rig/condition1_*.csv"
        >>> result = cf.estimate_logs(logs, cylinder, "friction", channels="conf/ingest/rig.yaml")
        >>> [recording.name for recording in result.recordings]  # doctest: +ELLIPSIS
        ['condition1_session01_recording01', ...]
        >>> result.refused
        []
    """
    into = Path(into)
    files = files if isinstance(files, str | Path) else list(files)
    estimator = _loaded_once(Path(model)) if isinstance(model, str | Path) else model
    if estimator is not None and estimator.trained_for is not None and not other_cylinder:
        estimator.trained_for.refuse(cylinder)
    rate_hz = None if estimator is None or estimator.sample_time_s is None else 1.0 / estimator.sample_time_s
    given: dict[str, Any] = {"names": names, "load": load, "rate_hz": rate_hz, "units": units, "database": database}
    logs = find_logs(files, channels, cylinder, **given).with_sensor_class(sensor_class)
    read = inputs(files, channels, model, logs)
    depends_on = _depends_on(logs, cylinder, estimator, file_format)
    with ResultFolder(into, SUMMARY_FILE, "cylinder-friction estimate", read).written() as folder:
        earlier = read_earlier(into, depends_on)
        found = sort_logs(logs, earlier)
        scratch = folder / ".scratch"
        run = LabelledLogs(
            replace(logs, files=found.new), cylinder, scratch, estimator, rows_at_once, workers, depends_on
        )
        processed = _processed(run, folder, file_format, found.kept)
        kept = {each.entry.name for each in found.kept}
        new = tuple(each.entry.name for each in processed if each.entry.name not in kept)
        offsets = {each.session: each for each in earlier.offsets} | run.offsets
        sessions = {each.entry.session for each in processed}
        known = [each for name, each in sorted(offsets.items()) if name in sessions]
        bounds = _bounds_in_words(run, any(each.bounded for each in processed))
        shutil.rmtree(scratch, ignore_errors=True)
        entries = [each.entry for each in processed]
        result = FrictionOfLogs(into, bounds, entries, run.refused, known, new, found.news, depends_on, logs.guessed)
        if found.same:
            return result
        write_earlier(folder, Earlier(depends_on, tuple(processed), tuple(known)))
        rows = table_rows(result)
        tables = level_tables(result.differences, result.levels)
        write_friction_page(folder / PAGE_FILE, rows, known, bounds, logs.guessed, tables)
        stays = [[*result_files(into, name), pane_file(name)] for name in sorted(kept)]
        write_json(folder / SUMMARY_FILE, result.to_dict() | {"kept": list(chain(*stays))})
    return result


def inputs(files: Any, channels: Any, model: Any, logs: Logs) -> tuple[Path, ...]:
    """Return every file and folder that a run on logs reads, as far as they were given as paths."""
    given = [files] if isinstance(files, str | Path) else list(files)
    paths = [path for path in (*given, channels, model) if isinstance(path, str | Path)]
    return (*existing(paths), *logs.files.values())


@dataclass(frozen=True)
class RecordingFriction:
    """How one recording gets its friction, wherever that is done."""

    labeller: Labeller
    filter: SignalFilter
    plan: OffsetPlan
    scratch: Path  # A folder that may be removed afterwards
    # What friction comes from, or where it is saved; None: the label, less the sensors' offset where it is known
    model: FrictionEstimator | Path | None
    # SHA-256 of what results depend on beside the logs, for their metadata
    depends_on: Mapping[str, str] = field(default_factory=dict)

    @property
    def estimator(self) -> FrictionEstimator | None:
        return _loaded_once(self.model) if isinstance(self.model, Path) else self.model

    def identified(self, sources: Sequence[LongRecording]) -> SessionIdentification | str:
        """Return load and mass of a session, or why its recordings do not determine them."""
        smooth = (filtered(part, self.filter) for source in sources for part in source.excerpt())
        try:
            return self.labeller.identify(smooth, self.filter)
        except ValueError as error:
            return str(error)

    def kept(self, source: Recording | LongRecording) -> LongRecording:
        """Return a recording as one that lies on disk, and knows its noise if it does so in parts."""
        if isinstance(source, Recording):
            return on_disk(source, self.scratch / "converted", write_scratch)
        return with_noise(source, self.labeller.cylinder) if source.in_parts else source

    def labelled_alone(self, source: Recording | LongRecording) -> tuple[LongRecording, list[OffsetEvidence]] | str:
        """Return a recording ``labelled`` where nothing has to be identified; what is read is removed."""
        kept = source if isinstance(source, Recording) else self.kept(source)
        result = self.labelled(kept, None)
        if isinstance(kept, LongRecording):
            kept.remove()
        return result

    def labelled_in_session(
        self, source: LongRecording, identified: SessionIdentification | Died | str
    ) -> tuple[LongRecording, list[OffsetEvidence]] | Died | str:
        """Return a recording ``labelled``, or why its session was not identified."""
        return self.labelled(source, identified) if isinstance(identified, SessionIdentification) else identified

    def labelled(
        self, source: Recording | LongRecording, identified: SessionIdentification | None
    ) -> tuple[LongRecording, list[OffsetEvidence]] | str:
        """Return a recording with its friction, on disk, and what its label shows of an offset; or why it is refused.

        What is read of it is yet to be ``finished``.
        """
        parts = source.parts() if isinstance(source, LongRecording) else [(source, slice(0, len(source)))]
        estimator = self.estimator
        running = None if estimator is None else _RunningEstimate(_for_load(estimator, identified))
        paths: list[Path] = []
        own_rows: list[slice] = []
        try:
            for recording, own in parts:
                labelled = self.labeller.labelled(filtered(recording, self.filter), self.filter, identified)
                labelled = labelled.rows(own) if running is None else running.estimated(labelled, own)
                stem = f"{recording.name}.{len(paths):06d}"
                write = write_scratch if isinstance(source, Recording) else write_recording
                paths.append(write(self.scratch / "labelled", labelled, stem))
                own_rows.append(slice(0, len(labelled)))
        except ValueError as error:  # shorter than the filter, or not what the estimator takes
            return str(error)
        result = LongRecording(source.metadata, tuple(paths), tuple(own_rows))
        if estimator is not None:
            return result, []
        return result, list(map(self._evidence, [labelled] if len(paths) == 1 else result.excerpt()))

    def _evidence(self, recording: Recording) -> OffsetEvidence:
        known = LOADED.get(self.labeller.load, "")
        return offset_evidence(recording, self.labeller.cylinder, self.plan, *self._halves([recording]), known)

    def _halves(self, recordings: Sequence[Recording]) -> tuple[float, float]:
        """Return half the sum and half the difference of friction up and down at equal position [N]."""
        columns = ("position_m", "velocity_m_s", "friction_n")
        position_m, velocity_m_s, friction_n = (
            np.concatenate([recording.column(name) for recording in recordings]) for name in columns
        )
        usable = np.concatenate([recording.usable() for recording in recordings])
        return up_and_down(position_m, velocity_m_s, friction_n, usable, self.plan.slowest_m_s)

    def finished(self, recording: Recording, known: KnownOffset | None) -> Recording:
        """Return a recording with its bounds, and without the offset of its session where strokes determine it."""
        if known is None:
            return recording.without_columns(UNCERTAINTY_COLUMN)
        friction_n, half_n = recording.column("friction_n"), np.full(len(recording), math.nan)
        if UNCERTAINTY_COLUMN in recording.table.columns:
            half_n = recording.column(UNCERTAINTY_COLUMN)
        if known.source == STROKES:
            friction_n = friction_n - known.offset_n
            half_n = np.sqrt(np.maximum(half_n**2 - known.stated_n**2, 0.0) + known.uncertainty_n**2)
        bounds = {"lower_n": friction_n - half_n, "upper_n": friction_n + half_n}
        return recording.with_columns(friction_n=friction_n, **bounds).without_columns(UNCERTAINTY_COLUMN)

    def entry(self, excerpt: Sequence[Recording], load: str, counts: RowCounts | None = None) -> FrictionOfRecording:
        """Return what became of a recording.

        Args:
            excerpt: The recording, finished, or parts of it.
            load: Which load was identified and taken off, in words; empty where none was.
            counts: Of all its rows; None where the excerpt holds them.
        """
        counts = counts or RowCounts.of(excerpt)
        load_n, half_n = self._halves(excerpt)
        estimator = self.estimator
        about, given = excerpt[0].metadata, None if estimator is None else estimator.position_load
        known = self.labeller.load if given is None else given.in_words()
        trained = None if estimator is None else estimator.trained_for
        other, noisy = ("", "") if trained is None else trained.differences(excerpt)
        return FrictionOfRecording(
            name=about.name,
            source_file=about.source_file,
            source_sha256=about.source_sha256,
            session=about.session,
            condition=about.condition,
            asset=about.asset,
            start=about.start,
            start_source=about.start_source,
            sensors=dict(about.sensors),
            rows=counts.rows,
            duration_s=counts.rows * about.sample_time_s,
            usable_percent=100.0 * counts.usable / counts.rows,
            friction_n=known_number(half_n),
            flags_percent=None if estimator is None else counts.flags_percent(),
            load=load or known,
            not_known=other or unknown_in_words(counts.rows, counts.flags),
            unlike_training=noisy,
            load_left_n=known_number(load_n) if holds_load(load_n, half_n) else None,
            repairs=tuple(about.repairs),
            levels=friction_levels(excerpt),
        )

    def written(
        self,
        labelled: LongRecording,
        known: KnownOffset | None,
        load: str,
        folder: Path,
        file_format: FileFormat,
        detailed: bool,
        log: Path,
    ) -> tuple[FrictionOfRecording, bool] | str:
        """Write file and pane of one recording; return what became of it and whether it has bounds, or what failed.

        Args:
            labelled: The recording with its friction.
            known: What is known of the sensors' offset; None with an estimator.
            load: As in ``entry``.
            folder: Where file and pane go.
            file_format: Of the file.
            detailed: Whether the pane shows friction against velocity, and the Stribeck curve.
            log: What the recording was read from.
        """
        name, path = labelled.metadata.name, folder / f"{labelled.metadata.name}{SUFFIXES[file_format]}"
        labelled = replace(labelled, metadata=replace(labelled.metadata, depends_on=self.depends_on))
        counts = RowCounts()
        whole = [self.finished(part, known) for part in labelled.excerpt()] if len(labelled.paths) == 1 else []
        parts = iter(whole) if whole else (self.finished(part, known) for part, _ in labelled.parts())
        try:
            _write(_counted(parts, counts), path, log)
        except RecordingError as error:
            return f"its results cannot be written as {file_format}: {error}"
        excerpt = whole or [self.finished(part, known) for part in labelled.excerpt()]
        view, first = None, excerpt[0]
        if detailed:
            view = view_of_labelled(first, smooth_recording(first, self.filter), self.labeller.cylinder, self.filter)
        shown = "" if len(excerpt) == 1 else _shown(first, len(labelled))
        write_text(folder / pane_file(name), friction_pane(first, view, shown))
        return self.entry(excerpt, load, counts), counts.bounded


@lru_cache(maxsize=1)
def _loaded_once(folder: Path) -> FrictionEstimator:
    from cylinder_friction.estimators.loading import load_estimator  # what only labels need not wait for it

    return load_estimator(folder)


class LabelledLogs:
    """The recordings of logger files with their friction, each kept in ``scratch`` between two passes.

    Args:
        logs: The files.
        cylinder: Whose recordings they are.
        scratch: A folder that may be removed afterwards.
        estimator: What friction comes from; None: the off-line label, less the sensors' offset where it is known.
        rows_at_once: A log of more rows is processed in parts of about so many, so that memory holds one of them.
        workers: Work on recordings side by side; None: one after the other, here.
        depends_on: SHA-256 of what results depend on beside the logs, for their metadata.

    Attributes:
        refused: Files and recordings that could not be used, once ``recordings`` has ended.
        offsets: What is known of the sensors' offset by session, from then on; empty with an estimator.
        loads: By recording, which load was taken off, in words.
        evidence: By recording, what it shows of the sensors' offset.
        seen: All recordings, by the hashes of their windows.
    """

    def __init__(
        self,
        logs: Logs,
        cylinder: Cylinder,
        scratch: Path,
        estimator: FrictionEstimator | None,
        rows_at_once: int = ROWS_AT_ONCE,
        workers: Workers | None = None,
        depends_on: Mapping[str, str] | None = None,
    ) -> None:
        self.logs, self.cylinder, self.scratch = logs, cylinder, scratch
        self.rows_at_once, self.workers = rows_at_once, workers or Workers()
        model: FrictionEstimator | Path | None = estimator
        if estimator is not None and not self.workers.here:
            model = scratch / "model"  # read once by each worker
            estimator.save(model)
        labeller = Labeller(cylinder, load=logs.recipe.limits.load)
        self.friction = RecordingFriction(
            labeller, default_filter(cylinder), OffsetPlan(), scratch, model, depends_on or {}
        )
        self.refused: list[Quarantined] = []
        self.offsets: dict[str, KnownOffset] = {}
        self.loads: dict[str, str] = {}
        self.evidence: dict[str, list[OffsetEvidence]] = {}
        self.seen = DuplicateDetection()

    def recordings(self) -> Iterator[Recording]:
        """Yield each usable recording with friction, bounds, velocity and usable rows; of a long one an excerpt."""
        for labelled in self.labelled():
            parts = labelled.excerpt()
            for number, part in enumerate(parts, start=1):
                name = f"{part.name}, excerpt {number} of {len(parts)}" if len(parts) > 1 else part.name
                part = replace(part, metadata=replace(part.metadata, name=name))
                yield self.friction.finished(part, self.offsets.get(part.metadata.session))

    def labelled(self, earlier: Sequence[Processed] = ()) -> list[LongRecording]:
        """Return each usable recording with its friction, on disk; what is read of it is yet to be ``finished``.

        Recordings of ``earlier`` runs are not worked on. New ones are compared with them, and offsets are identified
        beside those of at most ``MOST_SEARCHED`` of their sessions, evenly spread.
        """
        about = [(each.entry, each.hashes) for each in earlier]
        self.seen.remember((one.name, one.source_file, one.source_sha256, hashes) for one, hashes in about)
        shown = [own for each in earlier for own in each.evidence]
        spread = sorted({each.session for each in shown})
        spread = spread[:: -(-len(spread) // MOST_SEARCHED) or 1]
        evidence = [each for each in shown if each.session in set(spread)]
        labelled: list[LongRecording] = []
        refused: list[Quarantined] = []
        sessions: set[str] = set()
        for outcome in self._by_session() if self.friction.labeller.needs_identification else self._at_once():
            if isinstance(outcome, Quarantined):
                refused.append(outcome)
            elif not isinstance(outcome.result, tuple):
                refused.append(_refused(outcome.metadata, outcome.result))
            else:
                recording, own = outcome.result
                labelled.append(recording)
                evidence += own
                self.evidence[recording.metadata.name] = own
                sessions |= {each.session for each in own}
        self.refused = refused
        warn_of_rates(self.friction.filter, {each.metadata.sample_time_s for each in labelled})
        if sessions:
            known = known_offsets(evidence, self.cylinder, self.friction.plan)
            self.offsets = {each.session: each for each in known if each.session in sessions}
        return labelled

    def _at_once(self) -> Iterator[ConvertedPiece | Quarantined]:
        """Yield each recording, labelled where its file is converted."""
        return self._worked_on(self.friction.labelled_alone)

    def _by_session(self) -> Iterator[ConvertedPiece | Quarantined]:
        """Yield each recording, labelled once load and mass of its session are known."""
        outcomes = list(self._worked_on(self.friction.kept))
        sessions: dict[str, list[LongRecording]] = {}
        for each in outcomes:
            if not isinstance(each, Quarantined):
                sessions.setdefault(each.metadata.session, []).append(each.result)
        work = [partial(self.friction.identified, own) for own in sessions.values()]
        found = dict(zip(sessions, self.workers.in_order(work), strict=True))
        pieces = [
            partial(self.friction.labelled_in_session, each.result, found[each.metadata.session])
            for each in outcomes
            if not isinstance(each, Quarantined)
        ]
        results = self.workers.in_order(pieces)
        for each in outcomes:
            if isinstance(each, Quarantined):
                yield each
                continue
            identified = found[each.metadata.session]
            if isinstance(identified, SessionIdentification) and identified.load is not None:
                self.loads[each.metadata.name] = identified.load.sentence()
            yield replace(each, result=next(results))
            each.result.remove()

    def _worked_on(self, work: Callable[[Recording | LongRecording], Any]) -> Iterator[ConvertedPiece | Quarantined]:
        folder = self.scratch / "converted"
        how = self.logs.recipe, folder, self.rows_at_once, self.workers, self.seen, work
        return worked_on(self.logs.files, *how)

    def entry(self, excerpt: Sequence[Recording]) -> FrictionOfRecording:
        """Return what became of a recording; ``excerpt`` is all of it, or parts of it."""
        return self.friction.entry(excerpt, self.loads.get(excerpt[0].name, ""))


def _refused(about: RecordingMetadata, reason: str | Died) -> Quarantined:
    return Quarantined(about.source_file, reason.reason if isinstance(reason, Died) else reason, about.name)


def _for_load(estimator: FrictionEstimator, identified: SessionIdentification | None) -> FrictionEstimator:
    """Return the estimator for the load of this session, where one is identified and it takes one by position."""
    if identified is None or identified.load is None or estimator.position_load is None:
        return estimator
    return estimator.with_position_load(pooled_load([identified.load]))


@dataclass
class RowCounts:
    """Rows of a recording, counted part by part."""

    rows: int = 0
    usable: int = 0
    flags: Counter[str] = field(default_factory=Counter)  # By name
    bounded: bool = False  # Whether any row has bounds

    @classmethod
    def of(cls, parts: Iterable[Recording]) -> RowCounts:
        counts = cls()
        for part in parts:
            counts.add(part)
        return counts

    def add(self, part: Recording) -> None:
        self.rows += len(part)
        self.usable += int(part.usable().sum())
        self.bounded |= bool(np.isfinite(part.column("lower_n")).any())
        if "flags" in part.table.columns:
            flags = part.table["flags"].to_numpy()
            self.flags.update({str(flag.name): int((flags & flag != 0).sum()) for flag in Flag})

    def flags_percent(self) -> dict[str, float]:
        """Return the share of rows with each flag that is ever set [%]."""
        return {name: 100.0 * count / self.rows for name, count in self.flags.items() if count}


class _RunningEstimate:
    """The estimator's real-time step, run over the parts of a recording as if they were one."""

    def __init__(self, estimator: FrictionEstimator) -> None:
        self.estimator, self.stream = estimator, estimator.real_time()
        # What was given after the last part's own rows, for an estimate of some samples before
        self.newtons, self.flags = np.empty((0, 3)), np.empty(0, dtype=np.int64)

    def estimated(self, labelled: Recording, own: slice) -> Recording:
        """Return a part's own rows with friction, bounds and flags, and the label beside them."""
        rows, end = own.stop - own.start, min(own.stop + self.estimator.lag_samples, len(labelled))
        samples = labelled.samples(self.estimator.inputs)[own.start + len(self.flags) : end]
        newtons, flags = self.stream.run(samples)
        newtons, flags = np.concatenate([self.newtons, newtons]), np.concatenate([self.flags, flags])
        self.newtons, self.flags = newtons[rows:], flags[rows:]
        friction_n, lower_n, upper_n = self.estimator.aligned(newtons)[:rows].T
        part = labelled.rows(own)
        return part.with_columns(
            label_n=part.column("friction_n"),
            friction_n=friction_n,
            lower_n=lower_n,
            upper_n=upper_n,
            flags=flags[:rows],
        )


def with_noise(recording: LongRecording, cylinder: Cylinder) -> LongRecording:
    """Return a recording whose parts know its noise, for what a filter does depends on it."""
    excerpt = recording.excerpt()
    columns = [name for name in (*PRESSURES, DRIVE_FORCE, LOAD_FORCE) if name in excerpt[0].table.columns]
    values = {name: np.concatenate([part.column(name) for part in excerpt]) for name in columns}
    if has_pressures(excerpt[0]):
        values[DRIVE_FORCE] = (
            values[PRESSURES[0]] * cylinder.piston_area_m2 - values[PRESSURES[1]] * cylinder.annulus_area_m2
        )
    return replace(recording, noise={name: noise_deviation(each) for name, each in values.items()})


def _depends_on(
    logs: Logs, cylinder: Cylinder, estimator: FrictionEstimator | None, file_format: FileFormat
) -> dict[str, str]:
    """Return what results depend on beside the logs: what was used before under another hash makes all of them new."""
    table = logs.recipe.names.table
    given = [path for path in (table, logs.recipe.database) if path is not None and path.is_file()]
    mapping = f"{replace(logs.recipe, cylinder='')}{''.join(map(hash_of, given))}"
    contents = {"cylinder": repr(cylinder), "mapping": mapping, "format": file_format}
    hashes = {name: hashlib.sha256(content.encode()).hexdigest() for name, content in contents.items()}
    hashes |= {"version of the code": hash_of(Path(__file__).parents[1]), "model": ""}
    if estimator is not None:
        with tempfile.TemporaryDirectory() as folder:
            estimator.save(Path(folder) / "model")
            hashes["model"] = hash_of(Path(folder) / "model")
    return hashes


def _processed(run: LabelledLogs, folder: Path, file_format: FileFormat, kept: Sequence[Processed]) -> list[Processed]:
    """Write results and panes of the new recordings into a folder; return them and the kept ones by their files."""
    labelled = run.labelled(kept)
    detailed = len(labelled) <= PLOTTED
    pieces = [
        partial(
            run.friction.written,
            each,
            run.offsets.get(each.metadata.session),
            run.loads.get(each.metadata.name, ""),
            folder,
            file_format,
            detailed,
            run.logs.files[each.metadata.source_file],
        )
        for each in labelled
    ]
    processed = list(kept)
    for each, result in zip(labelled, run.workers.in_order(pieces), strict=True):
        if isinstance(result, Died | str):
            run.refused.append(_refused(each.metadata, result))
            continue
        entry, bounded = result
        name = each.metadata.name
        processed.append(Processed(entry, bounded, run.seen.hashes[name], tuple(run.evidence.get(name, ()))))
        each.remove()
    return sorted(processed, key=lambda each: Path(each.entry.source_file))


def _bounds_in_words(run: LabelledLogs, bounded: bool) -> str:
    """Return what the bounds hold, or why there are none and what stating the sensors' accuracy would give."""
    estimator, assumed = run.friction.estimator, run.logs.assumed
    if estimator is not None:
        return "none: the model was never calibrated" if estimator.bounds is None else estimator.bounds.in_words()
    if bounded:
        return f"{LABEL_BOUNDS}{assumed and '; '}{assumed}"
    typical = run.logs.with_sensor_class(TYPICAL_CLASS)
    if not typical.assumed:
        return "none: the accuracy of a force sensor is not stated (sensor.accuracy_percent in the mapping)"
    zeros = sensor_uncertainty(typical.recipe.channels)
    areas = run.cylinder.piston_area_m2, run.cylinder.annulus_area_m2
    zeros_n = [area * zeros[name].zero for name, area in zip(PRESSURES, areas, strict=True) if name in zeros]
    return (
        "none: nothing is stated about the sensors, so that their zeros are not identified, and friction may be off by "
        f"them. State sensor.accuracy_percent in the mapping, or accept what is typical: --sensor-class "
        f"{TYPICAL_CLASS:g} ({typical.assumed.partition(': ')[2]}) would mean "
        f"± {COVERAGE_FACTOR * math.hypot(*zeros_n):.0f} N, and strokes of many sessions narrow it"
    )


def _counted(parts: Iterable[Recording], counts: RowCounts) -> Iterator[Recording]:
    for part in parts:
        counts.add(part)
        yield part


def _shown(part: Recording, rows: int) -> str:
    first_s, last_s = (float(part.table["time_s"].iloc[row]) for row in (0, -1))
    return (
        f"The figures show {first_s:.6g} to {last_s:.6g} s of a recording of {rows * part.sample_time_s:.6g} s; "
        "its file holds all of it."
    )


def _write(parts: Iterable[Recording], path: Path, log: Path) -> None:
    if path.suffix == ".parquet":
        write_parts(path, parts)
        return
    if path.suffix == ".mf4":
        from cylinder_friction.recordings.formats.mdf_results import write_mdf  # what no other format needs

        write_mdf(path, parts, log)
        return
    with whole_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        for number, part in enumerate(parts):
            part.table.to_csv(file, index=False, header=number == 0, float_format="%.9g")

"""How one recording gets its friction, and what is written of it: its file, its pane and its line in the summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.results import FrictionOfRecording, known_number
from cylinder_friction.estimation.running_estimate import RunningEstimate, for_load, label_missed, loaded_once
from cylinder_friction.evaluation.friction_levels import friction_levels
from cylinder_friction.evaluation.inspection.friction_view import view_of_labelled
from cylinder_friction.execution.workers import Died
from cylinder_friction.labelling.known_offset import (
    STROKES,
    KnownOffset,
    OffsetEvidence,
    offset_evidence,
)
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.labelling.sliding_blocks import LOADED, OffsetPlan
from cylinder_friction.labelling.up_and_down import holds_load, up_and_down
from cylinder_friction.realtime.flags import Flag, unknown_in_words
from cylinder_friction.realtime.trained_for import pressure_noise_pa
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.files import whole_file, write_text
from cylinder_friction.recordings.formats.mdf_results import write_mdf
from cylinder_friction.recordings.long_logs import LongRecording, on_disk
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import write_parts, write_recording, write_scratch
from cylinder_friction.reporting.friction_page import friction_pane, pane_file
from cylinder_friction.signals.noise import noise_deviation
from cylinder_friction.signals.smooth_signals import SignalFilter, filtered, has_pressures, smooth_recording

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

FileFormat = Literal["parquet", "csv", "mdf"]
SUFFIXES = {"parquet": ".parquet", "csv": ".csv", "mdf": ".mf4"}


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
        return loaded_once(self.model) if isinstance(self.model, Path) else self.model

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
        estimator, running = self.estimator, None
        if estimator is not None:
            excerpt = source.excerpt() if isinstance(source, LongRecording) else [source]
            running = RunningEstimate(for_load(estimator, identified).with_bounds_for(excerpt))
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
        if UNCERTAINTY_COLUMN in recording.columns:
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
        other = noisy = ""
        noise_pa = 0.0 if estimator is None else pressure_noise_pa(excerpt)
        level = None if estimator is None else estimator.noise_level(noise_pa)
        if estimator is not None and estimator.trained_for is not None and level is not None:
            trained = replace(estimator.trained_for, pressure_noise_pa=level.noise_pa)
            other, noisy = trained.differences(excerpt, noise_pa)
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
            unlike_training="; ".join(filter(None, (noisy, self._missed(excerpt)))),
            load_left_n=known_number(load_n) if holds_load(load_n, half_n) else None,
            repairs=tuple(about.repairs),
            levels=friction_levels(excerpt),
        )

    def _missed(self, excerpt: Sequence[Recording]) -> str:
        """Return how seldom bounds hold the label, in words; empty if offset or load differ from the label's."""
        estimator = self.estimator
        if estimator is None or estimator.bounds is None or estimator.offset is not None:
            return ""
        another_load = estimator.position_load is not None and self.labeller.load == "none"
        return "" if another_load else label_missed(excerpt, estimator.bounds)

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
        if "flags" in part.columns:
            flags = part.columns["flags"]
            self.flags.update({str(flag.name): int((flags & flag != 0).sum()) for flag in Flag})

    def flags_percent(self) -> dict[str, float]:
        """Return the share of rows with each flag that is ever set [%]."""
        return {name: 100.0 * count / self.rows for name, count in self.flags.items() if count}


def with_noise(recording: LongRecording, cylinder: Cylinder) -> LongRecording:
    """Return a recording whose parts know its noise, for what a filter does depends on it."""
    excerpt = recording.excerpt()
    columns = [name for name in (*PRESSURES, DRIVE_FORCE, LOAD_FORCE) if name in excerpt[0].columns]
    values = {name: np.concatenate([part.column(name) for part in excerpt]) for name in columns}
    if has_pressures(excerpt[0]):
        values[DRIVE_FORCE] = (
            values[PRESSURES[0]] * cylinder.piston_area_m2 - values[PRESSURES[1]] * cylinder.annulus_area_m2
        )
    return replace(recording, noise={name: noise_deviation(each) for name, each in values.items()})


def _counted(parts: Iterable[Recording], counts: RowCounts) -> Iterator[Recording]:
    for part in parts:
        counts.add(part)
        yield part


def _shown(part: Recording, rows: int) -> str:
    first_s, last_s = (float(part.columns["time_s"][row]) for row in (0, -1))
    return (
        f"The figures show {first_s:.6g} to {last_s:.6g} s of a recording of {rows * part.sample_time_s:.6g} s; "
        "its file holds all of it."
    )


def _write(parts: Iterable[Recording], path: Path, log: Path) -> None:
    if path.suffix == ".parquet":
        write_parts(path, parts)
        return
    if path.suffix == ".mf4":
        write_mdf(path, parts, log)
        return
    with whole_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        for number, part in enumerate(parts):
            part.table.to_csv(file, index=False, header=number == 0, float_format="%.9g")

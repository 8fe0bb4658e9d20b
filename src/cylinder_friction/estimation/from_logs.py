"""Logger files become files of friction and one page; memory holds one recording, or one part of a long one."""

import math
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.load import pooled_load
from cylinder_friction.labelling.sensor_offset import LOADED, OffsetPlan
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.checks.limits import LoadMode
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.files import whole_folder, write_json
from cylinder_friction.recordings.ingesting import Quarantined, convert_in_parts
from cylinder_friction.recordings.long_logs import ROWS_AT_ONCE, LongRecording
from cylinder_friction.recordings.reading_logs import Logs, find_logs
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_parts, write_recording
from cylinder_friction.reporting.friction_page import FrictionPane, friction_pane, write_friction_page
from cylinder_friction.reporting.inspection.friction_view import holds_load, up_and_down
from cylinder_friction.reporting.inspection.sensor_offsets import (
    STROKES,
    KnownOffset,
    OffsetEvidence,
    known_offsets,
    offset_evidence,
)
from cylinder_friction.reporting.page import PLOTTED
from cylinder_friction.signals.methods import default_filter, warn_of_rates
from cylinder_friction.signals.noise import noise_deviation
from cylinder_friction.signals.smooth_signals import SignalFilter, filtered, has_pressures

FileFormat = Literal["parquet", "csv"]
SUMMARY_FILE, PAGE_FILE = "summary.json", "friction.html"
LABEL_BOUNDS = "label ± expanded uncertainty (k = 2, about 95 %) of sensors, smoothing, load and sensor offset"
NO_BOUNDS = "none: the uncertainty of the sensors is not stated (sensor.accuracy_percent in the mapping)"
MODEL_BOUNDS = "the estimator's: they hold friction in 90 % of the samples of sessions like those it was calibrated on"


@dataclass(frozen=True)
class FrictionOfRecording:
    """What became of one recording; friction itself is in its file."""

    name: str
    source_file: str
    session: str
    rows: int
    duration_s: float
    usable_percent: float  # Of the rows; not near end stops or edges, where the force balance is not friction alone
    # Half of extending less retracting at equal positions [N]; None where the piston did not pass any both ways
    friction_n: float | None
    flags_percent: dict[str, float] | None  # Of the rows, by name of the estimator's flag; None without an estimator
    load: str  # Which load was taken off, in words
    load_left_n: float | None  # A load that friction still holds, about [N]; None where nothing hints at one
    repairs: tuple[str, ...]  # What reading had to repair


@dataclass(frozen=True)
class FrictionOfLogs:
    """What became of the logs."""

    folder: Path  # Where the files lie
    bounds: str  # What ``lower_n`` and ``upper_n`` are
    recordings: list[FrictionOfRecording] = field(default_factory=list)
    refused: list[Quarantined] = field(default_factory=list)
    offsets: list[KnownOffset] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; what is not known is None."""
        return {
            "folder": self.folder.as_posix(),
            "bounds": self.bounds,
            "recordings": [asdict(each) for each in self.recordings],
            "refused": [asdict(each) for each in self.refused],
            "offsets": [{name: _known(value) for name, value in asdict(each).items()} for each in self.offsets],
        }


def estimate_logs(
    files: str | Path | Iterable[str | Path],
    cylinder: Cylinder,
    into: str | Path = "friction",
    *,
    channels: str | Path | Mapping[str, Any] | None = None,
    model: FrictionEstimator | str | Path | None = None,
    load: LoadMode | None = None,
    names: str | None = None,
    file_format: FileFormat = "parquet",
    rows_at_once: int = ROWS_AT_ONCE,
) -> FrictionOfLogs:
    """Write the friction of logger files into a folder: one file per recording, ``summary.json`` and one page.

    Each file has a row per sample: what was measured, in SI units, ``velocity_m_s`` (extension positive),
    ``friction_n`` (positive when it opposes positive velocity), ``lower_n``, ``upper_n``, ``usable``, and
    ``load_force_n`` where a load was taken off. Without a model friction is the off-line label, which looks ahead, less
    the sensors' offset where strokes determine it. With one it is the real-time estimate; its ``flags`` and the label,
    ``label_n``, stand beside it.

    Args:
        files, channels, load, names: As in ``read_recordings``.
        cylinder: Whose recordings they are.
        into: A new folder, or one that an earlier call wrote.
        model: An estimator or the folder of a saved one; logs are resampled to its rate. None: the off-line label.
        file_format: ``parquet`` or ``csv``.
        rows_at_once: A log of more rows is processed in parts of about so many, so that memory holds one of them.

    Raises:
        RecordingError: No file is found, or the mapping is wrong or cannot be guessed. Single files that cannot be
            used are listed in ``refused``.
        FileExistsError: The folder holds something else.
    """
    into = Path(into)
    refuse_other_folder(into, SUMMARY_FILE)
    estimator = load_estimator(model) if isinstance(model, str | Path) else model
    rate_hz = None if estimator is None or estimator.sample_time_s is None else 1.0 / estimator.sample_time_s
    logs = find_logs(files, channels, cylinder, names=names, load=load, rate_hz=rate_hz)
    with whole_folder(into) as folder:
        run = LabelledLogs(logs, cylinder, folder / ".scratch", estimator, rows_at_once)
        result, panes = _written(run, folder, file_format)
        result = replace(result, folder=into)
        shutil.rmtree(run.scratch, ignore_errors=True)
        write_friction_page(folder / PAGE_FILE, panes, result.offsets, _table_rows(result), result.bounds)
        write_json(folder / SUMMARY_FILE, result.to_dict())
    return result


def refuse_other_folder(folder: Path, marker: str) -> None:
    """Raise ``FileExistsError`` if the folder exists and holds no file ``marker``, by which a run knows its own."""
    if folder.exists() and not (folder / marker).is_file():
        raise FileExistsError(f"{folder}: exists already, and holds no {marker} of an earlier run; name a new folder")


class LabelledLogs:
    """The recordings of logger files with their friction, each kept in ``scratch`` between two passes.

    Args:
        logs: The files.
        cylinder: Whose recordings they are.
        scratch: A folder that may be removed afterwards.
        estimator: What friction comes from; None: the off-line label, less the sensors' offset where it is known.
        rows_at_once: A log of more rows is processed in parts of about so many, so that memory holds one of them.

    Attributes:
        refused: Files and recordings that could not be used, once ``recordings`` has ended.
        offsets: What is known of the sensors' offset by session, from then on; empty with an estimator.
        loads: By recording, which load was taken off, in words.
    """

    def __init__(
        self,
        logs: Logs,
        cylinder: Cylinder,
        scratch: Path,
        estimator: FrictionEstimator | None,
        rows_at_once: int = ROWS_AT_ONCE,
    ) -> None:
        self.logs, self.cylinder, self.estimator, self.scratch = logs, cylinder, estimator, scratch
        self.rows_at_once = rows_at_once
        self.filter: SignalFilter = default_filter(cylinder)
        self.plan = OffsetPlan()
        self.load = logs.recipe.limits.load
        self.labeller = Labeller(cylinder, load=self.load)
        self.refused: list[Quarantined] = []
        self.offsets: dict[str, KnownOffset] = {}
        self.loads: dict[str, str] = {}

    def recordings(self) -> Iterator[Recording]:
        """Yield each usable recording with friction, bounds, velocity and usable rows; of a long one an excerpt."""
        for labelled in self.labelled():
            parts = labelled.excerpt()
            for number, part in enumerate(parts, start=1):
                name = f"{part.name}, excerpt {number} of {len(parts)}" if len(parts) > 1 else part.name
                yield self.finished(replace(part, metadata=replace(part.metadata, name=name)))

    def labelled(self) -> Iterator[LongRecording]:
        """Yield each usable recording with its friction, on disk; what is read of it is yet to be ``finished``."""
        evidence: list[OffsetEvidence] = []
        labelled = list(self._labelled(evidence))
        if self.estimator is None:
            known = known_offsets(evidence, self.cylinder, self.plan)
            self.offsets = {each.session: each for each in known}
        yield from labelled

    def _labelled(self, evidence: list[OffsetEvidence]) -> Iterator[LongRecording]:
        sessions: dict[str, list[LongRecording]] = {}
        sample_times_s: set[float] = set()
        folder = self.scratch / "converted"
        for outcome in convert_in_parts(self.logs.files, self.logs.recipe, folder, self.rows_at_once):
            if isinstance(outcome, Quarantined):
                self.refused.append(outcome)
                continue
            sample_times_s.add(outcome.metadata.sample_time_s)
            source = with_noise(outcome, self.cylinder) if isinstance(outcome, LongRecording) else outcome
            if not self.labeller.needs_identification:
                yield from self._label(source, None, evidence)
                continue
            if isinstance(source, Recording):
                source = LongRecording(source.metadata, (write_recording(folder, source),), (slice(0, len(source)),))
            sessions.setdefault(source.metadata.session, []).append(source)
        warn_of_rates(self.filter, sample_times_s)
        for sources in sessions.values():
            smooth = (filtered(part, self.filter) for source in sources for part in source.excerpt())
            try:
                identified = self.labeller.identify(smooth, self.filter)
            except ValueError as error:
                for source in sources:
                    self._refuse(source, error)
                continue
            for source in sources:
                if identified.load is not None:
                    self.loads[source.metadata.name] = identified.load.sentence()
                yield from self._label(source, identified, evidence)

    def _label(
        self,
        source: Recording | LongRecording,
        identified: SessionIdentification | None,
        evidence: list[OffsetEvidence],
    ) -> Iterator[LongRecording]:
        """Yield a recording with its friction unless it is refused; what its label shows of an offset is added."""
        parts = source.parts() if isinstance(source, LongRecording) else [(source, slice(0, len(source)))]
        running = None if self.estimator is None else _RunningEstimate(_for_load(self.estimator, identified))
        paths: list[Path] = []
        own_rows: list[slice] = []
        try:
            for recording, own in parts:
                labelled = self.labeller.labelled(filtered(recording, self.filter), self.filter, identified)
                labelled = labelled.rows(own) if running is None else running.estimated(labelled, own)
                stem = f"{recording.name}.{len(paths):06d}"
                paths.append(write_recording(self.scratch / "labelled", labelled, stem))
                own_rows.append(slice(0, len(labelled)))
        except ValueError as error:  # shorter than the filter, or not what the estimator takes
            self._refuse(source, error)
            return
        if isinstance(source, LongRecording):
            source.remove()
        result = LongRecording(source.metadata, tuple(paths), tuple(own_rows))
        if self.estimator is None:
            evidence += map(self._evidence, [labelled] if len(paths) == 1 else result.excerpt())
        yield result

    def _evidence(self, recording: Recording) -> OffsetEvidence:
        return offset_evidence(
            recording, self.cylinder, self.plan, *self._halves([recording]), LOADED.get(self.load, "")
        )

    def _halves(self, recordings: Sequence[Recording]) -> tuple[float, float]:
        """Return half the sum and half the difference of friction up and down at equal position [N]."""
        columns = ("position_m", "velocity_m_s", "friction_n")
        position_m, velocity_m_s, friction_n = (
            np.concatenate([recording.column(name) for recording in recordings]) for name in columns
        )
        usable = np.concatenate([recording.usable() for recording in recordings])
        return up_and_down(position_m, velocity_m_s, friction_n, usable, self.plan.slowest_m_s)

    def finished(self, recording: Recording) -> Recording:
        """Return a recording with its bounds, and without the offset of its session where strokes determine it."""
        if self.estimator is not None:
            return recording.without_columns(UNCERTAINTY_COLUMN)
        friction_n, half_n = recording.column("friction_n"), np.full(len(recording), math.nan)
        if UNCERTAINTY_COLUMN in recording.table.columns:
            half_n = recording.column(UNCERTAINTY_COLUMN)
        known = self.offsets[recording.metadata.session]
        if known.source == STROKES:
            friction_n = friction_n - known.offset_n
            half_n = np.sqrt(np.maximum(half_n**2 - known.stated_n**2, 0.0) + known.uncertainty_n**2)
        bounds = {"lower_n": friction_n - half_n, "upper_n": friction_n + half_n}
        return recording.with_columns(friction_n=friction_n, **bounds).without_columns(UNCERTAINTY_COLUMN)

    def entry(self, excerpt: Sequence[Recording], counts: "Counts | None" = None) -> FrictionOfRecording:
        """Return what became of a recording.

        Args:
            excerpt: The recording, finished, or parts of it.
            counts: Of all its rows; None where the excerpt holds them.
        """
        counts = counts or Counts.of(excerpt)
        load_n, half_n = self._halves(excerpt)
        about, given = excerpt[0].metadata, None if self.estimator is None else self.estimator.position_load
        known = self.load if given is None else given.in_words()
        return FrictionOfRecording(
            name=about.name,
            source_file=about.source_file,
            session=about.session,
            rows=counts.rows,
            duration_s=counts.rows * about.sample_time_s,
            usable_percent=100.0 * counts.usable / counts.rows,
            friction_n=_known(half_n),
            flags_percent=None if self.estimator is None else counts.flags_percent(),
            load=self.loads.get(about.name) or known,
            load_left_n=_known(load_n) if holds_load(load_n, half_n) else None,
            repairs=tuple(about.repairs),
        )

    def _refuse(self, recording: Recording | LongRecording, error: Exception) -> None:
        about = recording.metadata
        self.refused.append(Quarantined(about.source_file, str(error), about.name))


def _for_load(estimator: FrictionEstimator, identified: SessionIdentification | None) -> FrictionEstimator:
    """Return the estimator for the load of this session, where one is identified and it takes one by position."""
    if identified is None or identified.load is None or estimator.position_load is None:
        return estimator
    return estimator.with_position_load(pooled_load([identified.load]))


@dataclass
class Counts:
    """Rows of a recording, counted part by part."""

    rows: int = 0
    usable: int = 0
    flags: Counter[str] = field(default_factory=Counter)  # By name
    bounded: bool = False  # Whether any row has bounds

    @classmethod
    def of(cls, parts: Iterable[Recording]) -> "Counts":
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


def _written(run: LabelledLogs, folder: Path, file_format: FileFormat) -> tuple[FrictionOfLogs, list[FrictionPane]]:
    bounded = False
    recordings: list[FrictionOfRecording] = []
    panes: list[FrictionPane] = []
    for labelled in run.labelled():
        counts = Counts()
        whole = [run.finished(part) for part in labelled.excerpt()] if len(labelled.paths) == 1 else []
        parts = iter(whole) if whole else (run.finished(part) for part, _ in labelled.parts())
        _write(_counted(parts, counts), labelled, folder, file_format)
        bounded |= counts.bounded
        excerpt = whole or [run.finished(part) for part in labelled.excerpt()]
        recordings.append(run.entry(excerpt, counts))
        if len(panes) < PLOTTED:
            pane = friction_pane(excerpt[0], run.cylinder, run.filter, run.estimator is not None)
            panes.append(pane if len(excerpt) == 1 else replace(pane, shown=_shown(excerpt[0], counts)))
        labelled.remove()
    words = MODEL_BOUNDS if run.estimator is not None else LABEL_BOUNDS if bounded else NO_BOUNDS
    return FrictionOfLogs(folder, words, recordings, run.refused, list(run.offsets.values())), panes


def _counted(parts: Iterable[Recording], counts: Counts) -> Iterator[Recording]:
    for part in parts:
        counts.add(part)
        yield part


def _shown(part: Recording, counts: Counts) -> str:
    first_s, last_s = (float(part.table["time_s"].iloc[row]) for row in (0, -1))
    return (
        f"The figures show {first_s:.6g} to {last_s:.6g} s of a recording of {counts.rows * part.sample_time_s:.6g} s; "
        "its file holds all of it."
    )


def _write(parts: Iterable[Recording], recording: LongRecording, folder: Path, file_format: FileFormat) -> None:
    path = folder / f"{recording.metadata.name}.{file_format}"
    if file_format == "parquet":
        write_parts(path, parts)
        return
    with path.open("w", encoding="utf-8", newline="") as file:
        for number, part in enumerate(parts):
            part.table.to_csv(file, index=False, header=number == 0, float_format="%.9g")


def remarks(each: FrictionOfRecording) -> list[str]:
    """Return what is worth knowing of a recording beside its numbers."""
    flags = [f"{share:.1f} % {name}" for name, share in (each.flags_percent or {}).items()]
    left = load_left(each)
    return [*([left] if left else []), *([] if each.load == "none" else [f"load: {each.load}"]), *flags, *each.repairs]


def load_left(each: FrictionOfRecording) -> str:
    """Return what load friction still holds, and what to do; empty where nothing hints at one."""
    if each.load_left_n is None:
        return ""
    return f"friction_n holds a load of about {each.load_left_n:.0f} N; map a load cell, or use --load position"


def _table_rows(result: FrictionOfLogs) -> list[tuple[str, str, str, str]]:
    """Return name, friction, usable share and remarks of every recording and refused file, as text."""
    rows = [
        (
            each.name,
            "–" if each.friction_n is None else f"{each.friction_n:.0f}",
            f"{each.usable_percent:.0f}",
            "; ".join(remarks(each)),
        )
        for each in result.recordings
    ]
    return rows + [(each.file, "–", "–", f"refused: {each.reason}") for each in result.refused]


def _known(value: Any) -> Any:
    """Return None for a number that is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value

"""Logger files become files of friction and one page; memory holds one recording at a time."""

import math
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sensor_offset import LOADED, OffsetPlan
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.checks.limits import LoadMode
from cylinder_friction.recordings.columns import UNCERTAINTY_COLUMN
from cylinder_friction.recordings.files import whole_folder, write_json
from cylinder_friction.recordings.ingesting import Quarantined, convert_files
from cylinder_friction.recordings.reading_logs import Logs, find_logs
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_recording, write_recording
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
from cylinder_friction.signals.smooth_signals import SignalFilter, filtered

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
        run = LabelledLogs(logs, cylinder, folder / ".scratch", estimator)
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

    Attributes:
        refused: Files and recordings that could not be used, once ``recordings`` has ended.
        offsets: What is known of the sensors' offset by session, from then on; empty with an estimator.
        loads: By recording, which load was taken off, in words.
    """

    def __init__(self, logs: Logs, cylinder: Cylinder, scratch: Path, estimator: FrictionEstimator | None) -> None:
        self.logs, self.cylinder, self.estimator, self.scratch = logs, cylinder, estimator, scratch
        self.filter: SignalFilter = default_filter(cylinder)
        self.plan = OffsetPlan()
        self.load = logs.recipe.limits.load
        self.labeller = Labeller(cylinder, load=self.load)
        self.refused: list[Quarantined] = []
        self.offsets: dict[str, KnownOffset] = {}
        self.loads: dict[str, str] = {}

    def recordings(self) -> Iterator[Recording]:
        """Yield each usable recording with ``friction_n``, its bounds, velocity and usable rows."""
        evidence: list[OffsetEvidence] = []
        labelled = list(self._labelled(self._filtered(), evidence))
        if self.estimator is None:
            known = known_offsets(evidence, self.cylinder, self.plan)
            self.offsets = {each.session: each for each in known}
        for path in labelled:
            yield self._finished(read_recording(path))

    def _filtered(self) -> dict[str, list[Path]]:
        """Return the files of filtered recordings by session."""
        sessions: dict[str, list[Path]] = {}
        sample_times_s: set[float] = set()
        for outcome in convert_files(self.logs.files, self.logs.recipe):
            if isinstance(outcome, Quarantined):
                self.refused.append(outcome)
                continue
            try:
                smooth = filtered(outcome, self.filter)
            except ValueError as error:  # shorter than the filter
                self._refuse(outcome, error)
                continue
            written = write_recording(self.scratch / "filtered", smooth)
            sessions.setdefault(outcome.metadata.session, []).append(written)
            sample_times_s.add(outcome.sample_time_s)
        warn_of_rates(self.filter, sample_times_s)
        return sessions

    def _labelled(self, sessions: Mapping[str, list[Path]], evidence: list[OffsetEvidence]) -> Iterator[Path]:
        """Yield the file of each recording with its friction; what a label shows of an offset joins ``evidence``."""
        for paths in sessions.values():
            identified: SessionIdentification | None = None
            try:
                if self.labeller.needs_identification:
                    identified = self.labeller.identify(map(read_recording, paths), self.filter)
            except RecordingError as error:
                for path in paths:
                    self._refuse(read_recording(path), error)
                continue
            for path in paths:
                recording = self.labeller.labelled(read_recording(path), self.filter, identified)
                if identified is not None and identified.load is not None:
                    self.loads[recording.name] = identified.load.sentence()
                if self.estimator is None:
                    evidence.append(self._evidence(recording))
                else:
                    try:
                        recording = _estimated(recording, self.estimator)
                    except RecordingError as error:
                        self._refuse(recording, error)
                        continue
                yield write_recording(self.scratch / "labelled", recording)

    def _evidence(self, recording: Recording) -> OffsetEvidence:
        position_m, velocity_m_s = recording.column("position_m"), recording.column("velocity_m_s")
        halves = up_and_down(
            position_m, velocity_m_s, recording.column("friction_n"), recording.usable(), self.plan.slowest_m_s
        )
        return offset_evidence(recording, self.cylinder, self.plan, *halves, LOADED.get(self.load, ""))

    def _finished(self, recording: Recording) -> Recording:
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

    def entry(self, recording: Recording) -> FrictionOfRecording:
        """Return what became of a recording."""
        flags, position_m = recording.table.get("flags"), recording.column("position_m")
        usable, velocity_m_s = recording.usable(), recording.column("velocity_m_s")
        friction_n = recording.column("friction_n")
        load_n, half_n = up_and_down(position_m, velocity_m_s, friction_n, usable, self.plan.slowest_m_s)
        words = {"none": "none", "measured": "measured"}
        return FrictionOfRecording(
            name=recording.name,
            source_file=recording.metadata.source_file,
            session=recording.metadata.session,
            rows=len(recording),
            duration_s=len(recording) * recording.sample_time_s,
            usable_percent=100.0 * float(usable.mean()),
            friction_n=_known(half_n),
            flags_percent=None if flags is None else _shares(flags.to_numpy()),
            load=self.loads.get(recording.name) or words[self.load],
            load_left_n=_known(load_n) if holds_load(load_n, half_n) else None,
            repairs=tuple(recording.metadata.repairs),
        )

    def _refuse(self, recording: Recording, error: Exception) -> None:
        self.refused.append(Quarantined(recording.metadata.source_file, str(error), recording.name))


def _written(run: LabelledLogs, folder: Path, file_format: FileFormat) -> tuple[FrictionOfLogs, list[FrictionPane]]:
    bounded = False
    recordings: list[FrictionOfRecording] = []
    panes: list[FrictionPane] = []
    for recording in run.recordings():
        bounded |= bool(np.isfinite(recording.column("lower_n")).any())
        _write(recording, folder, file_format)
        recordings.append(run.entry(recording))
        if len(panes) < PLOTTED:
            panes.append(friction_pane(recording, run.cylinder, run.filter, run.estimator is not None))
    words = MODEL_BOUNDS if run.estimator is not None else LABEL_BOUNDS if bounded else NO_BOUNDS
    return FrictionOfLogs(folder, words, recordings, run.refused, list(run.offsets.values())), panes


def _write(recording: Recording, folder: Path, file_format: FileFormat) -> None:
    if file_format == "csv":
        recording.table.to_csv(folder / f"{recording.name}.csv", index=False, float_format="%.9g")
    else:
        write_recording(folder, recording)


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


def _estimated(recording: Recording, estimator: FrictionEstimator) -> Recording:
    """Return a labelled recording with the estimator's friction, bounds and flags, and the label beside them."""
    newtons, flags = estimator.real_time().run(recording.samples(estimator.inputs))
    friction_n, lower_n, upper_n = estimator.aligned(newtons).T
    return recording.with_columns(
        label_n=recording.column("friction_n"), friction_n=friction_n, lower_n=lower_n, upper_n=upper_n, flags=flags
    )


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


def _shares(flags: NDArray[np.int64]) -> dict[str, float]:
    """Return the share of rows with each flag that is ever set [%]."""
    shares = {str(flag.name): 100.0 * float((flags & flag != 0).mean()) for flag in Flag}
    return {name: share for name, share in shares.items() if share > 0.0}


def _known(value: Any) -> Any:
    """Return None for a number that is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value

"""Turn logger files into files of friction and one page.

Each log is read, mapped, aligned, checked, smoothed and labelled. Once all logs of a session are labelled, the
session's offset is subtracted, and the result of each recording is written.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
import warnings
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.friction_of_logs import (
    LabelledLogs,
    LabelledRecording,
    RecordingFriction,
    discard,
    loaded_once,
    refused_piece,
    waiting,
)
from cylinder_friction.estimation.results import (
    PAGE_FILE,
    SUMMARY_FILE,
    WRITTEN_BY,
    FileFormat,
    FrictionOfLogs,
    Result,
    kept_summary,
    packed,
    read_results,
    sort_logs,
    table_rows,
    unpacked,
    without_new_result,
    write_result,
)
from cylinder_friction.execution.workers import LostPiece, Workers
from cylinder_friction.files.result_folder import ResultFolder
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.labelling.apparent_loss import ApparentLoss
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence
from cylinder_friction.recordings.checks.limits import GivenLoad
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, DRIVE_FORCE, LOAD_FORCE, PRESSURES
from cylinder_friction.recordings.conversion import SeenRecordings, logged_files, overlaps_in_words
from cylinder_friction.recordings.logs import ROWS_AT_ONCE, Logs, find_logs
from cylinder_friction.recordings.mapping.channel_mapping import sensor_uncertainty
from cylinder_friction.reporting.friction_page import friction_pane, level_tables, pane_file, write_friction_page
from cylinder_friction.wording import counted

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

TYPICAL_CLASS = 0.5
"""Accuracy of a typical industrial pressure sensor [± % of full scale]."""
LABEL_BOUNDS = (
    "they hold friction in about 95 % of the rows (k = 2) if sensors, load and cylinder are as stated; docs/trust.md "
    "lists each assumption and what happens if it is wrong"
)


def estimate_logs(
    files: str | Path | Iterable[str | Path],
    cylinder: Cylinder,
    into: str | Path = "friction",
    *,
    channels: str | Path | Mapping[str, Any] | None = None,
    model: FrictionEstimator | str | Path | None = None,
    load: GivenLoad | None = None,
    names: str | None = None,
    units: Mapping[str, str] | None = None,
    sensor_class: float | None = None,
    database: str | Path | None = None,
    other_cylinder: bool = False,
    file_format: FileFormat = "parquet",
    rows_at_once: int = ROWS_AT_ONCE,
    workers: Workers | None = None,
) -> FrictionOfLogs:
    """Write the friction of logger files into a folder: one Parquet file per recording, ``summary.json`` and one page.

    Each Parquet file has a row per sample: what was measured, in SI units, ``velocity_m_s`` (extension positive),
    ``friction_n`` (positive when it opposes positive velocity), ``lower_n``, ``upper_n``, ``usable``, and
    ``load_force_n`` if a load was subtracted. Without a model, friction is the off-line label, which looks ahead, less
    the sensors' offset if strokes determine it. With a model, friction is the real-time estimate, and the columns
    ``flags`` and ``label_n`` (the label) are added. A log with results in the folder is not processed again unless the
    log, the cylinder, mapping, load, model or code has changed.

    Args:
        files, channels, cylinder, load, names, units, sensor_class, database: As in ``read_recordings``.
        into: A new folder, or one that an earlier call wrote. Files that no earlier call wrote stay in it.
        model: An estimator or the folder of a saved one; logs are resampled to its rate. None uses the off-line label.
        other_cylinder: Whether to accept a model that was trained for a cylinder with other areas.
        file_format: ``csv`` writes a CSV file beside each Parquet file; ``parquet`` does not.
        rows_at_once: A log of more rows is cut into parts of about this many, each a recording of its session, so that
            memory holds only one part.
        workers: Process recordings in parallel. None processes them one after the other in this process.

    Raises:
        OtherCylinderError: The model was trained for a cylinder with other areas.
        RecordingError: No file is found, or the mapping is wrong or cannot be guessed. Single files that cannot be
            used are listed in ``refused``.
        FileExistsError: The folder contains other files or results of other logs of the same names,
            overlaps with an input, or is being written by another call.

    Example:
        >>> logs = "data/raw/rig/condition1_*.csv"
        >>> result = cf.estimate_logs(logs, cylinder, "friction", channels="conf/ingest/rig.yaml")
        >>> [recording.name for recording in result.recordings]  # doctest: +ELLIPSIS
        ['condition1_session01_recording01', ...]
        >>> result.refused
        []
    """
    into = Path(into)
    given_model = Path(model) if isinstance(model, str | Path) else model
    estimator = loaded_once(given_model) if isinstance(given_model, Path) else given_model
    if estimator is not None and estimator.trained_for is not None and not other_cylinder:
        estimator.trained_for.refuse(cylinder)
    rate_hz = None if estimator is None or estimator.sample_time_s is None else 1.0 / estimator.sample_time_s
    given: dict[str, Any] = {"names": names, "load": load, "rate_hz": rate_hz, "units": units, "database": database}
    logs = find_logs(files, channels, cylinder, sensor_class=sensor_class, **given)
    read = (*logs.inputs, given_model) if isinstance(given_model, Path) else logs.inputs
    depends_on = _depends_on(logs, cylinder, given_model, file_format)
    target = ResultFolder(into, SUMMARY_FILE, WRITTEN_BY, read)
    with target.scratch() as scratch:
        before, there, root = kept_summary(into), read_results(into), _seen_from(into, logs.root)
        listed = frozenset(before.get("files", ()))
        new_logs, kept = sort_logs(logged_files(logs, rows_at_once), into, there, depends_on, root)
        run = LabelledLogs(logs, new_logs, scratch, given_model, workers)
        labelled = _labelled(run, kept, depends_on)
        if not listed:
            target.claim()
        new = _write_results(run, labelled, ResultWriter(run.friction, into, file_format, depends_on, listed, root))
        kept += without_new_result(there, new_logs, new, depends_on)
        _warn_of_shorter(there, new)
        results = sorted([*kept, *new], key=lambda each: Path(each.entry.source_file))
        current, processed = ({each.entry.name for each in some} for some in (results, new))
        stale = [each for each in there if each.entry.name not in current]
        target.remove([name for each in stale for name in each.files])
        offsets = {each.offset.session: each.offset for each in results if each.offset is not None} | run.offsets
        result = FrictionOfLogs(
            into,
            _bounds_in_words(run, results, offsets.values()),
            [each.entry for each in results],
            sorted(run.refused, key=lambda each: (each.file, each.piece)),
            [offsets[name] for name in sorted(offsets)],
            tuple(each.entry.name for each in results if each.entry.name in processed),
            depends_on,
            logs.guessed,
            run.loss_in_words() if new_logs else before.get("loss", ""),
        )
        _write_summary(target, before, result, [name for each in results for name in each.files])
    if overlaps := overlaps_in_words((each, each.duration_s) for each in result.recordings):
        warnings.warn(overlaps, stacklevel=2)
    return result


def _seen_from(folder: Path, root: Path) -> str:
    """State where logs lie, relative to the folder of results if both are on one drive."""
    there = os.path.realpath(root)
    with suppress(ValueError):  # Windows: another drive
        there = os.path.relpath(there, os.path.realpath(folder))
    return Path(there).as_posix()


def _warn_of_shorter(earlier: Sequence[Result], new: Sequence[Result]) -> None:
    """Warn of logs that were cut: what they hold now lasts less long than before."""
    before, now = _by_file(earlier), _by_file(new)
    for name in before.keys() & now.keys():
        (was, was_s), (is_now, now_s) = before[name], now[name]
        if now_s < was_s and is_now != was:
            words = f"{name}: has become shorter, {now_s:.1f} s instead of {was_s:.1f} s; is the log complete?"
            warnings.warn(words, stacklevel=3)


def _by_file(results: Sequence[Result]) -> dict[str, tuple[str, float]]:
    """Collect the SHA-256 and the duration [s] of each log with a result."""
    found = dict[str, tuple[str, float]]()
    for each in results:
        _, duration_s = found.get(each.entry.source_file, ("", 0.0))
        found[each.entry.source_file] = each.entry.source_sha256, duration_s + each.entry.duration_s
    return found


def _labelled(run: LabelledLogs, kept: Sequence[Result], depends_on: Mapping[str, str]) -> list[LabelledRecording]:
    """Label the new logs, together with the evidence in the kept results."""
    seen, evidence = SeenRecordings(), list[OffsetEvidence]()
    for each in kept if run.files else ():
        shown, samples = unpacked(each.compared)
        seen.names[samples], seen.files[each.entry.name] = each.entry.name, each.entry.source_file
        if shown is not None and each.depends_on == depends_on:
            evidence.append(shown)
    return run.labelled(seen, evidence)


def _write_results(run: LabelledLogs, labelled: Sequence[LabelledRecording], writer: ResultWriter) -> list[Result]:
    """Write the result of each recording; add recordings that cannot be written to ``refused``."""
    of_file = Counter(each.metadata.source_file for each in labelled)
    work = []
    for each in labelled:
        offset, count = run.offsets.get(each.metadata.session), of_file[each.metadata.source_file]
        work.append(partial(writer.written, each, offset, run.loss, count))
    results = []
    for each, result in zip(labelled, run.workers.in_order(work), strict=True):
        if isinstance(result, LostPiece):
            run.refused.append(refused_piece(each.metadata, result))
        else:
            results.append(result)
        discard(each.result)
    return results


@dataclass(frozen=True)
class ResultWriter:
    """Subtracts offsets from the friction of recordings and writes their results."""

    friction: RecordingFriction
    folder: Path
    file_format: FileFormat
    depends_on: Mapping[str, str]
    listed: Collection[str]  # Files in the folder that an earlier run wrote
    root: str  # Folder of the logs, seen from ``folder``

    def written(
        self, labelled: LabelledRecording, offset: KnownOffset | None, loss: ApparentLoss | None, of_file: int
    ) -> Result:
        """Write the result of one recording. ``of_file`` is the number of recordings in its log."""
        finished = self.friction.finished(waiting(labelled.result), offset, loss).described(depends_on=self.depends_on)
        entry, bounded = self.friction.entry(finished, labelled.load), np.isfinite(finished.column("lower_n")).any()
        beside = (*([f"{entry.name}.csv"] if self.file_format == "csv" else []), pane_file(entry.name))
        compared = packed(labelled.evidence, labelled.samples)
        result = Result(entry, self.depends_on, of_file, beside, bool(bounded), offset, compared, self.root)
        write_result(self.folder, finished, result, friction_pane(finished), self.listed)
        return result


def _write_summary(target: ResultFolder, before: dict[str, Any], result: FrictionOfLogs, files: Sequence[str]) -> None:
    """Write the summary and the page of all results, unless those from ``before`` have the same content."""
    page = target.folder / PAGE_FILE
    if not result.new and page.is_file() and before | json.loads(json.dumps(result.found())) == before | {"new": []}:
        return
    tables = level_tables(result.differences, result.levels)
    bounds = f"{result.bounds}. {result.loss}" if result.loss else result.bounds
    write_friction_page(page, table_rows(result), result.offsets, bounds, result.guessed, tables)
    target.claim([PAGE_FILE, *files], result.to_dict())


def _depends_on(
    logs: Logs, cylinder: Cylinder, model: FrictionEstimator | Path | None, file_format: FileFormat
) -> dict[str, str]:
    """Hash what results depend on besides the logs. If one of the hashes changes, all logs are processed again."""
    database = logs.recipe.database
    given = hash_of(database) if database is not None and database.is_file() else ""
    limits = {name: value for name, value in vars(logs.recipe.limits).items() if name != "cylinder"}
    mapping = f"{vars(logs.recipe) | {'limits': limits}}{given}"
    contents = {"cylinder": repr(cylinder), "mapping": mapping, "format": file_format}
    hashes = {name: hashlib.sha256(content.encode()).hexdigest() for name, content in contents.items()}
    hashes |= {"version of the code": hash_of(Path(__file__).parents[1]), "model": ""}
    if isinstance(model, Path):
        hashes["model"] = hash_of(model)
    elif model is not None:
        with tempfile.TemporaryDirectory() as folder:
            model.save(Path(folder) / "model")
            hashes["model"] = hash_of(Path(folder) / "model")
    return hashes


def _bounds_in_words(run: LabelledLogs, results: Sequence[Result], offsets: Iterable[KnownOffset]) -> str:
    """State what the bounds contain, or why there are none and how stating the sensors' accuracy would help."""
    estimator, assumed = run.friction.estimator, run.logs.assumed
    if not results:
        return "none: no log was usable"
    if estimator is not None:
        return "none: the model was never calibrated" if estimator.bounds is None else estimator.bounds.in_words()
    if any(each.bounded for each in results):
        loaded = sum(each.entry.load_left_n is not None for each in results)
        doubted = [each for each in offsets if each.doubt]
        but = ""
        if loaded:
            but = f"; not in {counted(loaded, 'recording')} whose friction holds a load or a sensor's zero"
        elif doubted:
            but = f"; but in {counted(len(doubted), 'session')} (first {doubted[0].session}): {doubted[0].doubt}"
        return f"{LABEL_BOUNDS}{but}{assumed and '; '}{assumed}"
    typical = run.logs.with_sensor_class(TYPICAL_CLASS)
    if not typical.assumed:
        return f"none: the accuracy of {DRIVE_FORCE} is not stated (sensor.accuracy_percent in the mapping)"
    zeros, stated = (sensor_uncertainty(each.recipe.channels) for each in (typical, run.logs))
    areas = {PRESSURES[0]: run.cylinder.piston_area_m2, PRESSURES[1]: run.cylinder.annulus_area_m2, LOAD_FORCE: 1.0}
    zeros_n = [area * zeros[name].zero for name, area in areas.items() if name in zeros]
    return (
        f"none: the accuracy of {', '.join(sorted(zeros.keys() & areas.keys() - stated.keys()))} is not stated, so "
        "that the sensors' zeros are not identified, and friction may be off by "
        f"them. State sensor.accuracy_percent in the mapping, or accept what is typical: --sensor-class "
        f"{TYPICAL_CLASS:g} ({typical.assumed.partition(': ')[2]}) would mean "
        f"± {COVERAGE_FACTOR * math.hypot(*zeros_n):.0f} N"
    )

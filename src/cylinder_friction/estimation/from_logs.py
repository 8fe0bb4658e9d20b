"""Logger files become files of friction and one page; memory holds one recording, or one part of a long one."""

from __future__ import annotations

import hashlib
import math
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.earlier import (
    Earlier,
    Processed,
    read_earlier,
    result_files,
    sort_logs,
    write_earlier,
)
from cylinder_friction.estimation.labelled_logs import LabelledLogs, inputs, refused_piece
from cylinder_friction.estimation.recording_friction import FileFormat
from cylinder_friction.estimation.results import FrictionOfLogs, table_rows
from cylinder_friction.estimation.running_estimate import loaded_once
from cylinder_friction.execution.workers import Died, Workers
from cylinder_friction.recordings.checks.limits import LoadMode
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, PRESSURES
from cylinder_friction.recordings.files import hash_of, write_json
from cylinder_friction.recordings.long_logs import ROWS_AT_ONCE
from cylinder_friction.recordings.mapping.channel_mapping import sensor_uncertainty
from cylinder_friction.recordings.reading_logs import Logs, find_logs
from cylinder_friction.recordings.result_folder import ResultFolder
from cylinder_friction.reporting.friction_page import pane_file, write_friction_page
from cylinder_friction.reporting.level_tables import level_tables
from cylinder_friction.reporting.page import PLOTTED

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

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
    estimator = loaded_once(Path(model)) if isinstance(model, str | Path) else model
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
            run.refused.append(refused_piece(each.metadata, result))
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

"""Read logger files as recordings: into memory, for notebooks and scripts, or into a folder, for a project."""

import shutil
import uuid
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.execution.workers import Workers
from cylinder_friction.files.whole_files import whole_folder, write_json
from cylinder_friction.recordings.checks.limits import GivenLoad
from cylinder_friction.recordings.conversion import (
    Converted,
    LoggedFile,
    Quarantined,
    SeenRecordings,
    converted,
    logged_files,
    none_usable,
    other_rates,
    overlaps_in_words,
    recordings_of,
    usable,
)
from cylinder_friction.recordings.logs import Logs, Recipe, find_logs
from cylinder_friction.recordings.mapping.channel_mapping import check_mapping
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.wording import counted


def read_recordings(
    files: str | Path | Iterable[str | Path],
    channels: str | Path | Mapping[str, Any] | None,
    cylinder: Cylinder,
    *,
    names: str | None = None,
    load: GivenLoad | None = None,
    units: Mapping[str, str] | None = None,
    sensor_class: float | None = None,
    database: str | Path | None = None,
) -> list[Recording]:
    """Read logger files of any format as recordings, in SI units at one constant rate, sorted by path.

    Each file is read, mapped, screened, aligned and checked as in the stage ``ingest``. A file that cannot be used is
    left out with a warning that states why. ``metadata.repairs`` lists repairs.

    Args:
        files: One path, a glob such as ``"logs/**/*.csv"``, a folder (all files in it), or several of these.
        channels: Mapping of channels to columns: the path of a YAML file such as ``conf/ingest/rig.yaml``, whose rules
            also apply, its content, or only its part under ``channels``. None guesses the mapping from the first
            file, and a warning states every guess. A unit that no file states is guessed only if no other unit fits.
        cylinder: The cylinder that was recorded; recordings are checked against its stroke and areas.
        names: Regular expression for a file's path with the groups ``condition`` and ``session`` (and ``load``). By
            default the ``name_pattern`` of ``channels``. Without one, each file is a session of its own, named as the
            file, and all have the condition "1".
        load: ``none``, ``measured`` (``load_force_n``), ``position`` (it depends on position alone), or a constant
            load in newtons with the limit of its error, ``"4218+-40"``. By default what ``channels`` states, else
            ``measured`` if ``load_force_n`` is mapped, else ``none``.
        units: Without ``channels``, the unit of each quantity (``pressure``, ``length``, ``time``, ``force``,
            ``temperature``) that the file does not state, such as ``{"pressure": "bar"}``.
        sensor_class: Accuracy of pressure sensors and load cell [± % of full scale] if ``channels`` states none. If
            their range is not stated either, full scale is 250 bar, and what the piston exerts at 250 bar. None
            assumes nothing.
        database: DBC file of the bus, for measurement files that contain CAN frames.

    Raises:
        RecordingError: No file is found or usable, or the mapping is wrong or cannot be guessed.
        FileNotFoundError: The mapping's file does not exist.

    Example:
        >>> recordings = cf.read_recordings("data/raw/rig/*.csv", "conf/ingest/rig.yaml", cylinder)
        >>> sorted({recording.metadata.condition for recording in recordings})
        ['1', '2', '3', '4']
    """
    given: dict[str, Any] = {"names": names, "load": load, "units": units, "database": database}
    logs = find_logs(files, channels, cylinder, sensor_class=sensor_class, **given)
    outcomes = list(recordings_of(logs))
    refused = [outcome for outcome in outcomes if isinstance(outcome, Quarantined)]
    recordings = [outcome for outcome in outcomes if isinstance(outcome, Recording)]
    others = other_rates([recording.metadata for recording in recordings])
    if not recordings:
        raise none_usable(logs.root.as_posix(), len(logs.files), refused[0])
    for entry in (*refused, *others.values()):
        warnings.warn(f"left out {entry.where}: {entry.reason}", stacklevel=2)
    if overlaps := overlaps_in_words((each.metadata, len(each) * each.sample_time_s) for each in recordings):
        warnings.warn(overlaps, stacklevel=2)
    return [recording for recording in recordings if recording.name not in others]


@dataclass
class Ingested:
    """The outcome of ingesting, in the order of the files' paths."""

    files: int = 0
    notes: list[str] = field(default_factory=list)
    recordings: list[tuple[RecordingMetadata, int]] = field(default_factory=list)
    quarantined: list[Quarantined] = field(default_factory=list)

    def repaired(self) -> list[RecordingMetadata]:
        return [metadata for metadata, _ in self.recordings if metadata.remarks]

    def summary(self) -> str:
        """Summarize the outcome for a person: one line in total, one per repair and one per refusal."""
        hours = sum(rows * metadata.sample_time_s for metadata, rows in self.recordings) / 3600.0
        lines = [
            f"{counted(len(self.recordings), 'recording')} ({hours:.3g} h) from {counted(self.files, 'file')}; "
            f"{len(self.repaired())} repaired or noted, {len(self.quarantined)} quarantined"
        ]
        lines += [f"  note         {note}" for note in self.notes]
        lines += [f"  used         {entry.name}: {'; '.join(entry.remarks)}" for entry in self.repaired()]
        lines += [f"  quarantined  {entry.where}: {entry.reason}" for entry in self.quarantined]
        return "\n".join(lines)


def ingest_folder(
    source: Path, pattern: str, recipe: Recipe, into: Path, quarantine_file: Path, workers: Workers | None = None
) -> Ingested:
    """Write one Parquet file per usable recording into ``into``, and the reasons of refusals as ``quarantine_file``.

    The files of the folder ``source`` that match the glob ``pattern`` (``**`` for folders below) are read. A bad file
    does not stop the others. Memory holds one file at a time, or one in each of the ``workers``.
    """
    check_mapping(recipe.channels)
    # A dangling link counts as a file that cannot be read.
    paths = sorted(path for path in source.glob(pattern) if not path.is_dir())
    if not paths:
        raise RecordingError(
            f"{source}: no file matches {pattern!r}; put recordings there, or name their folder as "
            "ingest.source and their pattern as ingest.pattern in params.yaml"
        )
    files = {path.relative_to(source).as_posix(): path for path in paths}
    result = Ingested(len(files))
    with whole_folder(into) as folder:
        elsewhere = folder / ".converted"
        work = partial(_written, folder=elsewhere)
        for outcome in usable(logged_files(Logs(source, files, recipe)), work, SeenRecordings(), workers):
            if isinstance(outcome, Quarantined):
                result.quarantined.append(outcome)
                continue
            path, rows = outcome.result
            path.rename(folder / f"{outcome.metadata.name}.parquet")
            result.recordings.append((outcome.metadata, rows))
        overlaps = overlaps_in_words((each, rows * each.sample_time_s) for each, rows in result.recordings)
        result.notes = [*_not_read(source, pattern, paths), *filter(None, [overlaps])]
        shutil.rmtree(elsewhere, ignore_errors=True)
        others = other_rates([metadata for metadata, _ in result.recordings])
        for name in others:
            (folder / f"{name}.parquet").unlink()
        result.recordings = [entry for entry in result.recordings if entry[0].name not in others]
        result.quarantined = sorted([*result.quarantined, *others.values()], key=lambda each: (each.file, each.piece))
        write_json(quarantine_file, [asdict(entry) for entry in result.quarantined])
        if not result.recordings:
            raise none_usable(source.as_posix(), len(files), result.quarantined[0])
    return result


def _written(file: LoggedFile, folder: Path) -> list[Converted | Quarantined]:
    """Write the recordings of a file into a folder; replace each by its path and number of rows."""

    def written(each: Converted) -> Converted:
        return replace(each, result=(write_recording(folder, each.result, uuid.uuid4().hex), len(each.result)))

    return [each if isinstance(each, Quarantined) else written(each) for each in converted(file)]


def _not_read(source: Path, pattern: str, matching: list[Path]) -> list[str]:
    """Name files that the pattern may leave out by mistake, such as .CSV among .csv files."""
    beside = {path for path in source.rglob("*") if not path.is_dir() and not path.name.startswith(".")}
    left_out = sorted(beside - set(matching))
    if not left_out:
        return []
    files, first = counted(len(left_out), "file"), left_out[0].relative_to(source).as_posix()
    return [f"{files} not read, for {pattern!r} does not match (first: {first}); see ingest.pattern"]

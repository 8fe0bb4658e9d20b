"""A folder of logged files becomes a folder of recordings; what is unusable is set aside with the reason."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.recordings.checks import CheckLimits, check_recording
from cylinder_friction.recordings.files import whole_folder, write_json
from cylinder_friction.recordings.mapping import (
    ChannelMapping,
    apply_mapping,
    check_mapping,
    compile_name_pattern,
    names_from_path,
)
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.recordings.storage import write_recording

if TYPE_CHECKING:
    import re
    from collections.abc import Mapping
    from pathlib import Path

    from cylinder_friction.recordings.readers import Reader

QUARANTINE_FILE = "quarantine.json"


@dataclass(frozen=True)
class Source:
    """Where logged files lie and what they mean.

    Attributes:
        folder: The folder that is searched.
        pattern: Glob of the files in it, ``**`` for folders below.
        name_pattern: Regular expression on the relative path, with groups ``test``, ``session``, optionally ``load``.
        reader: Reads one file.
        channels: Column to the logger's channel.
        cylinder: Name of the cylinder.
    """

    folder: Path
    pattern: str
    name_pattern: str
    reader: Reader
    channels: Mapping[str, ChannelMapping]
    cylinder: str


@dataclass(frozen=True)
class Quarantined:
    """A file that did not become a recording, and why."""

    file: str
    reason: str


@dataclass
class Ingested:
    """What became of the files, in the order of their paths."""

    recordings: list[tuple[RecordingMetadata, int]] = field(default_factory=list)
    quarantined: list[Quarantined] = field(default_factory=list)


def ingest_folder(source: Source, limits: CheckLimits, into: Path) -> Ingested:
    """Writes ``into`` whole: one Parquet file a usable recording, and ``quarantine.json`` with the others' reasons.

    One bad file never stops the others. Also set aside: a copy of a file already read, a second recording of one
    name, and recordings at another sample rate than most.

    Raises:
        RecordingError: The mapping or the name pattern is wrong, there is no file, or not one file is usable.
    """
    check_mapping(source.channels)
    name_pattern = compile_name_pattern(source.name_pattern)
    files = sorted(path for path in source.folder.glob(source.pattern) if path.is_file())
    if not files:
        raise RecordingError(
            f"{source.folder}: no file matches {source.pattern!r}; put recordings there, or name their folder as "
            "ingest.source and their pattern as ingest.pattern in params.yaml"
        )
    with whole_folder(into) as folder:
        result = _ingest_files(files, source, name_pattern, limits, folder)
        _set_aside_other_rates(result, folder)
        if not result.recordings:
            first = result.quarantined[0]
            raise RecordingError(
                f"{source.folder}: none of {len(files)} files is usable; the first, {first.file}: {first.reason}"
            )
        result.quarantined.sort(key=lambda entry: entry.file)
        write_json(folder / QUARANTINE_FILE, [asdict(entry) for entry in result.quarantined])
    return result


def _ingest_files(
    files: list[Path], source: Source, name_pattern: re.Pattern[str], limits: CheckLimits, folder: Path
) -> Ingested:
    result = Ingested()
    seen: dict[str, str] = {}
    names: dict[str, str] = {}
    for path in tqdm(files, desc="ingest", unit="file", disable=None):
        relative = path.relative_to(source.folder).as_posix()
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        try:
            if digest in seen:
                raise RecordingError(f"holds the same bytes as {seen[digest]}; a copy would be counted twice")
            recording = _read(path, relative, digest, source, name_pattern, limits)
            if recording.name in names:
                raise RecordingError(f"has the name {recording.name!r}, which {names[recording.name]} has already")
        except RecordingError as error:
            result.quarantined.append(Quarantined(relative, str(error)))
        else:
            names[recording.name] = relative
            write_recording(folder, recording)
            result.recordings.append((recording.metadata, len(recording)))
        seen.setdefault(digest, relative)
    return result


def _read(
    path: Path, relative: str, digest: str, source: Source, name_pattern: re.Pattern[str], limits: CheckLimits
) -> Recording:
    names = names_from_path(relative, name_pattern)
    metadata = RecordingMetadata(
        name=names.name,
        test=names.test,
        session=names.session,
        sample_time_s=0.0,
        cylinder=source.cylinder,
        load=names.load,
        source_file=relative,
        source_sha256=digest,
    )
    return check_recording(metadata, apply_mapping(source.reader.read(path), source.channels), limits)


def _set_aside_other_rates(result: Ingested, folder: Path) -> None:
    """Sets aside what does not share the commonest sample time: no estimator takes two rates."""
    counts = Counter(metadata.sample_time_s for metadata, _ in result.recordings)
    if len(counts) < 2:
        return
    common, count = counts.most_common(1)[0]
    for metadata, _ in result.recordings:
        if metadata.sample_time_s != common:
            (folder / f"{metadata.name}.parquet").unlink()
            reason = (
                f"has a sample time of {metadata.sample_time_s:.9g} s, but {count} of {counts.total()} recordings have "
                f"{common:.9g} s; resample it or ingest it on its own"
            )
            result.quarantined.append(Quarantined(metadata.source_file, reason))
    result.recordings = [entry for entry in result.recordings if entry[0].sample_time_s == common]

"""A folder of logged files becomes a folder of recordings; what is unusable is set aside with the reason."""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.recordings.checks.duplicate_detection import Fingerprints
from cylinder_friction.recordings.conversion import judged, metadata_of, pieces_of
from cylinder_friction.recordings.files import whole_folder, write_json
from cylinder_friction.recordings.mapping.calibration import NoZero, ZeroReading, find_zero, session_zero
from cylinder_friction.recordings.mapping.channel_mapping import check_mapping
from cylinder_friction.recordings.recording import RecordingError, RecordingMetadata
from cylinder_friction.recordings.storage import write_recording

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from cylinder_friction.recordings.conversion import Recipe
    from cylinder_friction.recordings.signal import Piece


@dataclass(frozen=True)
class Source:
    """Where logged files lie and what they mean.

    Attributes:
        folder: The folder that is searched.
        pattern: Glob of the files in it, ``**`` for folders below.
        recipe: How one of them becomes recordings.
    """

    folder: Path
    pattern: str
    recipe: Recipe


@dataclass(frozen=True)
class Quarantined:
    """A file, or a piece of one, that did not become a recording, and why.

    Attributes:
        file: Its path below the source's folder.
        reason: What is wrong, where, and what to do.
        piece: Which stretch of the file, where it came apart; empty for the whole file.
    """

    file: str
    reason: str
    piece: str = ""


@dataclass
class Ingested:
    """What became of the files, in the order of their paths."""

    files: int = 0
    notes: list[str] = field(default_factory=list)
    recordings: list[tuple[RecordingMetadata, int]] = field(default_factory=list)
    quarantined: list[Quarantined] = field(default_factory=list)

    def repaired(self) -> list[RecordingMetadata]:
        """Return the recordings that had to be repaired."""
        return [metadata for metadata, _ in self.recordings if metadata.repairs]

    def summary(self) -> str:
        """Return what happened, for a person: one line in all, one a repair and one a refusal."""
        seconds = sum(rows * metadata.sample_time_s for metadata, rows in self.recordings)
        lines = [
            f"{len(self.recordings)} recordings ({seconds / 3600.0:.3g} h) from {self.files} files; "
            f"{len(self.repaired())} repaired or noted, {len(self.quarantined)} quarantined"
        ]
        lines += [f"  note         {note}" for note in self.notes]
        lines += [f"  used         {entry.name}: {'; '.join(entry.repairs)}" for entry in self.repaired()]
        lines += [
            f"  quarantined  {entry.file}{f' ({entry.piece})' if entry.piece else ''}: {entry.reason}"
            for entry in self.quarantined
        ]
        return "\n".join(lines)


def ingest_folder(source: Source, into: Path, quarantine_file: Path) -> Ingested:
    """Write ``into`` whole, one Parquet file a usable recording, and the others' reasons as ``quarantine_file``.

    One bad file never stops the others, and memory holds one file at a time. Also set aside: a copy of a file already
    read, the same recording exported twice, a second recording of one name, and recordings at another sample rate than
    most.

    Raises:
        RecordingError: The mapping is wrong, there is no file, or not one is usable.
    """
    check_mapping(source.recipe.channels)
    # A link that leads nowhere is a file too: one that cannot be read.
    files = sorted(path for path in source.folder.glob(source.pattern) if not path.is_dir())
    if not files:
        raise RecordingError(
            f"{source.folder}: no file matches {source.pattern!r}; put recordings there, or name their folder as "
            "ingest.source and their pattern as ingest.pattern in params.yaml"
        )
    with whole_folder(into) as folder:
        result = _Ingest(source, folder).run(files)
        _set_aside_other_rates(result, folder)
        result.quarantined.sort(key=lambda entry: (entry.file, entry.piece))
        write_json(quarantine_file, [asdict(entry) for entry in result.quarantined])
        if not result.recordings:
            first = result.quarantined[0]
            raise RecordingError(
                f"{source.folder}: none of {len(files)} files is usable; the first, {first.file}: {first.reason}"
            )
    return result


class _Ingest:
    """What one run over a folder has to remember: what was seen, and what became of it."""

    def __init__(self, source: Source, folder: Path) -> None:
        self._source = source
        self._folder = folder
        self._result = Ingested()
        self._digests: dict[str, str] = {}
        self._names: dict[str, str] = {}
        self._fingerprints = Fingerprints()
        self._zeros: dict[str, ZeroReading | NoZero] = {}

    def run(self, files: list[Path]) -> Ingested:
        relative = {path.relative_to(self._source.folder).as_posix(): path for path in files}
        self._result.files = len(files)
        self._result.notes = [*self._source.recipe.names.lines_without_file(relative), *self._not_read(files)]
        if self._source.recipe.zero.method != "none":
            self._zeros = session_zeros(relative, self._source.recipe)
        for name, path in tqdm(relative.items(), desc="ingest", unit="file", disable=None):
            self._file(path, name)
        return self._result

    def _not_read(self, matching: list[Path]) -> list[str]:
        """Return a sentence on the files that the pattern leaves out: among logs in .csv, one may end in .CSV."""
        source = self._source
        beside = {path for path in source.folder.rglob("*") if not path.is_dir() and not path.name.startswith(".")}
        left_out = sorted(beside - set(matching) - {source.recipe.names.table})
        if not left_out:
            return []
        first = left_out[0].relative_to(source.folder).as_posix()
        files = "1 file" if len(left_out) == 1 else f"{len(left_out)} files"
        return [f"{files} not read, for {source.pattern!r} does not match (first: {first}); see ingest.pattern"]

    def _file(self, path: Path, relative: str) -> None:
        recipe = self._source.recipe
        try:
            digest = _new_digest(path, relative, self._digests)
            names = recipe.names.names(relative)
            pieces = pieces_of(path, recipe)
        except (RecordingError, OSError) as error:
            self._result.quarantined.append(Quarantined(relative, str(error)))
            return
        for number, piece in enumerate(pieces, start=1):
            metadata = metadata_of(piece, names, number, len(pieces), relative, digest, recipe.cylinder)
            try:
                self._piece(piece, metadata)
            except RecordingError as error:
                where = f"piece {number} of {len(pieces)}" if len(pieces) > 1 else ""
                self._result.quarantined.append(Quarantined(relative, str(error), where))

    def _piece(self, piece: Piece, metadata: RecordingMetadata) -> None:
        recording = judged(piece, metadata, self._source.recipe, self._zeros.get(metadata.session))
        if recording.name in self._names:
            raise RecordingError(f"has the name {recording.name!r}, which {self._names[recording.name]} has already")
        match = self._fingerprints.add(recording.name, piece.table)
        if match is not None:
            raise RecordingError(
                f"is the same measurement as recording {match.name!r}, or overlaps it ({100.0 * match.share:.0f} % of "
                "its windows are equal, noise and all); a model could be judged by what it was taught; keep one of them"
            )
        self._names[recording.name] = metadata.source_file
        write_recording(self._folder, recording)
        self._result.recordings.append((recording.metadata, len(recording)))


def _new_digest(path: Path, relative: str, seen: dict[str, str]) -> str:
    """Return the SHA-256 of a file's bytes and remembers it; raises ``RecordingError`` for bytes already seen."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if digest in seen:
        raise RecordingError(f"holds the same bytes as {seen[digest]}; a copy would be counted twice")
    seen[digest] = relative
    return digest


def session_zeros(files: Mapping[str, Path], recipe: Recipe) -> dict[str, ZeroReading | NoZero]:
    """Return what the pressure sensors of each session read while vented, from the recordings that show it.

    A session has one calibration, so that a recording without a vented stretch is zeroed by its neighbours. What
    cannot be read is passed over here; the run over the files says why.
    """
    readings: defaultdict[str, list[ZeroReading | NoZero]] = defaultdict(list)
    for relative, path in tqdm(files.items(), desc="zeros", unit="file", disable=None):
        with suppress(RecordingError, OSError):
            names = recipe.names.names(relative)
            for piece in pieces_of(path, recipe):
                readings[names.session].append(find_zero(piece.table, recipe.zero, recipe.channels, names.name))
    return {session: session_zero(read) for session, read in readings.items()}


def _set_aside_other_rates(result: Ingested, folder: Path) -> None:
    """Set aside what does not share the commonest sample time: no estimator takes two rates."""
    counts = Counter(metadata.sample_time_s for metadata, _ in result.recordings)
    if len(counts) < 2:
        return
    common, count = counts.most_common(1)[0]
    for metadata, _ in result.recordings:
        if metadata.sample_time_s != common:
            (folder / f"{metadata.name}.parquet").unlink()
            reason = (
                f"has a sample time of {metadata.sample_time_s:.9g} s, but {count} of {counts.total()} recordings have "
                f"{common:.9g} s; name one rate for all as ingest.time.rate_hz, or ingest it on its own"
            )
            result.quarantined.append(Quarantined(metadata.source_file, reason))
    result.recordings = [entry for entry in result.recordings if entry[0].sample_time_s == common]

"""The results of a run on logs: a summary with one entry per recording and refused file, and the recordings' files.

A Parquet file also contains its entry, and everything that later runs need. Logs are compared by content, not by name
or date.
"""

from __future__ import annotations

import json
import math
import os
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cylinder_friction.evaluation.friction_levels import FrictionLevel, RecordingDifference, differences
from cylinder_friction.files.result_folder import ResultFolder, refuse_foreign
from cylinder_friction.files.whole_files import read_json, whole_file, write_text
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks
from cylinder_friction.realtime.trained_for import OtherCylinderError as OtherCylinderError  # noqa: PLC0414 - also from here
from cylinder_friction.recordings.conversion import LoggedFile
from cylinder_friction.recordings.conversion import Quarantined as Quarantined  # noqa: PLC0414 - also from here
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_beside, read_recording, write_recording

FileFormat = Literal["parquet", "csv"]
"""``csv`` writes a CSV file beside each Parquet file; ``parquet`` does not."""
ABOUT, COMPARED = "cylinder_friction_result", "cylinder_friction_compared"
"""Keys in a result's metadata: its statements, and the data that later recordings are compared with."""
SUMMARY_FILE, PAGE_FILE = "summary.json", "friction.html"
WRITTEN_BY = "cylinder-friction estimate"
GONE = "its file was not among the logs of the last run"
REFUSED = "the last run refused its file; this is the result of an earlier run"


@dataclass(frozen=True)
class FrictionOfRecording:
    """The summary of one recording; friction itself is in its file."""

    name: str
    source_file: str
    source_sha256: str
    session: str
    rows: int
    duration_s: float
    usable_percent: float  # Share of rows whose force balance is friction alone, not near end stops or edges [%]
    # Half of extending less retracting friction at equal positions [N]; None if it is ``unknown``
    friction_n: float | None
    flags_percent: dict[str, float] | None  # Share of rows with each of the estimator's flags [%]; None without one
    load: str  # The load that was subtracted, in words
    # Why the estimates must not be used as they are, and what else is unlike training; empty if nothing is
    not_known: str
    unlike_training: str
    load_left_n: float | None  # Approximate load that friction still contains [N]; None if there is no sign of one
    repairs: tuple[str, ...]  # Repairs made while reading, one sentence each
    condition: str = ""
    asset: str = ""  # The machine, if it is stated
    # When its first sample was taken, as in ``RecordingMetadata``, and the source of that time; empty if not known
    start: str = ""
    start_source: str = ""
    # Serial number and day of calibration of the sensor behind a column, if they are stated
    sensors: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    levels: tuple[FrictionLevel, ...] = ()  # Friction of steady sliding at each level of pressure and speed
    unknown: str = ""  # Why ``friction_n`` is None, and what to check
    gone: str = ""  # A sentence if the last run got no result from its file; else empty
    # Whether it must not be compared with later results: it is of another cylinder, or another mapping refuses its file
    outdated: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        return {**vars(self), "levels": [dict(vars(each)) for each in self.levels]}


@dataclass(frozen=True)
class FrictionOfLogs:
    """The outcome of a run on logs."""

    folder: Path  # Folder of the files
    bounds: str  # Meaning of ``lower_n`` and ``upper_n``
    recordings: list[FrictionOfRecording] = field(default_factory=list)
    refused: list[Quarantined] = field(default_factory=list)
    offsets: list[KnownOffset] = field(default_factory=list)
    new: tuple[str, ...] = ()  # Names of the recordings that this call processed; earlier calls processed the others
    # SHA-256 of each thing besides the logs that results depend on: cylinder, mapping, model, version of the code
    depends_on: Mapping[str, str] = field(default_factory=dict)
    # The file from which channels and units were guessed, and each guess with its reasons; None with a mapping
    guessed: dict[str, Any] | None = None
    loss: str = ""  # An apparent loss between sensors and cylinder, in words; empty if there is none

    @property
    def levels(self) -> dict[str, tuple[FrictionLevel, ...]]:
        """Friction of steady sliding at each level of pressure and speed, by recording."""
        return {each.name: each.levels for each in self.recordings}

    @cached_property
    def differences(self) -> tuple[RecordingDifference, ...]:
        """Differences in friction between recordings, as they are and at equal pressures and speed."""
        return differences(self.levels)

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; unknown values are None."""
        differing = [{**vars(each), "equal": each.equal and vars(each.equal)} for each in self.differences]
        return self.found() | {"differences": differing}

    def found(self) -> dict[str, Any]:
        """Return the content without the differences, which follow from it."""
        content = vars(self) | {"folder": self.folder.as_posix(), "refused": [vars(each) for each in self.refused]}
        content["recordings"] = [each.to_dict() for each in self.recordings]
        content["offsets"] = [{name: known_number(own) for name, own in vars(each).items()} for each in self.offsets]
        return content


def remarks(each: FrictionOfRecording) -> list[str]:
    """List remarks on a recording besides its numbers."""
    not_known = each.not_known and f"not to be used as it is: {each.not_known}"
    load = "" if each.load == "none" else f"load: {each.load}"
    flags = [f"{share:.1f} % {name}" for name, share in (each.flags_percent or {}).items()]
    words = [each.gone, each.unknown, not_known, each.unlike_training, load_left(each), load, *flags, *each.repairs]
    return [each for each in words if each]


def load_left(each: FrictionOfRecording) -> str:
    """State the load that friction still contains, and what to do; empty if there is no sign of one."""
    if each.load_left_n is None:
        return ""
    causes = "a load, a sensor's zero or the loss of a line"
    remedy = "map a load cell, use --load position, zero the sensors, or weigh a constant load (--load NEWTONS)"
    second = "if the cylinder has a second rod, it must be stated (rod_diameter_1_m)"
    return f"friction_n holds {causes}, of about {each.load_left_n:.0f} N; {remedy}; {second}"


def table_rows(result: FrictionOfLogs) -> list[tuple[str, str, float | None, str, str]]:
    """List name, start, friction [N], usable share and remarks of every recording and refused file."""
    rows = [
        (each.name, each.start, each.friction_n, f"{each.usable_percent:.0f}", "; ".join(remarks(each)))
        for each in result.recordings
    ]
    return rows + [(each.where, "", None, "", f"refused: {each.reason}") for each in result.refused]


def known_number(value: Any) -> Any:
    """Replace a number that is not known by None."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Result:
    """The statements of a result besides its rows."""

    entry: FrictionOfRecording
    depends_on: Mapping[str, str]  # SHA-256 of each thing besides the log that friction depends on
    of_file: int  # Number of recordings in its log
    beside: tuple[str, ...]  # Its further files, relative to the folder: its pane, and its friction in another format
    bounded: bool  # Whether its friction has bounds
    offset: KnownOffset | None  # The offset of its session, as far as it was known; None with an estimator
    compared: str = field(repr=False, default="")  # Data that later recordings are compared with, from ``packed``
    # Folder that ``source_file`` is relative to, seen from the folder of results: both may be moved together
    logs: str = ""

    @property
    def file(self) -> str:
        return f"{self.entry.name}.parquet"

    @property
    def files(self) -> tuple[str, ...]:
        """All files of the result, relative to the folder."""
        return self.file, *self.beside

    def texts(self) -> dict[str, str]:
        own = {"compared": "", "entry": self.entry.to_dict(), "offset": self.offset and vars(self.offset)}
        return {ABOUT: json.dumps(vars(self) | own, sort_keys=True), COMPARED: self.compared}


def read_result(path: Path) -> Result | None:
    """Read the statements of a result; None if ``write_result`` did not write the file."""
    texts = read_beside(path)
    if ABOUT not in texts:
        return None
    about: dict[str, Any] = json.loads(texts[ABOUT])
    entry = about["entry"]
    lists = {"repairs": tuple(entry["repairs"]), "levels": tuple(FrictionLevel(**each) for each in entry["levels"])}
    offset = about["offset"] and KnownOffset(**about["offset"])
    own = {"entry": FrictionOfRecording(**entry | lists), "offset": offset, "beside": tuple(about["beside"])}
    return Result(**about | own | {"compared": texts[COMPARED]})


def write_result(folder: Path, finished: Recording, result: Result, pane: str, listed: Collection[str] = ()) -> None:
    """Write the files of a result. It counts only once all files exist, so that an aborted run does no harm."""
    path = folder / result.file
    earlier = read_result(path) if path.is_file() else None
    own = () if earlier is None else earlier.files
    for name in set(result.files) - {*listed, *own}:
        refuse_foreign(folder / name)
    for name in {*own, *result.beside} - {result.file}:  # a new result with an old pane would count as complete
        (folder / name).unlink(missing_ok=True)
    write_recording(folder, finished, beside=result.texts())
    for name in result.beside:
        beside = folder / name
        if beside.suffix == ".csv":
            with whole_file(beside) as draft:
                finished.table.to_csv(draft, index=False, float_format="%.9g")
        else:
            write_text(beside, pane)


def packed(evidence: OffsetEvidence | None, samples: str) -> str:
    """Encode the data that later recordings are compared with as text; equal content gives equal text."""

    def plain(content: Any) -> Any:
        array = isinstance(content, np.ndarray)
        return {"dtype": content.dtype.str, "hex": content.tobytes().hex()} if array else vars(content)

    return json.dumps({"evidence": evidence, "samples": samples}, default=plain)


def unpacked(text: str) -> tuple[OffsetEvidence | None, str]:
    """Decode the text that ``packed`` made."""

    def array(content: dict[str, Any]) -> Any:
        return np.frombuffer(bytes.fromhex(content["hex"]), content["dtype"]) if "hex" in content else content

    about = json.loads(text, object_hook=array)
    if (evidence := about["evidence"]) is not None:
        evidence = OffsetEvidence(**evidence | {"sliding": SlidingBlocks(**evidence["sliding"])})
    return evidence, about["samples"]


def read_results(folder: Path) -> list[Result]:
    """Read the statements of the results in a folder, in the order of their names."""
    return [found for path in sorted(folder.glob("*.parquet")) if (found := read_result(path)) is not None]


def sort_logs(
    logs: Sequence[LoggedFile],
    folder: Path,
    results: Iterable[Result],
    depends_on: Mapping[str, str],
    root: str,
) -> tuple[list[LoggedFile], list[Result]]:
    """Return the logs that are new, and the results to keep.

    A log is not new if all its results exist and were made from the same bytes under the same name, with the same
    cylinder, mapping, model and code. Every other log is new. All logs of its session are then processed again, because
    their offset and load are identified together. The results of a log that is gone are kept and marked.

    Raises:
        FileExistsError: A result of another cylinder, or of another folder than ``root``, would be replaced by a log of
            the same name.
    """
    of_file: defaultdict[str, list[Result]] = defaultdict(list)
    for each in results:
        of_file[each.entry.source_file].append(each)
    digests = {log.name: log.digest for log in logs}
    known = {name: own[0].entry.source_sha256 for name, own in of_file.items()}
    named = [of_file[name][0] for name in sorted(known.keys() & digests.keys())]
    unlike = [each for each in named if each.entry.source_sha256 != digests[each.entry.source_file]]
    others = [each for each in unlike if _is_other(each, depends_on, root)]
    if others and 2 * len(others) >= len(named):  # else the same logs, moved, or with corrected dimensions
        where = Path(os.path.normpath(folder / others[0].logs / others[0].entry.source_file))
        of = ", of another cylinder," if others[0].depends_on.get("cylinder") != depends_on["cylinder"] else ""
        raise FileExistsError(
            f"{folder}: holds the friction of another {others[0].entry.source_file}{of} ({where}), which this "
            "run would replace; name another folder by --output, or, if both logs are of this cylinder, "
            "give both in one run"
        )
    same = {
        name
        for name, own in of_file.items()
        if all(each.entry.source_sha256 == digests.get(name) and each.of_file == len(own) for each in own)
        and all(each.depends_on == depends_on for each in own)
        and all((folder / beside).is_file() for each in own for beside in each.beside)
    }
    new = digests.keys() - same
    session = {log.name: _session(log) for log in logs}
    sessions = {session[name] for name in new} - {""}
    new |= {name for name in same if session[name] in sessions}
    gone = {name for name, digest in known.items() if name not in digests and digest not in digests.values()}
    kept = [each for name in same - new for each in of_file[name]]
    kept += [_marked(each, GONE, depends_on) for name in gone for each in of_file[name]]
    return [log for log in logs if log.name in new], kept


def _is_other(result: Result, depends_on: Mapping[str, str], root: str) -> bool:
    """Check whether a result is of another cylinder, or of logs in another folder than ``root``."""
    moved = bool(result.logs) and result.logs != root
    return moved or result.depends_on.get("cylinder") != depends_on["cylinder"]


def without_new_result(
    earlier: Iterable[Result], read: Sequence[LoggedFile], new: Iterable[Result], depends_on: Mapping[str, str]
) -> list[Result]:
    """Return the earlier results of logs that were read again, and gave none this time; they are kept and marked."""
    replaced = {each.entry.source_file for each in new}
    names = {log.name for log in read} - replaced
    moved = {log.digest for log in read if log.name in replaced}
    kept = (each for each in earlier if each.entry.source_file in names)
    return [_marked(each, REFUSED, depends_on) for each in kept if each.entry.source_sha256 not in moved]


def _marked(result: Result, why: str, depends_on: Mapping[str, str]) -> Result:
    """Mark a result from which the last run got no new one, and state what it was processed with."""
    unlike = [key for key in depends_on if result.depends_on.get(key) != depends_on[key]]
    words = f"; it was processed with another {' and another '.join(unlike)}" if unlike else ""
    outdated = "cylinder" in unlike or (why == REFUSED and "mapping" in unlike)
    return replace(result, entry=replace(result.entry, gone=why + words, outdated=outdated))


def _session(log: LoggedFile) -> str:
    try:
        return log.recipe.names.names(log.name).session
    except RecordingError:
        return ""


def kept_summary(results: Path) -> dict[str, Any]:
    """Read the summary of the folder's last run; empty if there is none."""
    path = results / SUMMARY_FILE
    return dict(read_json(path)) if path.is_file() else {}


def kept_recordings(results: Path) -> dict[str, list[dict[str, Any]]]:
    """Read the folder's entries on its recordings, by session; empty if there is no folder.

    Each entry contains, among others, the recording's ``name``, its log's ``source_file`` and ``source_sha256``, and
    ``gone``, whether the log was missing in the latest run.
    """
    sessions = defaultdict(list)
    for each in kept_summary(results).get("recordings", ()):
        sessions[each["session"]].append(each)
    return dict(sessions)


def friction_of(results: Path, name: str) -> Recording:
    """Read one recording with its friction and all other columns of its Parquet file."""
    return read_recording(results / f"{name}.parquet")


def made_with_model(results: Path) -> str:
    """Read the SHA-256 of the model that the folder's last run used; empty if it used none."""
    return str(kept_summary(results).get("depends_on", {}).get("model", ""))


def restore_summary(results: Path) -> str:
    """Rebuild a damaged summary from the results beside it. Return what was wrong; empty if nothing was.

    Each result contains its entry in the summary. Only the refused logs are missing until ``estimate_logs`` runs again.
    """
    target = ResultFolder(results, SUMMARY_FILE, WRITTEN_BY)
    try:
        kept_recordings(results)
        target.listed()
        return ""
    except (FileExistsError, ValueError, TypeError, LookupError) as error:
        problem = f"{type(error).__name__}: {error}"
    found = read_results(results)
    recordings, last = [each.entry.to_dict() for each in found], found[-1].depends_on if found else {}
    target.claim([name for each in found for name in each.files], {"recordings": recordings, "depends_on": last})
    return problem

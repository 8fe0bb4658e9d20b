"""The results in a folder: one Parquet file per recording, with everything that later runs need.

The results show which logs are new to the folder. Logs are compared by content, not by name or date.
"""

from __future__ import annotations

import json
import os
import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cylinder_friction.estimation.results import FrictionOfRecording
from cylinder_friction.evaluation.friction_levels import FrictionLevel
from cylinder_friction.files.whole_files import whole_file, write_text
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks
from cylinder_friction.recordings.checks.duplicates import Samples
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.result_folder import refuse_foreign
from cylinder_friction.recordings.storage import read_beside, write_recording

if TYPE_CHECKING:
    from cylinder_friction.recordings.reading_logs import Logs

FileFormat = Literal["parquet", "csv"]
"""``csv`` writes a CSV file beside each Parquet file; ``parquet`` does not."""
ABOUT, COMPARED = "cylinder_friction_result", "cylinder_friction_compared"
"""Keys in a result's metadata: its statements, and the data that later recordings are compared with."""
SETTLED_S = 10.0
"""Least age of a new file's last change [s]. A younger file may still be being written and waits for the next run."""
LEFT_FOR_NEXT_RUN = f"changed less than {SETTLED_S:g} s ago and left for the next run"
GONE, KEPT = "its file was not among the logs of the last run", "not among the logs any more, results kept"


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

    @property
    def file(self) -> str:
        return f"{self.entry.name}.parquet"

    @property
    def files(self) -> tuple[str, ...]:
        """All files of the result, relative to the folder."""
        return self.file, *self.beside

    def texts(self) -> dict[str, str]:
        about = {**vars(self), "entry": self.entry.to_dict(), "offset": self.offset and vars(self.offset)}
        about.pop("compared")
        return {ABOUT: json.dumps(about, sort_keys=True), COMPARED: self.compared}


def read_result(path: Path) -> Result | None:
    """Read the statements of a result; None if ``write_result`` did not write the file."""
    texts = read_beside(path)
    if ABOUT not in texts:
        return None
    about: dict[str, Any] = json.loads(texts[ABOUT])
    entry = about["entry"]
    lists = {"repairs": tuple(entry["repairs"]), "levels": tuple(FrictionLevel(**each) for each in entry["levels"])}
    about |= {
        "entry": FrictionOfRecording(**{**entry, **lists}),
        "offset": about["offset"] and KnownOffset(**about["offset"]),
        "beside": tuple(about["beside"]),
    }
    return Result(**about, compared=texts[COMPARED])


def write_result(folder: Path, finished: Recording, result: Result, pane: str, listed: Collection[str] = ()) -> None:
    """Write the files of a result. It counts only once all files exist, so that an aborted run does no harm.

    Args:
        folder: The folder of results.
        finished: The recording with its friction.
        result: The statements of the result.
        pane: The recording's pane of the page.
        listed: Files that an earlier run listed as its own.

    Raises:
        FileExistsError: A file of the same name exists that no earlier run wrote.
    """
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


def packed(evidence: OffsetEvidence | None, samples: Samples) -> str:
    """Encode the data that later recordings are compared with as text; equal content gives equal text."""

    def plain(content: Any) -> Any:
        return content.tolist() if isinstance(content, np.ndarray) else vars(content)

    return json.dumps({"evidence": evidence, "samples": samples}, default=plain)


def unpacked(text: str) -> tuple[OffsetEvidence | None, Samples]:
    """Decode the text that ``packed`` made."""
    about = json.loads(text)
    evidence, samples = about["evidence"], Samples(**about["samples"])
    if evidence is None:
        return None, samples
    sliding = evidence["sliding"]
    sliding |= {name: np.array(sliding[name], dtype=np.float64) for name in ("label_n", "direction")}
    sliding["stroke"] = np.array(sliding["stroke"], dtype=np.int64)
    columns = {name: np.array(values, dtype=np.float64) for name, values in sliding.pop("columns").items()}
    return OffsetEvidence(**evidence | {"sliding": SlidingBlocks(**sliding, columns=columns)}), samples


@dataclass(frozen=True)
class Sorted:
    """The logs to process, and the results to keep."""

    new: dict[str, Path]  # Logs to process, by their paths below the root
    kept: list[Result]  # Results to keep; a result whose log is gone is marked
    news: tuple[str, ...]  # One sentence for each kind of change


def read_results(folder: Path) -> list[Result]:
    """Read the statements of the results in a folder, in the order of their names."""
    found = (read_result(path) for path in sorted(folder.glob("*.parquet")))
    return [each for each in found if each is not None]


def sort_logs(
    logs: Logs,
    digests: Mapping[str, str],
    folder: Path,
    results: Iterable[Result],
    depends_on: Mapping[str, str],
    now_s: float | None = None,
) -> Sorted:
    """Decide which logs are new, and which results to keep.

    A log is not new if all its results exist and were made from the same bytes under the same name, with the same
    cylinder, mapping, model and code. Every other log is new. All logs of its session are then processed again, because
    their offset and load are identified together. The results of a log that is gone are kept.

    Args:
        logs: All logs of this run.
        digests: SHA-256 of each log.
        folder: The folder of results.
        results: The statements of its results.
        depends_on: SHA-256 of each thing besides the logs that results depend on.
        now_s: The present time [s]; None reads this machine's clock.
    """
    of_file: defaultdict[str, list[Result]] = defaultdict(list)
    for each in results:
        of_file[each.entry.source_file].append(each)
    if not of_file:
        return Sorted(dict(logs.files), [], ())
    now_s = time.time() if now_s is None else now_s
    known = {name: own[0].entry.source_sha256 for name, own in of_file.items()}
    same_bytes = {name for name, digest in digests.items() if _all_there(of_file.get(name, ()), digest, folder)}
    same = {name for name in same_bytes if all(each.depends_on == depends_on for each in of_file[name])}
    changed = digests.keys() - same
    early = {name for name in changed - same_bytes if 0.0 <= now_s - _changed_s(logs.files[name]) < SETTLED_S}
    held = {digest: name for name, digest in digests.items() if name not in early}
    moved = {name: held[digest] for name, digest in known.items() if name not in digests and digest in held}
    gone = known.keys() - digests.keys() - moved.keys()
    process = changed - early
    sessions = {_session(logs, name) for name in process} - {""}
    mates = {name for name in same if _session(logs, name) in sessions}
    stay = (same - mates) | (early & known.keys())
    anew = process & same_bytes
    others = sorted({key for name in anew for each in of_file[name] for key in _unlike(each, depends_on)})
    with_content = process & known.keys() - anew
    news = [
        (len(anew), f"processed anew, with another {' and another '.join(others)} than before", ""),
        (len(process - known.keys() - set(moved.values())), "new or refused until now", ""),
        (len(with_content), "with new content", ""),
        (len(mates), "processed again: a log of their session is new", ""),
        (len(moved), "renamed", _some(f"{old} is {now}" for old, now in moved.items())),
        (len(early), LEFT_FOR_NEXT_RUN, _some(early)),
        (len(gone), KEPT, _some(gone)),
        (len(stay), "as before", ""),
    ]
    kept = [each for name in stay for each in of_file[name]]
    for each in (each for name in gone for each in of_file[name]):
        unlike = _unlike(each, depends_on)
        words = f"; it was processed with another {' and another '.join(unlike)}" if unlike else ""
        kept.append(replace(each, entry=replace(each.entry, gone=GONE + words)))
    new = {name: path for name, path in logs.files.items() if name in process | mates}
    counted = ((f"{count} file{'' if count == 1 else 's'} {what}", which) for count, what, which in news if count)
    return Sorted(new, kept, tuple(f"{words}: {which}" if which else words for words, which in counted))


def _all_there(results: Iterable[Result], digest: str, folder: Path) -> bool:
    """Check whether ``results`` are all results of a log with this SHA-256."""
    own = list(results)
    alike = all(each.entry.source_sha256 == digest and each.of_file == len(own) for each in own)
    return bool(own) and alike and all((folder / name).is_file() for each in own for name in each.beside)


def _unlike(each: Result, depends_on: Mapping[str, str]) -> list[str]:
    return [key for key in depends_on if each.depends_on.get(key) != depends_on[key]]


def _changed_s(path: Path) -> float:
    try:
        return os.stat(path).st_mtime  # noqa: PTH116 - a plain number
    except OSError:
        return 0.0


def _session(logs: Logs, name: str) -> str:
    try:
        return logs.recipe.names.names(name).session
    except RecordingError:
        return ""


def _some(names: Iterable[str]) -> str:
    first, *others = sorted(names) or [""]
    return ", ".join([first, *others[:2]]) + (", ..." if len(others) > 2 else "")

"""What earlier runs left in a folder of results, so that the next one processes only what is new.

A file is known by its content: by the SHA-256 of its bytes, not by its name or its date. Beside each recording's result
is kept what later files are compared with: the hashes of its windows and what its strokes show of the sensors' offset.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.estimation.results import FrictionOfRecording
from cylinder_friction.evaluation.friction_levels import FrictionLevel
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks
from cylinder_friction.recordings.checks.duplicate_detection import Hashes
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from cylinder_friction.recordings.reading_logs import Logs

PROCESSED_FILE = "state/processed.parquet"  # in a folder, where no recording can have its name
SETTLED_S = 10.0
"""A new file that was changed less than so long ago may still be written: it is left for the next run."""
GONE, KEPT = "its file was not among the logs of the last run", "not among the logs any more, results kept"
_ABOUT = b"cylinder_friction"
_OF_BLOCKS = ("label_n", "direction", "stroke")


@dataclass(frozen=True)
class Processed:
    """One recording that was processed, and what later ones are compared with."""

    entry: FrictionOfRecording
    bounded: bool  # Whether its friction has bounds
    hashes: Mapping[int, Hashes]  # Of its windows
    evidence: tuple[OffsetEvidence, ...]  # Of each part that was looked at; none with an estimator


@dataclass(frozen=True)
class Earlier:
    """All that is kept of earlier runs."""

    # By what results depend on beside the logs (cylinder, mapping, model, code): its hash
    depends_on: Mapping[str, str] = field(default_factory=dict)
    recordings: tuple[Processed, ...] = ()
    offsets: tuple[KnownOffset, ...] = ()
    anew: str = ""  # What was another one when they were processed, so that all logs are new; empty where nothing was

    @property
    def files(self) -> dict[str, str]:
        """The SHA-256 of each file that was processed, by its path below the root."""
        return {each.entry.source_file: each.entry.source_sha256 for each in self.recordings}

    def of_files(self, files: Iterable[str], gone: Iterable[str]) -> list[Processed]:
        """Return the recordings of some files, those of ``gone`` ones marked."""
        words = GONE + (f"; it was processed with another {self.anew}" if self.anew else "")
        marks = dict.fromkeys(files, "") | dict.fromkeys(gone, words)
        return [
            replace(each, entry=replace(each.entry, gone=marks[file] and (each.entry.gone or marks[file])))
            for each in self.recordings
            if (file := each.entry.source_file) in marks
        ]


@dataclass(frozen=True)
class Sorted:
    """Which logs are to be processed, and what becomes of the earlier ones."""

    new: dict[str, Path]  # To be processed, by their paths below the root
    kept: list[Processed]
    news: tuple[str, ...]  # One sentence on each kind of change
    same: bool = False  # Whether nothing is to be done


def sort_logs(logs: Logs, earlier: Earlier, now_s: float | None = None) -> Sorted:
    """Return which of the logs are new, and which results stay.

    New are files whose content was not processed under their name, those refused until now, and the other files of a
    session to which one is added, whose offset and load are identified together. A file that is gone keeps its results.
    """
    if not earlier.recordings:
        return Sorted(dict(logs.files), [], ())
    now_s = time.time() if now_s is None else now_s
    known, digests = earlier.files, {name: _digest(path) for name, path in logs.files.items()}
    if earlier.anew:
        gone = {name for name, digest in known.items() if name not in digests and digest not in digests.values()}
        anew = f"processed anew, with another {earlier.anew} than before"
        lost = [_in_words(len(gone), KEPT, _some(gone))] if gone else []
        return Sorted(dict(logs.files), earlier.of_files((), gone), (anew, *lost))
    changed = {name for name, digest in digests.items() if digest != known.get(name)}
    early = {name for name in changed if 0.0 <= now_s - _changed_s(logs.files[name]) < SETTLED_S}
    held = {digest: name for name, digest in digests.items() if name not in early}
    gone = {name for name, digest in known.items() if name not in digests and digest not in held}
    moved = {name: held[digest] for name, digest in known.items() if name not in digests and digest in held}
    sessions = {_session(logs, name) for name in changed - early}
    mates = {name for name in digests if name not in changed and _session(logs, name) in sessions - {""}}
    new = {name: path for name, path in logs.files.items() if name in (changed - early) | mates}
    stay = (digests.keys() & known.keys()) - new.keys()  # the former result of a file still written among them
    kept = earlier.of_files(stay, gone)
    counts = Counter(name in known for name in changed - early)
    news = [
        (counts[False] - len(set(moved.values()) - known.keys()), "new or refused until now", ""),
        (counts[True], "with new content", ""),
        (len(mates), "processed again for the sake of their sessions", ""),
        (len(moved), "renamed", _some(f"{old} is {now}" for old, now in moved.items())),
        (len(early), f"changed less than {SETTLED_S:g} s ago and left for the next run", _some(early)),
        (len(gone), KEPT, _some(gone)),
        (len(stay), "as before", ""),
    ]
    same = not new and [each.entry for each in kept] == [each.entry for each in earlier.recordings]
    return Sorted(new, kept, tuple(_in_words(*each) for each in news if each[0]), same)


def result_files(folder: Path, name: str) -> list[str]:
    """Return the names of a recording's files in a folder of results: one, or none if somebody removed it."""
    return [each for each in (f"{name}.parquet", f"{name}.csv", f"{name}.mf4") if (folder / each).is_file()]


def read_earlier(folder: Path, depends_on: Mapping[str, str]) -> Earlier:
    """Return what earlier runs left in a folder; a recording whose file is missing does not count.

    Raises:
        RecordingError: The file that holds it is damaged.
    """
    path = folder / PROCESSED_FILE
    if not path.is_file():
        return Earlier(depends_on)
    try:
        table = pq.read_table(path, use_threads=False)
        about = json.loads(table.schema.metadata[_ABOUT])
        others = [name for name in depends_on if about["depends_on"].get(name) != depends_on[name]]
        recordings = tuple(map(_processed, *(_lists(table, name) for name in ("about", "blocks", "hashes"))))
        recordings = tuple(each for each in recordings if result_files(folder, each.entry.name))
        if others:  # their friction is no evidence for that of new ones
            recordings = tuple(replace(each, evidence=()) for each in recordings)
        offsets = tuple(KnownOffset(**each) for each in about["offsets"])
        return Earlier(depends_on, recordings, offsets, " and another ".join(others))
    except (pa.ArrowException, KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(
            f"{path}: is damaged ({type(error).__name__}: {error}); remove {folder}, and everything is processed anew"
        ) from error


def write_earlier(folder: Path, earlier: Earlier) -> None:
    """Write what the next run needs; equal content makes equal bytes."""
    offsets = [asdict(each) for each in earlier.offsets]
    about = json.dumps({"depends_on": dict(earlier.depends_on), "offsets": offsets}, sort_keys=True)
    described, blocks, hashes = [], [], []
    for each in earlier.recordings:
        content: dict[str, Any] = {"entry": asdict(each.entry), "bounded": each.bounded, "evidence": []}
        content["hashes"] = {str(power): len(own) for power, own in each.hashes.items()}
        values = [np.empty(0)]
        for evidence in each.evidence:
            part, sliding = {**vars(evidence), "sliding": None}, evidence.sliding
            if sliding is not None:
                columns = {name: getattr(sliding, name) for name in _OF_BLOCKS} | sliding.columns
                count = len(sliding.direction)
                part["sliding"] = [sliding.session, sliding.prior_n, sliding.sliding_s, list(columns), count]
                values += [np.asarray(own, dtype=np.float64) for own in columns.values()]
            content["evidence"].append(part)
        described.append(json.dumps(content, sort_keys=True))
        blocks.append(np.concatenate(values))
        hashes.append(np.concatenate([np.empty(0, dtype=np.uint64), *each.hashes.values()]))
    table = pa.table({"about": pa.array(described, pa.string()), "blocks": _list(blocks), "hashes": _list(hashes)})
    (folder / PROCESSED_FILE).parent.mkdir(exist_ok=True)
    pq.write_table(table.replace_schema_metadata({_ABOUT: about}), folder / PROCESSED_FILE, compression="zstd")


def _processed(about: str, blocks: np.ndarray, hashes: np.ndarray) -> Processed:
    content = json.loads(about)
    entry, evidence = content["entry"], []
    for part in content["evidence"]:
        sliding = None
        if part["sliding"] is not None:
            session, prior_n, sliding_s, names, count = part["sliding"]
            own, blocks = np.split(blocks, [len(names) * count])
            rows = dict(zip(names, own.reshape(len(names), count), strict=True))
            label_n, direction, stroke = (rows.pop(name) for name in _OF_BLOCKS)
            sliding = SlidingBlocks(session, prior_n, sliding_s, label_n, direction, stroke.astype(np.int64), rows)
        evidence.append(OffsetEvidence(**{**part, "sliding": sliding}))
    ends = np.cumsum(list(content["hashes"].values()))[:-1]
    hashed = dict(zip(map(int, content["hashes"]), np.split(hashes, ends), strict=True))
    return Processed(
        FrictionOfRecording(**{**entry, **_tuples(entry)}),
        content["bounded"],
        hashed,
        tuple(evidence),
    )


def _tuples(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return what JSON keeps as lists and plain objects."""
    return {"repairs": tuple(entry["repairs"]), "levels": tuple(FrictionLevel(**each) for each in entry["levels"])}


def _list(arrays: Sequence[np.ndarray]) -> pa.Array:
    ends = np.cumsum([0, *map(len, arrays)])
    values = np.concatenate(arrays) if arrays else np.empty(0)
    return pa.LargeListArray.from_arrays(pa.array(ends, pa.int64()), pa.array(values))


def _lists(table: pa.Table, name: str) -> list[Any]:
    column = table[name].combine_chunks()
    if pa.types.is_string(column.type):
        return list(column.to_pylist())
    values, ends = column.values.to_numpy(), column.offsets.to_numpy()
    return [values[a:b] for a, b in pairwise(ends)]


def _digest(path: Path) -> str:
    try:
        return hash_of(path)
    except OSError:
        return ""  # reading it states why


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


def _in_words(count: int, what: str, which: str) -> str:
    files = "1 file" if count == 1 else f"{count} files"
    return f"{files} {what}" + (f": {which}" if which else "")

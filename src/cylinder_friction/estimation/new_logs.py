"""Which logs are new to a folder of results, and which results stay: known by content, not by name or date."""

from __future__ import annotations

import os
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.estimation.result_file import Result, read_result
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from cylinder_friction.recordings.reading_logs import Logs

SETTLED_S = 10.0
"""A new file that was changed less than this long ago may still be written: it is left for the next run."""
GONE, KEPT = "its file was not among the logs of the last run", "not among the logs any more, results kept"


@dataclass(frozen=True)
class Sorted:
    """Which logs are to be processed, and what becomes of the results that are there."""

    new: dict[str, Path]  # To be processed, by their paths below the root
    kept: list[Result]  # Those of logs that are gone are marked
    news: tuple[str, ...]  # One sentence on each kind of change


def read_results(folder: Path) -> list[Result]:
    """Read what the results in a folder state, in the order of their names."""
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
    """Decide which of the logs are new, and which results stay.

    A log is new if not all of its results are there, made of the same bytes under the same name with the same cylinder,
    mapping, model and code. The other logs of its session are processed again with it, for their offset and load are
    identified together. A log that is gone keeps its results.

    Args:
        logs: All logs of this run.
        digests: SHA-256 of each.
        folder: Where the results lie.
        results: What they state.
        depends_on: SHA-256 of what results depend on beside the logs.
        now_s: The time [s]; None: that of this machine's clock.
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
    gone = {name for name, digest in known.items() if name not in digests and digest not in held}
    moved = {name: held[digest] for name, digest in known.items() if name not in digests and digest in held}
    sessions = {_session(logs, name) for name in changed - early} - {""}
    mates = {name for name in same if _session(logs, name) in sessions}
    stay = (same - mates) | (early & known.keys())
    anew = (changed - early) & same_bytes
    others = sorted({key for name in anew for each in of_file[name] for key in _unlike(each, depends_on)})
    counts = Counter(name in known for name in changed - early - anew)
    news = [
        (len(anew), f"processed anew, with another {' and another '.join(others)} than before", ""),
        (counts[False] - len(set(moved.values()) - known.keys()), "new or refused until now", ""),
        (counts[True], "with new content", ""),
        (len(mates), "processed again: a log of their session is new", ""),
        (len(moved), "renamed", _some(f"{old} is {now}" for old, now in moved.items())),
        (len(early), f"changed less than {SETTLED_S:g} s ago and left for the next run", _some(early)),
        (len(gone), KEPT, _some(gone)),
        (len(stay), "as before", ""),
    ]
    kept = [each for name in stay for each in of_file[name]]
    kept += [_marked(each, depends_on) for name in gone for each in of_file[name]]
    new = {name: path for name, path in logs.files.items() if name in (changed - early) | mates}
    return Sorted(new, kept, tuple(_in_words(*each) for each in news if each[0]))


def _all_there(results: Iterable[Result], digest: str, folder: Path) -> bool:
    """Return whether these are all results of a log with this SHA-256."""
    own = list(results)
    alike = all(each.entry.source_sha256 == digest and each.is_whole(folder) for each in own)
    return bool(own) and alike and {each.of_file for each in own} == {len(own)}


def _unlike(each: Result, depends_on: Mapping[str, str]) -> list[str]:
    return [key for key in depends_on if each.depends_on.get(key) != depends_on[key]]


def _marked(each: Result, depends_on: Mapping[str, str]) -> Result:
    others = " and another ".join(_unlike(each, depends_on))
    words = GONE + (f"; it was processed with another {others}" if others else "")
    return replace(each, entry=replace(each.entry, gone=words))


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

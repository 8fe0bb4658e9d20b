"""The results that lie in a folder: which logs are new to it, and what programs read that continue from them.

Logs are compared by content, not by name or date.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.estimation.friction_of_logs import loaded_once
from cylinder_friction.estimation.results import Result, read_result
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.realtime.trained_for import OtherCylinderError
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.result_folder import ResultFolder
from cylinder_friction.recordings.storage import read_recording

if TYPE_CHECKING:
    from cylinder_friction.recordings.reading_logs import Logs

__all__ = ["OtherCylinderError"]
SUMMARY_FILE, PAGE_FILE = "summary.json", "friction.html"
WRITTEN_BY = "cylinder-friction estimate"
GONE = "its file was not among the logs of the last run"


def read_results(folder: Path) -> list[Result]:
    """Read the statements of the results in a folder, in the order of their names."""
    found = (read_result(path) for path in sorted(folder.glob("*.parquet")))
    return [each for each in found if each is not None]


def sort_logs(
    logs: Logs, digests: Mapping[str, str], folder: Path, results: Iterable[Result], depends_on: Mapping[str, str]
) -> tuple[dict[str, Path], list[Result]]:
    """Return the logs that are new, by their paths below the root, and the results to keep.

    A log is not new if all its results exist and were made from the same bytes under the same name, with the same
    cylinder, mapping, model and code. Every other log is new. All logs of its session are then processed again, because
    their offset and load are identified together. The results of a log that is gone are kept and marked.

    Args:
        logs: All logs of this run.
        digests: SHA-256 of each log.
        folder: The folder of results.
        results: The statements of its results.
        depends_on: SHA-256 of each thing besides the logs that results depend on.

    Raises:
        FileExistsError: A log of another cylinder has a result under the same name.
    """
    of_file: defaultdict[str, list[Result]] = defaultdict(list)
    for each in results:
        of_file[each.entry.source_file].append(each)
    if not of_file:
        return dict(logs.files), []
    known = {name: own[0].entry.source_sha256 for name, own in of_file.items()}
    if known.keys() & digests.keys() and not {*known.values()} & {*digests.values()}:
        _refuse_other_cylinder(folder, [of_file[name][0] for name in known.keys() & digests.keys()], depends_on)
    complete = {name for name, digest in digests.items() if _all_there(of_file.get(name, ()), digest, folder)}
    same = {name for name in complete if all(each.depends_on == depends_on for each in of_file[name])}
    new = digests.keys() - same
    sessions = {_session(logs, name) for name in new} - {""}
    new |= {name for name in same if _session(logs, name) in sessions}
    gone = {name for name, digest in known.items() if name not in digests and digest not in digests.values()}
    kept = [each for name in same - new for each in of_file[name]]
    for each in (each for name in gone for each in of_file[name]):
        unlike = [key for key in depends_on if each.depends_on.get(key) != depends_on[key]]
        words = f"; it was processed with another {' and another '.join(unlike)}" if unlike else ""
        kept.append(replace(each, entry=replace(each.entry, gone=GONE + words)))
    return {name: path for name, path in logs.files.items() if name in new}, kept


def _refuse_other_cylinder(folder: Path, replaced: Iterable[Result], depends_on: Mapping[str, str]) -> None:
    """Refuse to replace results of other logs with another cylinder: they are of a machine with the same file names."""
    for each in replaced:
        if each.depends_on.get("cylinder") != depends_on["cylinder"]:
            raise FileExistsError(
                f"{folder}: holds the friction of another {each.entry.source_file}, of another cylinder, which this "
                "run would replace; name another folder by --output, or remove this one first"
            )


def _all_there(results: Iterable[Result], digest: str, folder: Path) -> bool:
    """Check whether ``results`` are all results of a log with this SHA-256."""
    own = list(results)
    alike = all(each.entry.source_sha256 == digest and each.of_file == len(own) for each in own)
    return bool(own) and alike and all((folder / name).is_file() for each in own for name in each.beside)


def _session(logs: Logs, name: str) -> str:
    try:
        return logs.recipe.names.names(name).session
    except RecordingError:
        return ""


def kept_recordings(results: Path) -> dict[str, list[dict[str, Any]]]:
    """Read the folder's entries on its recordings, by session; empty if there is no folder.

    Each entry contains, among others, the recording's ``name``, its log's ``source_file`` and ``source_sha256``, and
    ``gone``, whether the log was missing in the latest run.
    """
    sessions = defaultdict(list)
    for each in _summary(results).get("recordings", ()):
        sessions[each["session"]].append(each)
    return dict(sessions)


def friction_of(results: Path, name: str) -> Recording:
    """Read one recording with its friction and all other columns of its Parquet file.

    Raises:
        RecordingError: The file is damaged.
        OSError: The recording does not exist.
    """
    return read_recording(results / f"{name}.parquet")


def made_with_model(results: Path) -> str:
    """Read the SHA-256 of the model that the folder's last run used; empty if it used none."""
    return str(_summary(results).get("depends_on", {}).get("model", ""))


def restore_summary(results: Path) -> str:
    """Rebuild a damaged summary from the results beside it. Return what was wrong; empty if nothing was.

    Each result contains its entry in the summary. Only the refused logs are missing until ``estimate_logs`` runs again.
    """
    target = ResultFolder(results, SUMMARY_FILE, WRITTEN_BY)
    try:
        kept_recordings(results)
        target.listed()
    except FileExistsError:
        problem = "it does not list the results of an earlier run"
    except (ValueError, TypeError, LookupError) as error:
        problem = f"{type(error).__name__}: {error}"
    else:
        return ""
    found = read_results(results)
    entries = [each.entry.to_dict() for each in found]
    about = {"recordings": entries, "depends_on": found[-1].depends_on if found else {}}
    target.claim([name for each in found for name in each.files], about)
    return problem


def stated_share(model: Path) -> float | None:
    """Return the share of the label that a saved model's bounds should contain; None if the model has no bounds."""
    bounds = loaded_once(model).bounds
    return None if bounds is None else bounds.probability


def _summary(results: Path) -> dict[str, Any]:
    path = results / SUMMARY_FILE
    return dict(read_json(path)) if path.is_file() else {}

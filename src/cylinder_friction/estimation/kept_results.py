"""Read what ``estimate_logs`` wrote, for programs that continue from its results."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

from cylinder_friction.estimation.friction_of_logs import loaded_once
from cylinder_friction.estimation.from_logs import SUMMARY_FILE, WRITTEN_BY
from cylinder_friction.estimation.result_file import LEFT_FOR_NEXT_RUN, read_results
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.realtime.bounds import bounds_count
from cylinder_friction.realtime.trained_for import OtherCylinderError
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.result_folder import ResultFolder
from cylinder_friction.recordings.storage import read_recording

__all__ = [
    "LEFT_FOR_NEXT_RUN",
    "OtherCylinderError",
    "bounds_count",
    "friction_of",
    "kept_recordings",
    "made_with_model",
    "restore_summary",
    "stated_share",
]


def kept_recordings(results: Path) -> dict[str, list[dict[str, Any]]]:
    """Read what the folder states of each recording, by session; nothing without a folder.

    Each entry holds, among others, the recording's ``name``, its log's ``source_file`` and ``source_sha256``, and
    ``gone``, whether the log was missing in the latest run.
    """
    sessions = defaultdict(list)
    for each in _summary(results).get("recordings", ()):
        sessions[each["session"]].append(each)
    return dict(sessions)


def made_with_model(results: Path) -> str:
    """Read the SHA-256 of the model with which the folder was written last; empty without a model."""
    return str(_summary(results).get("depends_on", {}).get("model", ""))


def restore_summary(results: Path) -> str:
    """Write a damaged summary anew from the results beside it. Return what was wrong with it; empty if nothing was.

    Each result states what the summary lists of it. Only the refused logs are missing, until ``estimate_logs`` runs.
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


def friction_of(results: Path, name: str) -> Recording:
    """Read one recording with its friction; the columns are those of its Parquet file.

    Raises:
        RecordingError: The file is damaged.
        OSError: There is no such recording.
    """
    return read_recording(results / f"{name}.parquet")


def stated_share(model: Path) -> float | None:
    """Return the share of the label that a saved model's bounds state they hold; None if it has no bounds."""
    bounds = loaded_once(model).bounds
    return None if bounds is None else bounds.probability


def _summary(results: Path) -> dict[str, Any]:
    path = results / SUMMARY_FILE
    return dict(read_json(path)) if path.is_file() else {}

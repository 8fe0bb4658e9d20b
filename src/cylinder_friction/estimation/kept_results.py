"""Read the results of ``estimate_logs``, for programs that continue from them."""

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
    """Read the folder's entries on its recordings, by session; empty if there is no folder.

    Each entry contains, among others, the recording's ``name``, its log's ``source_file`` and ``source_sha256``, and
    ``gone``, whether the log was missing in the latest run.
    """
    sessions = defaultdict(list)
    for each in _summary(results).get("recordings", ()):
        sessions[each["session"]].append(each)
    return dict(sessions)


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


def friction_of(results: Path, name: str) -> Recording:
    """Read one recording with its friction and all other columns of its Parquet file.

    Raises:
        RecordingError: The file is damaged.
        OSError: The recording does not exist.
    """
    return read_recording(results / f"{name}.parquet")


def stated_share(model: Path) -> float | None:
    """Return the share of the label that a saved model's bounds should contain; None if the model has no bounds."""
    bounds = loaded_once(model).bounds
    return None if bounds is None else bounds.probability


def _summary(results: Path) -> dict[str, Any]:
    path = results / SUMMARY_FILE
    return dict(read_json(path)) if path.is_file() else {}

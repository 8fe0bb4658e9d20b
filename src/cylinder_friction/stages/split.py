"""Stage ``split``: divide the sessions into training, validation, calibration and held-out test sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.files.whole_files import write_json
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.splits import split_sessions
from cylinder_friction.recordings.storage import read_metadata, recording_paths
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import LABELLED_FOLDER, SPLIT_FILE, artifacts, datasets, flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params


def run(params: Params) -> RunRecord:
    """Write the role of each recording of ``data/processed/labelled`` into ``data/processed/split.json``.

    Raises:
        RecordingError: A condition has too few sessions, a session spans two conditions, or no training recording has
            the condition ``lugre.condition``.
    """
    metadata = [read_metadata(path) for path in recording_paths(LABELLED_FOLDER)]
    roles = split_sessions(metadata, **params.split.model_dump())
    sessions = {entry.name: entry.session for entry in metadata}
    trained = {entry.condition for entry in metadata if entry.name in roles["train"]}
    if params.lugre.condition not in trained:  # refuse before hours of training, as ``lugre`` may run last
        raise RecordingError(
            f"{LABELLED_FOLDER}: no recording of condition {params.lugre.condition!r}; got conditions "
            f"{sorted(trained)}; name one of them as lugre.condition in params.yaml"
        )
    write_json(SPLIT_FILE, {role: list(names) for role, names in roles.items()})
    return RunRecord(
        name="split",
        params=flat(params.split),
        metrics={f"recordings/{role}": float(len(names)) for role, names in roles.items()}
        | {f"sessions/{role}": float(len({sessions[name] for name in names})) for role, names in roles.items()},
        artifacts=artifacts(SPLIT_FILE),
        datasets=datasets({"labelled": LABELLED_FOLDER}),
    )

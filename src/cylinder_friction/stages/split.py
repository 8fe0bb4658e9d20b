"""Stage ``split``: which sessions are for training, which for validation, and which are held out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.recordings.files import hash_of, whole_folder
from cylinder_friction.recordings.splits import split_sessions
from cylinder_friction.recordings.storage import link_recording, read_metadata, recording_paths
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import LABELLED_FOLDER, PROCESSED_FOLDERS, flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params


def run(params: Params) -> RunRecord:
    """Link the recordings of ``data/processed/labelled`` into ``data/processed/{train,validation,test}``.

    Raises:
        RecordingError: A condition has too few sessions, or a session spans two conditions.
    """
    metadata = {path: read_metadata(path) for path in recording_paths(LABELLED_FOLDER)}
    roles = split_sessions(list(metadata.values()), **params.split.model_dump())
    sessions = {entry.name: entry.session for entry in metadata.values()}
    for role, names in roles.items():
        with whole_folder(PROCESSED_FOLDERS[role]) as folder:
            for name in names:
                link_recording(LABELLED_FOLDER, name, folder)
    return RunRecord(
        name="split",
        params=flat(params.split),
        metrics={f"{role}.recordings": float(len(names)) for role, names in roles.items()}
        | {f"{role}.sessions": float(len({sessions[name] for name in names})) for role, names in roles.items()},
        datasets={role: hash_of(folder) for role, folder in PROCESSED_FOLDERS.items()},
    )

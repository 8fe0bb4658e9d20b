"""Folders of recordings in a run record: what they hold, and the hash by which they are known."""

from collections.abc import Mapping
from pathlib import Path

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.recordings.storage import columns_and_rows
from cylinder_friction.run_record import Dataset


def datasets(folders: Mapping[str, Path], *, written: bool = False) -> dict[str, Dataset]:
    """Return the datasets of a run record, by role; ``written`` where the stage made them.

    Raises:
        FileNotFoundError: A folder is not there.
    """
    return {
        role: Dataset(folder.as_posix(), hash_of(folder), *columns_and_rows(folder), written)
        for role, folder in folders.items()
    }

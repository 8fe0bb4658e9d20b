"""Recordings on disk: one Parquet file each, with the metadata inside it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_METADATA_KEY = b"cylinder_friction"


def write_recording(folder: Path, recording: Recording) -> Path:
    """Writes ``<folder>/<name>.parquet`` and returns its path. Equal recordings make equal bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    table = pa.Table.from_pandas(recording.table, preserve_index=False)
    metadata = json.dumps(recording.metadata.to_dict(), sort_keys=True).encode()
    path = folder / f"{recording.name}.parquet"
    pq.write_table(table.replace_schema_metadata({_METADATA_KEY: metadata}), path, compression="zstd")
    return path


def read_metadata(path: Path) -> RecordingMetadata:
    """Returns the metadata of one file without reading its rows.

    Raises:
        RecordingError: The file was not written by ``write_recording``.
    """
    stored = (pq.read_schema(path).metadata or {}).get(_METADATA_KEY)
    if stored is None:
        raise RecordingError(f"{path}: no recording metadata inside; expected a file that the ingest stage wrote")
    return RecordingMetadata.from_dict(json.loads(stored))


def read_recording(path: Path) -> Recording:
    """Reads one file that ``write_recording`` wrote."""
    return Recording(read_metadata(path), pd.DataFrame(pq.read_table(path).to_pandas()))


def recording_paths(folder: Path) -> list[Path]:
    """Returns the recordings of a folder, sorted by name; raises ``FileNotFoundError`` if the folder is not there."""
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder of recordings; run `dvc repro` to make it")
    return sorted(folder.glob("*.parquet"))


def iterate_recordings(folder: Path) -> Iterator[Recording]:
    """Yields the recordings of a folder one at a time, sorted by name, so that memory holds only one."""
    for path in recording_paths(folder):
        yield read_recording(path)


def read_recordings(folder: Path) -> list[Recording]:
    """Returns all recordings of a folder, sorted by name."""
    return list(iterate_recordings(folder))

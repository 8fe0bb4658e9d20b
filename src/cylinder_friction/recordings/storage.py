"""Store recordings on disk: one Parquet file each, with the metadata inside it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.files.whole_files import whole_file
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata

_METADATA_KEY = b"cylinder_friction"


def write_recording(
    folder: Path, recording: Recording, stem: str = "", beside: Mapping[str, str] | None = None
) -> Path:
    """Write ``<folder>/<stem or name>.parquet`` and return its path. Equal recordings give equal bytes.

    ``beside`` contains further texts for the file's metadata, which ``read_beside`` reads without the rows.

    Example:
        >>> from tempfile import mkdtemp
        >>> from pathlib import Path
        >>> from cylinder_friction.recordings.storage import read_stored, write_recording
        >>> folder = Path(mkdtemp())
        >>> write_recording(folder, labelled[0]).name == f"{labelled[0].name}.parquet"
        True
        >>> [len(recording) for recording in read_stored(folder)] == [len(labelled[0])]
        True
    """
    path, arrays, fields = folder / f"{stem or recording.name}.parquet", [], []
    for name, values in recording.columns.items():
        numeric = values.dtype.kind in "fiub"  # of numbers, NaN stays NaN
        arrays.append(pa.array(values, from_pandas=not numeric))
        fields.append(pa.field(name, arrays[-1].type, nullable=not numeric))
    metadata = json.dumps(recording.metadata.to_dict()).encode()
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, {_METADATA_KEY: metadata}))
    floats = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    how: dict[str, Any] = {"compression": "snappy", "use_dictionary": False, "use_byte_stream_split": floats}
    with whole_file(path) as draft, pq.ParquetWriter(draft, table.schema, **how) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata(dict(beside or {}))
    return path


def read_beside(path: Path) -> dict[str, str]:
    """Read the texts that ``write_recording`` stored in a file's metadata; none if it is not a Parquet file."""
    try:
        return {name.decode(): text.decode() for name, text in (pq.read_metadata(path).metadata or {}).items()}
    except (pa.ArrowException, UnicodeDecodeError):
        return {}


def read_metadata(path: Path) -> RecordingMetadata:
    """Read the metadata of a file without its rows; refuse a file that ``write_recording`` did not write."""
    return _metadata(path, pq.read_schema(path))


def read_recording(path: Path) -> Recording:
    """Read one file that ``write_recording`` wrote. Values are read-only."""
    with pq.ParquetFile(path) as file:
        found = file.read()
    columns = {name: values.to_numpy() for name, values in zip(found.column_names, found.columns, strict=True)}
    return Recording(_metadata(path, found.schema), columns)


def _metadata(path: Path, schema: pa.Schema) -> RecordingMetadata:
    stored = (schema.metadata or {}).get(_METADATA_KEY)
    if stored is None:
        raise RecordingError(f"{path}: no recording metadata inside; expected a file that the ingest stage wrote")
    return RecordingMetadata.from_dict(json.loads(stored))


def recording_paths(folder: Path) -> list[Path]:
    """List the recordings of a folder, sorted by name; raise ``FileNotFoundError`` if the folder does not exist."""
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder.absolute()}: no such folder of recordings; run `dvc repro` to make it")
    return sorted(folder.glob("*.parquet"))


def read_stored(folder: Path) -> list[Recording]:
    """Read all recordings of a folder, sorted by name."""
    return [read_recording(path) for path in recording_paths(folder)]

"""Results as channels of an MDF 4 file: beside all that the measurement file holds, or beside what was measured."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pandas as pd

from cylinder_friction.files.whole_files import whole_file
from cylinder_friction.recordings.columns import QUANTITIES, TIME
from cylinder_friction.recordings.formats.format import guarded
from cylinder_friction.recordings.formats.mdf import FORMAT, opened_mdf
from cylinder_friction.recordings.formats.source import open_source
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

GROUP = "cylinder-friction"
VERSION = "4.10"
_UNITS = {"_m_s2": "m/s²", "_m_s": "m/s", "_pa": "Pa", "_m": "m", "_n": "N", "_c": "°C"}


def write_mdf(path: Path, recording: Recording, original: Path) -> Path:
    """Write a recording as MDF 4 and return the path. Equal input makes equal bytes.

    Args:
        path: Of the new file.
        recording: What is added, or written.
        original: The log. If it is a measurement file the new one holds all of it, and beside it what was added to the
            recording; otherwise it holds the recording's columns. It is not changed.

    Raises:
        RecordingError: The library that writes it is missing, or cannot copy the original.
    """
    FORMAT.refuse_missing_library()
    with guarded("an MDF file"), _begun(original, recording) as (file, columns):
        from asammdf import Signal

        seconds = recording.column(TIME)
        unit = {name: next((unit for end, unit in _UNITS.items() if name.endswith(end)), "") for name in columns}
        signals = [Signal(recording.columns[name], seconds, unit[name], name) for name in columns]
        about = json.dumps(recording.metadata.to_dict(), sort_keys=True)
        file.append(signals, acq_name=GROUP, comment=about, common_timebase=True)
        try:
            with whole_file(path) as draft, draft.open("wb+") as stream:
                file.save(stream, overwrite=True, compression=1, add_history_block=False)
        except OSError as error:
            failed = error
        else:
            return path
    raise failed


@contextmanager
def _begun(original: Path, recording: Recording) -> Iterator[tuple[Any, list[str]]]:
    """Open what is written into, and yield it with the columns that are to be added."""
    from asammdf import MDF
    from asammdf.blocks.v4_blocks import FileHistory

    columns = [str(name) for name in recording.columns if name != TIME]
    source = open_source(original)
    if source.head.startswith(FORMAT.starts):
        with opened_mdf(source) as read:
            if read.version < "4":
                read = read.convert(VERSION)
                read.file_history.clear()  # it states the time of the conversion
            yield _with_history(read, FileHistory()), [name for name in columns if name not in QUANTITIES]
        return
    with MDF(version=VERSION) as made:
        made.start_time = _clock_zero(recording.metadata, float(recording.table[TIME].iloc[0]))
        yield _with_history(made, FileHistory()), columns


def _with_history(file: Any, entry: Any) -> Any:
    """Add an entry to a file's history; its time is that of the measurement, so that equal input makes equal bytes."""
    entry.time_stamp = file.start_time
    tool = "".join(f"<tool_{name}>{GROUP}</tool_{name}>" for name in ("id", "vendor", "version"))
    entry.comment = f"<FHcomment><TX>friction added</TX>{tool}</FHcomment>"
    file.file_history.append(entry)
    return file


def _clock_zero(about: RecordingMetadata, first_s: float) -> datetime:
    """Return when the clock was at 0 s. MDF has no unknown time: then it is 1970, and the comment holds no start."""
    if "T" not in about.start:
        return datetime(1970, 1, 1, tzinfo=UTC)
    return pd.Timestamp(about.start).to_pydatetime() - timedelta(seconds=first_s)

"""The history: estimates of the journal as Parquet files, in a folder per session and UTC day.

pyarrow is imported late: after a kill, samples wait for the service to start, and the start writes nothing.
"""

from __future__ import annotations

import logging
import math
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import EstimateBlock
from cylinder_friction_live.journal import Chunk, Journal

if TYPE_CHECKING:
    import pyarrow as pa

DAY_S = 86400.0

LATE_FOLDER = "late"
_log = logging.getLogger(__name__)
_NEWTONS = ("friction_n", "lower_n", "upper_n")


def move_into_history(journal: Journal, within_s: float = math.inf) -> list[Path]:
    """Write the chunks of the journal into Parquet and remove them from the journal; return the files.

    Sessions that are not begun ``within_s`` stay in the journal.

    A kill in between loses and duplicates nothing: a file is named by session, day and first index, and chunks that are
    still in the journal are written again as the same file.

    Columns: ``index``, ``time_s`` (the sender's clock, Unix), the model's inputs, ``friction_n``, ``lower_n``,
    ``upper_n``, ``flags``. The model's SHA-256 is in the file's metadata. Samples that came too late to be stepped are,
    without estimates, in a folder ``late`` beside the session's days.
    """
    last, deadline_s = journal.last_chunk(), time.monotonic() + within_s
    waiting, paths = journal.with_chunks(last), list[Path]()
    failed = []
    while waiting and time.monotonic() < deadline_s:
        name = waiting.pop(0)
        try:
            paths += write_session(journal, name, last)
        except Exception as error:
            _log.error("session %s stays in the journal, not in the history: %r", name, error)
            failed.append(name)
    journal.forget(last, but=waiting + failed)
    return paths


def write_session(journal: Journal, name: str, last: int) -> list[Path]:
    """Write the chunks of one session, up to a chunk's number, into Parquet, and leave them in the journal."""
    files: defaultdict[tuple[bool, str, str | None, tuple[str, ...]], list[Chunk]] = defaultdict(list)
    for chunk in journal.chunks(name, last):
        files[chunk.estimates is None, _day_of(chunk.time_s), chunk.model, chunk.inputs].append(chunk)
    paths = list[Path]()
    for (is_late, day, _, _), chunks in files.items():
        days = journal.history / quote(name, safe="") / (LATE_FOLDER if is_late else "")
        paths.append(days / day / f"{chunks[0].index:016d}.parquet")
        write_whole(table_of(chunks), paths[-1])
    return paths


def last_rows(
    folder: Path, name: str, inputs: Sequence[str], rows: int, before: int | None = None
) -> tuple[EstimateBlock, Array] | None:
    """Read the newest estimates of a session's history with their samples: at most ``rows``, none missing between.

    They come from the last two files, before the sample of index ``before``; None if these have none with these inputs.
    """
    import pyarrow.parquet as pq

    paths = sorted((folder / quote(name, safe="")).glob("????-??-??/*.parquet"))[-2:]
    columns = ["index", "time_s", *inputs, *_NEWTONS, "flags"]
    tables = []
    for path in paths:
        with pq.ParquetFile(path) as file:  # ``read_table`` would import pandas
            if set(columns) <= set(file.schema_arrow.names):
                tables.append(file.read(columns).replace_schema_metadata(file.schema_arrow.metadata))
    if not tables:
        return None
    model = (tables[-1].schema.metadata or {}).get(b"model", b"").decode()
    values = {each: np.concatenate([table[each].to_numpy() for table in tables]) for each in columns}
    if before is not None:
        values = {each: column[values["index"] < before] for each, column in values.items()}
    if not len(values["index"]):
        return None
    breaks = np.flatnonzero(np.diff(values["index"]) != 1) + 1
    first = max(len(values["index"]) - rows, breaks[-1] if len(breaks) else 0)
    newtons, samples = (np.column_stack([values[each][first:] for each in some]) for some in (_NEWTONS, inputs))
    index, time_s = int(values["index"][first]), float(values["time_s"][first])
    return replace(EstimateBlock.of(0, index, time_s, newtons, values["flags"][first:]), model=model), samples


def next_index_of(folder: Path, name: str) -> int | None:
    """Find the index behind the newest readable row of a session's history; None if it has none."""
    paths = (folder / quote(name, safe="")).glob("????-??-??/*.parquet")
    for path in sorted(paths, key=lambda each: each.stem, reverse=True):
        with suppress(OSError, ValueError):  # a damaged file
            return _last_index(path) + 1
    return None


def _last_index(path: Path) -> int:
    import pyarrow.parquet as pq

    described = pq.read_metadata(path)
    return int(described.row_group(described.num_row_groups - 1).column(0).statistics.max)


def _day_of(time_s: float) -> str:
    """Name the UTC day of a time."""
    return str(np.datetime64(int(time_s // DAY_S), "D"))


def write_whole(table: pa.Table, path: Path) -> None:
    """Write a file that appears whole or not at all."""
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".draft")
    pq.write_table(table, draft, use_dictionary=["flags"])  # a dictionary of measured numbers only costs time
    draft.replace(path)


def table_of(chunks: Sequence[Chunk]) -> pa.Table:
    """Join chunks of one session, made by one model, in one table."""
    import pyarrow as pa

    within = [np.arange(len(chunk.samples)) for chunk in chunks]
    pairs = list(zip(chunks, within, strict=True))
    columns = {
        "index": np.concatenate([chunk.index + each for chunk, each in pairs]),
        "time_s": np.concatenate([chunk.time_s + chunk.sample_time_s * each for chunk, each in pairs]),
    }
    samples = np.concatenate([each.samples for each in chunks])
    columns |= {name: samples[:, place] for place, name in enumerate(chunks[0].inputs)}
    columns |= _estimates([each.estimates for each in chunks])
    table = pa.table({name: _column(values) for name, values in columns.items()})
    return table.replace_schema_metadata({"model": chunks[0].model} if chunks[0].model else {})


def _column(values: np.ndarray) -> pa.Array:
    """Convert values like ``pa.array``, which would import pandas and delay estimates by a quarter of a second."""
    import pyarrow as pa

    content = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, content])


def _estimates(parts: Iterable[EstimateBlock | None]) -> dict[str, np.ndarray]:
    given = [part for part in parts if part is not None]
    if not given:
        return {}
    newtons = np.concatenate([each.newtons for each in given])
    columns = {name: newtons[:, place] for place, name in enumerate(_NEWTONS)}
    return columns | {"flags": np.concatenate([each.flags for each in given])}


def join_past_days(folder: Path) -> list[Path]:
    """Join the files of each day of every session, except its newest day; return the joined files.

    A kill in between loses and duplicates nothing: the joined file replaces the first of its parts, and the other parts
    are removed the next time.
    """
    days: defaultdict[Path, list[Path]] = defaultdict(list)
    for day in sorted(path for path in folder.glob("**/????-??-??") if path.is_dir()):
        days[day.parent].append(day)
    return [path for of_session in days.values() for day in of_session[:-1] for path in _joined_day(day)]


def _joined_day(day: Path) -> list[Path]:
    import pyarrow.parquet as pq

    runs: list[list[Path]] = []
    last_index = -1
    for path in sorted(day.glob("*.parquet")):
        if int(path.stem) <= last_index:
            path.unlink()  # part of a joined file
            continue
        last_index = _last_index(path)
        if runs and pq.read_schema(runs[-1][0]).equals(pq.read_schema(path), check_metadata=True):
            runs[-1].append(path)
        else:
            runs.append([path])
    return [_join(run) for run in runs if len(run) > 1]


def _join(parts: Sequence[Path]) -> Path:
    import pyarrow.parquet as pq

    draft = parts[0].with_suffix(".draft")
    with pq.ParquetWriter(draft, pq.read_schema(parts[0])) as writer:
        for part in parts:
            with pq.ParquetFile(part) as file:  # ``read_table`` would import pandas
                writer.write_table(file.read())
    draft.replace(parts[0])
    for part in parts[1:]:
        part.unlink()
    return parts[0]

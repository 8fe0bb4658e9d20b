"""The journal's estimates as Parquet: a folder per session, a file per UTC day and stretch, whole files only."""

from pathlib import Path
from urllib.parse import quote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cylinder_friction.live.journal import Chunk, Journal

DAY_S = 86400.0


def move_into_history(journal: Journal, folder: Path, left: int = 0) -> list[Path]:
    """Write the chunks of the journal into Parquet and drop them there; return the files.

    The newest ``left`` chunks of all stay, for clients that come back and have not read their estimates.

    A kill in between loses nothing and doubles nothing: a file is named by session, day and first index, and what was
    not dropped yet is written again as the same file.

    Columns: ``index``, ``time_s`` (the sender's clock, Unix), the model's inputs, ``friction_n``, ``lower_n``,
    ``upper_n``, ``flags``.
    """
    written = []
    last = journal.last_chunk() - left
    for name in journal.with_chunks(last):
        by_day: dict[int, list[Chunk]] = {}
        for chunk in journal.chunks(name, last):
            by_day.setdefault(int(chunk.time_s // DAY_S), []).append(chunk)
        for day, chunks in by_day.items():
            date = np.datetime64(day, "D")
            path = folder / quote(name, safe="") / f"{date}" / f"{chunks[0].index:016d}.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            draft = path.with_suffix(".draft")
            pq.write_table(table_of(chunks), draft)
            draft.replace(path)
            written.append(path)
        journal.forget(name, last)
    return written


def table_of(chunks: list[Chunk]) -> pa.Table:
    """Return chunks of one session as one table."""
    rows = [len(chunk.flags) for chunk in chunks]
    within = [np.arange(count) for count in rows]
    columns = {
        "index": np.concatenate([chunk.index + each for chunk, each in zip(chunks, within, strict=True)]),
        "time_s": np.concatenate(
            [chunk.time_s + chunk.sample_time_s * each for chunk, each in zip(chunks, within, strict=True)]
        ),
    }
    samples, newtons = np.concatenate([each.samples for each in chunks]), np.concatenate([c.newtons for c in chunks])
    columns |= {name: samples[:, place] for place, name in enumerate(chunks[0].inputs)}
    columns |= {name: newtons[:, place] for place, name in enumerate(("friction_n", "lower_n", "upper_n"))}
    columns["flags"] = np.concatenate([chunk.flags for chunk in chunks])
    return pa.table({name: pa.array(np.ascontiguousarray(values)) for name, values in columns.items()})

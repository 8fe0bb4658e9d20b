"""Read TDMS files (LabVIEW, DIAdem) with npTDMS."""

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.channels import Channel, numeric, table_of, unit_among
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable
from cylinder_friction.recordings.mapping.guessing import facts_of, time_score
from cylinder_friction.recordings.recording import Start

FIRST_ROWS = 256  # Number of first rows that decide whether a channel is a clock


def read_tdms(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Read a table per group, length and rate; waveforms get a channel ``time`` since the file's first start."""
    import nptdms

    with source.opened() as opened, nptdms.TdmsFile.open(opened) as file:
        starts = [_start(channel) for group in file.groups() for channel in group.channels()]
        first = min((start for start in starts if start is not None), default=None)
        tables = [table for group in file.groups() for table in _tables(group, wanted, first)]
        cut_off = file.file_status is not None and file.file_status.incomplete_final_segment
    lost = ("the file ends within its last segment, and the samples behind are lost",) if cut_off else ()
    start = None if first is None else Start(first, utc=True, source="wf_start_time")
    return [replace(table, notes=(*table.notes, *lost), start=start, utc=True) for table in tables]


def _tables(group: Any, wanted: Collection[str] | None, first: np.datetime64 | None) -> list[LoggedTable]:
    named = [(channel.name.strip(), channel) for channel in group.channels()]
    valid = [(name, channel) for name, channel in named if len(channel) and channel.dtype.kind in "biufMOU"]
    others = [name for name, channel in named if not len(channel) or channel.dtype.kind not in "biufMOU"]
    # A logged clock of any name takes precedence over the clock that waveform properties define.
    begins = [
        LoggedTable(pd.DataFrame({name: channel[:FIRST_ROWS]}), {name: unit_among(channel.properties)})
        for name, channel in valid
    ]
    timed = any(time_score(each, clock_given=True) > 0.0 for each in facts_of(begins))
    alike: dict[tuple[int, float | None, float], list[Channel]] = {}
    for name, channel in valid:
        step, offset = (None, 0.0) if timed else _clock(channel, first)
        entry = Channel(name, len(channel), partial(_values, channel), unit_among(channel.properties))
        alike.setdefault((len(channel), step, offset), []).append(entry)
    return [
        table_of(channels, wanted, group.name, step, offset, others=() if number else others)
        for number, ((_, step, offset), channels) in enumerate(alike.items())
    ]


def _clock(channel: Any, first: np.datetime64 | None) -> tuple[float | None, float]:
    """Read a waveform's sample time and the time of its first sample [s]; None and 0.0 for other channels."""
    step = channel.properties.get("wf_increment")
    if not isinstance(step, int | float) or not 0.0 < step < float("inf"):
        return None, 0.0
    start = _start(channel)
    later = 0.0 if start is None or first is None else float((start - first) / np.timedelta64(1, "ns")) * 1e-9
    return float(step), float(channel.properties.get("wf_start_offset", 0.0)) + later


def _start(channel: Any) -> np.datetime64 | None:
    start = channel.properties.get("wf_start_time")
    return start.astype("datetime64[ns]") if isinstance(start, np.datetime64) and not np.isnat(start) else None


def _values(channel: Any) -> NDArray[Any]:
    values: NDArray[Any] = np.asarray(channel[:])
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]")
    return values.astype(object) if values.dtype.kind in "OU" else numeric(values)


FORMAT = Format("tdms", "a TDMS file", read_tdms, starts=(b"TDSm",), library="nptdms", crashes="the TDMS library")

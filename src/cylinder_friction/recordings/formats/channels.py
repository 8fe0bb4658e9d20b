"""Channels of a binary file, found one by one, are put together to tables by their length."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.format import LoggedTable, named_columns
from cylinder_friction.recordings.mapping.channel_words import words_of
from cylinder_friction.recordings.recording import RecordingError


@dataclass(frozen=True)
class Channel:
    """One channel, by its path within the file, that is read when it is asked for: values of shape ``(length,)``.

    ``sample_time_s`` is what the file states in place of a time channel [s].
    """

    name: str
    length: int
    read: Callable[[], NDArray[Any]]
    unit: str = ""
    sample_time_s: float | None = None


@dataclass
class Found:
    """What a walk through a file comes upon: channels, and names of what is none (single values, text, objects)."""

    channels: list[Channel] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


def column_arrays(name: str, shape: tuple[int, ...]) -> list[tuple[str, int, Any]]:
    """List the channels that an array of this shape holds: name, length, and index of the channel's values in it.

    A vector, standing or lying, is one channel. A matrix is one per column, name_1, name_2, ...; its longer side is
    time. What has fewer than two values or more than two axes is none.
    """
    if len(shape) == 1 or (len(shape) == 2 and 1 in shape):
        return [(name, max(shape), ())] if max(shape) > 1 else []
    if len(shape) != 2 or 0 in shape:
        return []
    every, across = slice(None), shape[0] >= shape[1]
    return [
        (f"{name}_{index + 1}", max(shape), (every, index) if across else (index, every)) for index in range(min(shape))
    ]


def tables_by_length(found: Found, wanted: Collection[str] | None, separator: str) -> list[LoggedTable]:
    """Make one table of all channels of a length (and of a stated sample time), in the order of the file.

    If there are several, a table is named by the group its channels share, otherwise by its length.
    """
    if not found.channels and wanted is not None and found.others:
        return [LoggedTable(pd.DataFrame(), unread=tuple(found.others))]
    if not found.channels:
        got = f"; got {', '.join(found.others[:20])}" if found.others else ""
        raise RecordingError(
            f"holds no channels{got}; expected vectors of numbers (save MATLAB's timeseries and table objects as "
            "plain arrays)"
        )
    timed = {each.length for each in found.channels if words_of(each.name.rsplit(separator, 1)[-1]).quantity == "time"}
    groups: dict[tuple[int, float | None], list[Channel]] = {}
    for channel in found.channels:
        step = None if channel.length in timed else channel.sample_time_s
        groups.setdefault((channel.length, step), []).append(channel)
    tables: list[LoggedTable] = []
    for (length, sample_time_s), channels in groups.items():
        shared = {channel.name.rpartition(separator)[0] for channel in channels}
        name = "" if len(groups) == 1 else (len(shared) == 1 and shared.pop()) or f"{length} rows"
        tables.append(table_of(channels, wanted, name, sample_time_s, () if tables else found.others))
    return tables


def table_of(
    channels: Sequence[Channel],
    wanted: Collection[str] | None,
    name: str,
    sample_time_s: float | None = None,
    others: Sequence[str] = (),
) -> LoggedTable:
    """Read channels of one length as a table, with a channel ``time`` [s] first if a sample time is given.

    What is named time is loaded beside what is wanted, for it must not contradict.
    """
    if sample_time_s is not None:
        length, step = channels[0].length, sample_time_s
        channels = [Channel("time", length, lambda: np.arange(length) * step, "s"), *channels]
    asked = [channel for channel in channels if wanted is None or channel.name in wanted]
    loaded = [each for each in channels if each in asked or (asked and words_of(each.name).quantity == "time")]
    unread = [channel.name for channel in channels if channel not in loaded]
    table = named_columns([(channel.name, channel.read()) for channel in loaded])
    units = {channel.name: channel.unit for channel in channels if channel.unit}
    return LoggedTable(table, units, name, (*unread, *others))


def numeric(values: NDArray[Any]) -> NDArray[Any]:
    """Give numbers the machine's own byte order; true and false become 1 and 0, half precision single."""
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    if values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
        return values.astype(np.float32 if values.dtype.itemsize == 2 else np.float64)
    return values.astype(values.dtype.newbyteorder("="), copy=False)

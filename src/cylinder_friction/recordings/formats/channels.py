"""Combine the channels of a binary file into tables of equal length."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.cells import names_to_read
from cylinder_friction.recordings.formats.format import LoggedTable, named_columns
from cylinder_friction.recordings.mapping.channel_words import words_of
from cylinder_friction.recordings.recording import RecordingError


@dataclass(frozen=True)
class Channel:
    """One channel of a file, named by its path in it. ``read`` loads its values, shape ``(length,)``."""

    name: str
    length: int
    read: Callable[[], NDArray[Any]]
    unit: str = ""
    sample_time_s: float | None = None  # That the file states instead of a time channel [s]
    begin: str = "0"  # When it begins, as the file states it


@dataclass
class Found:
    """Channels found in a file, and names of its other contents (single values, text, objects)."""

    channels: list[Channel] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


_FACTORS = ("scale_factor", "scale", "factor", "gain", "lsb", "slope", "add_offset", "offset", "intercept")
"""Properties that state how numbers become values, in lower case; whether the numbers are values is not known."""


_STARTS = ("t0", "start", "start_time", "starttime", "wf_start_offset", "wf_start_time")


def stated_start(properties: Mapping[str, Any]) -> str:
    """Read when a channel begins among its properties; 0 without one."""
    stated = (
        str(value).strip("[]").removesuffix(".0") for key, value in properties.items() if key.casefold() in _STARTS
    )
    return next(stated, "0")


def factors_among(properties: Mapping[str, Any]) -> str:
    """List the factors and offsets that the properties of a channel state, as a part of its unit."""
    stated = [(key, str(value).strip("b'[] ")) for key, value in properties.items() if key.casefold() in _FACTORS]
    numbers = [(key, text) for key, text in stated if re.fullmatch(r"[-+]?\d*\.?\d*(?:e[-+]?\d+)?", text) and text]
    return "".join(f" with {key} {text}" for key, text in numbers if float(text) not in (0.0, 1.0))


def unit_among(properties: Mapping[str, Any]) -> str:
    """Read the unit that the properties of a channel state, with its factors; empty if they state none."""
    stated = (properties.get(key) for key in ("unit", "units", "Unit", "Units", "unit_string"))
    texts = (each.decode(errors="replace") if isinstance(each, bytes) else each for each in stated)
    unit = next((text.strip() for text in texts if isinstance(text, str) and text), "")
    return f"{unit}{factors_among(properties)}".strip()


def channels_of(name: str, values: Any, unit: str = "") -> list[Channel]:
    """List the channels of an array or dataset: itself, or name_1, name_2, ... of a matrix along its longer side."""
    shape: tuple[int, ...] = values.shape
    if max(shape, default=0) < 2 or 0 in shape or len(shape) > 2:
        return []
    places: dict[str, Any] = {name: ()}
    if len(shape) == 2 and 1 not in shape:
        every, across = slice(None), shape[0] >= shape[1]
        places = {f"{name}_{at + 1}": (every, at) if across else (at, every) for at in range(min(shape))}
    return [Channel(own, max(shape), partial(flat, values, at), unit) for own, at in places.items()]


def flat(values: Any, at: Any = ()) -> NDArray[Any]:
    """Load the numbers at a place of an array or a dataset, shape ``(n,)``."""
    return np.ascontiguousarray(numeric(values[at].reshape(-1)))


def tables_by_length(found: Found, wanted: Collection[str] | None, separator: str) -> list[LoggedTable]:
    """Make a table of the channels of one length and stated sample time, named by group or length."""
    if not found.channels and wanted is not None and found.others:
        return [LoggedTable(pd.DataFrame(), unread=tuple(found.others))]
    if not found.channels:
        got = f"; got {', '.join(found.others[:20])}" if found.others else ""
        raise RecordingError(
            f"holds no channels{got}; expected vectors of numbers (save MATLAB's timeseries and tables as arrays)"
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
        tables.append(table_of(channels, wanted, name, sample_time_s, others=() if tables else found.others))
    begin = {each.begin: each.name for each in found.channels if each.sample_time_s and each.length not in timed}
    if len(begin) > 1:
        (one, first), (other, second) = list(begin.items())[:2]
        raise RecordingError(
            f"its channels begin at different times: {first!r} at {one}, {second!r} at {other}; expected one; write a "
            "time channel for each, or cut them to a common start"
        )
    lasts_s = {length * step: step for length, step in groups if step is not None}
    if lasts_s and max(lasts_s) - min(lasts_s) > 1.5 * max(lasts_s.values()):
        together = "its channels last differently, and are taken to begin together, because no start is stated"
        tables = [replace(table, notes=(*table.notes, together)) for table in tables]
    return tables


def table_of(
    channels: Sequence[Channel],
    wanted: Collection[str] | None,
    name: str,
    sample_time_s: float | None = None,
    start_s: float = 0.0,
    others: Sequence[str] = (),
) -> LoggedTable:
    """Read channels of one length as a table, with a channel ``time`` [s] first if a sample time is given."""
    if sample_time_s is not None:
        length, step = channels[0].length, sample_time_s
        channels = [Channel("time", length, lambda: start_s + np.arange(length) * step, "s"), *channels]
    read = names_to_read([channel.name for channel in channels], wanted)
    unread = [channel.name for channel in channels if channel.name not in read]
    table = named_columns([(channel.name, channel.read()) for channel in channels if channel.name in read])
    units = {channel.name: channel.unit for channel in channels if channel.unit}
    return LoggedTable(table, units, name, (*unread, *others))


def numeric(values: NDArray[Any]) -> NDArray[Any]:
    """Convert to the machine's byte order, booleans to 1 and 0, and half to single precision."""
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    if values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
        return values.astype(np.float32 if values.dtype.itemsize == 2 else np.float64)
    return values.astype(values.dtype.newbyteorder("="), copy=False)

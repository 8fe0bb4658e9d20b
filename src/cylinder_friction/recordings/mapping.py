"""From a logger's channels to a recording's columns, and from a file's path to who and when."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cylinder_friction.recordings.recording import REQUIRED_COLUMNS, RecordingError
from cylinder_friction.recordings.units import QUANTITIES, check_unit, to_si

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


@dataclass(frozen=True)
class ChannelMapping:
    """Where one column of a recording comes from.

    Attributes:
        channel: The logger's name of the channel.
        unit: What the logger writes it in, one of ``units.UNITS``.
        sign: -1 where the sensor is mounted backwards, so that extension is positive and pressure is gauge pressure.
    """

    channel: str
    unit: str
    sign: int = 1


@dataclass(frozen=True)
class PathNames:
    """What a file's path says: the recording's name, test, session and load."""

    name: str
    test: str
    session: str
    load: str


def check_mapping(mapping: Mapping[str, ChannelMapping]) -> None:
    """Refuses a mapping that could not make a recording of any file.

    Raises:
        RecordingError: A column is unknown or a required one is not mapped, a unit or a sign is wrong, or one
            channel is to fill two columns.
    """
    for column in mapping:
        if column not in QUANTITIES:
            raise RecordingError(f"column {column!r} is not known; expected some of {', '.join(QUANTITIES)}")
    missing = [column for column in REQUIRED_COLUMNS if column not in mapping]
    if missing:
        raise RecordingError(f"column {missing[0]!r} has no channel; name the logger's channel that holds it")
    users: dict[str, str] = {}
    for column, source in mapping.items():
        check_unit(column, source.unit)
        if source.sign not in (1, -1):
            raise RecordingError(f"column {column!r}: sign must be 1 or -1, but got {source.sign!r}")
        if source.channel in users:
            raise RecordingError(
                f"channel {source.channel!r} is to fill both {users[source.channel]!r} and {column!r}; "
                "expected one column a channel"
            )
        users[source.channel] = column


def apply_mapping(channels: pd.DataFrame, mapping: Mapping[str, ChannelMapping]) -> pd.DataFrame:
    """Returns a recording's columns, in SI units, from the logger's channels; channels not mapped are left out.

    Raises:
        RecordingError: A channel is missing or occurs twice, or holds something that is not a number.
    """
    return pd.DataFrame({column: _column(channels, column, source) for column, source in mapping.items()})


def _column(channels: pd.DataFrame, column: str, source: ChannelMapping) -> NDArray[np.float64]:
    found = int((channels.columns == source.channel).sum())
    if found != 1:
        problem = "is missing" if found == 0 else f"occurs {found} times"
        raise RecordingError(
            f"channel {source.channel!r} (for {column!r}) {problem}; got channels "
            f"{', '.join(map(repr, channels.columns))}; correct the file or ingest.channels.{column}.channel"
        )
    raw = channels[source.channel]
    numbers = pd.to_numeric(raw, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    text = np.isnan(numbers) & raw.notna().to_numpy()
    if text.any() and not pd.api.types.is_numeric_dtype(raw):
        row = int(np.flatnonzero(text)[0])
        raise RecordingError(
            f"channel {source.channel!r} (for {column!r}) holds {raw.iloc[row]!r} in row {row + 1} "
            f"({int(text.sum())} such rows in all); expected numbers in {source.unit}"
        )
    return source.sign * to_si(numbers, source.unit)


def compile_name_pattern(pattern: str) -> re.Pattern[str]:
    """Returns the compiled pattern of file paths.

    Raises:
        RecordingError: It is not a regular expression, or lacks one of the named groups ``test`` and ``session``.
    """
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise RecordingError(f"name pattern {pattern!r} is not a regular expression: {error}") from None
    for group in ("test", "session"):
        if group not in compiled.groupindex:
            raise RecordingError(
                f"name pattern {pattern!r} has no group {group!r}; write (?P<{group}>...) around the part of the "
                f"path that names the {group}"
            )
    return compiled


def names_from_path(path: str, pattern: re.Pattern[str]) -> PathNames:
    """Returns what a path, relative to the ingested folder and with ``/``, says about its recording.

    The pattern is searched for anywhere in the path. The recording's name is the path without its last suffix,
    with ``-`` for ``/``.

    Raises:
        RecordingError: The pattern is not found, or finds an empty test or session.
    """
    match = pattern.search(path)
    groups = match.groupdict() if match else {}
    if not groups.get("test") or not groups.get("session"):
        raise RecordingError(
            f"path {path!r} does not tell test and session: the pattern {pattern.pattern!r} finds "
            f"{'nothing in it' if match is None else groups}; rename the file or change ingest.name_pattern"
        )
    stem = path.rsplit(".", 1)[0] if "." in path.rsplit("/", 1)[-1] else path
    return PathNames(stem.replace("/", "-"), groups["test"], groups["session"], groups.get("load") or "")

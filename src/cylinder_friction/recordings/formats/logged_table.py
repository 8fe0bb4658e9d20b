"""What a logger's file holds, before it is given a meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from numpy.typing import NDArray


@dataclass(frozen=True)
class LoggedTable:
    """Channels of a file that share their rows, as the logger names them, in its units."""

    # One column per channel: numbers, time stamps (``datetime64[ns]``), or text where a cell is no number. A missing
    # value is NaN. Names are stripped of blanks; a name may occur twice.
    channels: pd.DataFrame
    # The unit that the file itself states, by channel; a channel without one is absent
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = ""  # Of the table or group within the file; empty where the file has only one
    unread: tuple[str, ...] = ()  # Names of channels that were there but not asked for
    notes: tuple[str, ...] = ()  # What the reader repaired, one sentence each, for example a last line that was cut off


def named_columns(columns: Sequence[tuple[str, NDArray[Any]]], kind: Any = None) -> pd.DataFrame:
    """Return columns as a table, not copied; a name may occur twice, and is of ``kind`` object if it may be damaged."""
    table = pd.DataFrame(dict(enumerate(values for _, values in columns)), copy=False)
    table.columns = pd.Index([name for name, _ in columns], dtype=kind)
    return table

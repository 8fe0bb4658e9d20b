"""What the numbers of a clock count from: 1970, Excel's 1899, LabVIEW's 1904, Windows' 1601, .NET's year 1."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

EARLIEST_S = 946_684_800
"""A log is not older than the year 2000 [s since 1970]."""
LONGEST_STEP_S = 60.0
"""Rows of a log are not further from each other than this [s]."""
NEVER_FALLS = 0.99
"""A clock falls in fewer of its steps than the rest of this share."""


@dataclass(frozen=True)
class Epoch:
    """A way to write a date as one number."""

    unit: str  # In which it counts, as ``units`` spells it
    unit_ns: int  # One unit [ns]
    of_1970: int  # What it writes for the first moment of 1970
    since: str  # What it counts from, for messages
    utc: bool  # Whether it is in UTC; otherwise it is what a clock on a wall shows

    @property
    def counted(self) -> str:
        """What it counts, in words."""
        return {"100ns": "ticks of 100 ns", "d": "days"}.get(self.unit, self.unit)

    def holds(self, number: float, latest_s: float) -> bool:
        """Return whether a number is a date between 2000 and ``latest_s`` [s since 1970]."""
        return EARLIEST_S < (number - self.of_1970) * self.unit_ns * 1e-9 < latest_s

    def stamps(self, numbers: NDArray[Any]) -> NDArray[np.datetime64]:
        """Return numbers as ``datetime64[ns]``; NaN as NaT."""
        stamps = np.full(len(numbers), np.datetime64("NaT"), dtype="datetime64[ns]")
        known = np.isfinite(numbers)
        whole = np.floor(numbers[known]).astype(np.int64)  # apart, for a float cannot hold all digits of nanoseconds
        parts = np.rint((numbers[known] - whole) * self.unit_ns).astype(np.int64)
        stamps[known] = ((whole - self.of_1970) * self.unit_ns + parts).astype("datetime64[ns]")
        return stamps


DAY_NS = 86_400 * 10**9
FILETIME = Epoch("100ns", 100, 116_444_736_000_000_000, "1601 (FILETIME)", True)
SECONDS_SINCE_1970 = Epoch("s", 10**9, 0, "1970", True)
EPOCHS = (
    FILETIME,
    Epoch("100ns", 100, 621_355_968_000_000_000, "the year 1 (.NET)", False),
    Epoch("d", DAY_NS, 25_569, "30 December 1899 (Excel)", False),
    Epoch("d", DAY_NS, 719_529, "the year 0 (MATLAB)", False),
    Epoch("s", 10**9, 2_082_844_800, "1904 (LabVIEW)", True),
    SECONDS_SINCE_1970,
    *(Epoch(unit, size, 0, "1970", True) for unit, size in (("ms", 10**6), ("us", 10**3), ("ns", 1))),
)
"""No number is a date since 2000 of two of these."""
WINCC = Epoch("millionths of a day", DAY_NS // 10**6, 25_569 * 10**6, "30 December 1899 (WinCC)", False)


def is_future(moment: np.datetime64) -> bool:
    """Return whether a moment is later than tomorrow: then it is none at which a log was made."""
    return bool(moment > np.datetime64(int(_tomorrow_s()), "s"))


def epoch_of(numbers: NDArray[Any], name: str = "") -> Epoch | None:
    """Return what the numbers of a channel of this name count from, shape ``(n,)``; None if they are no dates."""
    known = numbers[np.isfinite(numbers)] if numbers.dtype.kind == "f" else numbers
    if numbers.dtype.kind not in "iuf" or len(known) < 3:
        return None
    latest_s, ends = _tomorrow_s(), (float(known[0]), float(known[-1]))
    epochs = (WINCC,) if name.casefold() == "time_ms" else EPOCHS
    found = next((each for each in epochs if all(each.holds(end, latest_s) for end in ends)), None)
    if found is None:
        return None
    steps = np.diff(known.astype(np.float64) - ends[0])
    mean_s = abs(ends[1] - ends[0]) / len(steps) * found.unit_ns * 1e-9
    runs = max((steps >= 0.0).mean(), (steps <= 0.0).mean()) >= NEVER_FALLS
    return found if runs and 0.0 < mean_s <= LONGEST_STEP_S else None


def _tomorrow_s() -> float:
    return (datetime.now(UTC) + timedelta(days=1)).timestamp()

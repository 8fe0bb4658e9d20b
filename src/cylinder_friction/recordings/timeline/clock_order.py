"""Puts the rows of a table into the order in which they were sampled, and finds where its clock restarted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.clock import LATEST_S

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.recordings.timeline.time_rules import TimeRules

    Array = NDArray[np.float64]
    Indices = NDArray[np.int64]

LONGEST_WILD = 5
"""A stamp that fits neither neighbour is damage; more than this many in a row are a clock that restarted."""

WINDOWS = (4, 16, 64)
"""Rows to either side within which swapped rows are looked for."""


@dataclass(frozen=True)
class OrderedStamps:
    """Stamps that never run backwards between two starts of the clock.

    Attributes:
        time_s: Shape ``(m,)`` [s]; finite, equal or increasing within a segment.
        rows: Row of the table (from 0) that each came from, shape ``(m,)``.
        segments: Number of the segment, from 0 up, shape ``(m,)``: the clock restarted where it changes.
        repairs: What was done, one text each, without the word for what it was done to.
    """

    time_s: Array
    rows: Indices
    segments: Indices
    repairs: tuple[str, ...]


def order_stamps(time_s: Array, blank: NDArray[np.bool_], rules: TimeRules) -> OrderedStamps:
    """Return the stamps in order.

    Rows that hold neither stamp nor value are no rows. Stamps that are not finite (or 1e15 s and more), and up to five
    in a row that fit neither of their neighbours, are left out. Rows that fall into place when sorted (out of order by
    up to 64 rows) are sorted. Any other step backwards is a clock that restarted, was set back, or rolled over.

    Args:
        time_s: As logged, shape ``(n,)`` [s].
        blank: Rows without any value, shape ``(n,)``.
        rules: How much damage is too much.

    Raises:
        RecordingError: Fewer than three rows, time that stands, or too many damaged stamps.
    """
    finite = np.abs(time_s) < LATEST_S
    rows = np.flatnonzero(finite).astype(np.int64)
    lost = np.flatnonzero(~finite & ~blank)
    logged = len(rows) + len(lost)
    if logged < 3:
        raise RecordingError(f"has {logged} rows, expected at least 3")
    repairs = []
    if len(lost):
        if len(lost) > min(_most_damaged(logged, rules), logged - 3):
            raise RecordingError(
                f"time_s is not a number, or beyond {LATEST_S:.0e} s, in {len(lost)} of {logged} rows (first: row "
                f"{lost[0] + 1}), expected at most {100.0 * rules.damaged_share:.3g} %; check the time channel and its "
                "unit or date format"
            )
        repairs.append(f"{_rows(len(lost))} without a time stamp left out (first: row {lost[0] + 1})")
    stamps = time_s[rows]
    forward_s = np.diff(stamps)
    if not (forward_s > 0.0).any():
        what = f"stands at {stamps[0]:.9g} s" if (forward_s == 0.0).all() else "runs backwards from row to row"
        raise RecordingError(
            f"time_s {what} in all {len(stamps)} rows, expected increasing time; check the time channel in the mapping"
        )
    if forward_s.min() >= 0.0:
        return OrderedStamps(stamps, rows, np.zeros(len(rows), dtype=np.int64), tuple(repairs))
    sorting = _Sorting(stamps.copy(), rows.copy(), float(np.median(forward_s[forward_s > 0.0])), rules)
    sorting.run(_most_damaged(logged, rules))
    return sorting.result(repairs)


class _Sorting:
    """Goes through the backward steps from the first to the last and takes the mildest reading of each."""

    def __init__(self, time_s: Array, rows: Indices, step_s: float, rules: TimeRules) -> None:
        self.time_s, self.rows, self.step_s = time_s, rows, step_s
        self.longest_s = (rules.longest_bridge_samples + 1.5) * step_s
        self.wild = np.zeros(len(time_s), dtype=np.bool_)
        self.swapped: list[int] = []
        self.restarts: list[int] = []

    def run(self, most_damaged: float) -> None:
        position = int(_next_backward(self.time_s, 1))
        while position < len(self.time_s):
            before_s, after_s = self.time_s[position - 1], self.time_s[position]
            if self._sort(position) or self._leave_out(position):
                position = max(position - WINDOWS[-1], self._segment_start() + 1)
            else:
                self.restarts.append(position)
                position += 1
            damaged = int(self.wild.sum()) + len(self.swapped) + len(self.restarts)
            if damaged > most_damaged:
                raise RecordingError(
                    f"time_s runs backwards or jumps in {damaged} or more of {len(self.time_s)} rows (here from "
                    f"{before_s:.9g} to {after_s:.9g} s), expected at most {int(most_damaged)} such rows, else "
                    "their order is not known; check the time channel in the mapping and the logger's clock"
                )
            position = int(_next_backward(self.time_s, position))

    def _segment_start(self) -> int:
        return self.restarts[-1] if self.restarts else 0

    def _sort(self, position: int) -> bool:
        """Sort around a backward step if that leaves steps as a running clock has them."""
        for reach in WINDOWS:
            start, end = max(self._segment_start(), position - reach), min(len(self.time_s), position + reach)
            here = self.time_s[start:end]
            order = np.argsort(here, kind="stable")
            moved = np.flatnonzero(order != np.arange(len(order)))
            first, last = int(moved[0]), int(moved[-1])
            # Rows that would move to the end of what is looked at may have to go further still.
            if (first == 0 and start > self._segment_start()) or (last == len(here) - 1 and end < len(self.time_s)):
                continue
            steps_s = np.diff(here[order])[max(first - 1, 0) : last + 1]
            standing = int((np.diff(here) == 0.0).sum()) >= int((np.diff(here[order]) == 0.0).sum())
            plausible = (steps_s == 0.0) | ((steps_s >= 0.5 * self.step_s) & (steps_s <= self.longest_s))
            if standing and plausible.all():
                self.swapped.extend(int(row) for row in self.rows[start:end][moved])
                self.time_s[start:end] = here[order]
                self.rows[start:end] = self.rows[start:end][order]
                self.wild[start:end] = self.wild[start:end][order]
                return True
        return False

    def _leave_out(self, position: int) -> bool:
        """Leave out a few rows before or after a backward step if time runs on without them."""
        for count in range(1, LONGEST_WILD + 1):
            if self._bridge(position - count, position) or self._bridge(position, position + count):
                return True
        return False

    def _bridge(self, start: int, end: int) -> bool:
        first, rows = self._segment_start(), len(self.time_s)
        if start < first or end > rows or end - start >= rows - first:
            return False
        if start > first and end < rows:
            step_s = self.time_s[end] - self.time_s[start - 1]
            # The rows were sampled, only their stamps are wrong: time has gone on meanwhile. A clock that was set
            # back goes on too early.
            least_s = (end - start + 0.5) * self.step_s
            if not least_s <= step_s <= self.longest_s + (end - start) * self.step_s:
                return False
            # Placed between its neighbours for now, so that what follows looks at a running clock.
            inside = np.arange(1, end - start + 1) / (end - start + 1)
            self.time_s[start:end] = self.time_s[start - 1] + inside * step_s
        elif start == first and not (end < rows):
            return False
        else:
            self.time_s[start:end] = self.time_s[end] if start == first else self.time_s[start - 1]
        self.wild[start:end] = True
        return True

    def result(self, repairs: list[str]) -> OrderedStamps:
        segments = np.zeros(len(self.time_s), dtype=np.int64)
        segments[self.restarts] = 1
        segments = np.cumsum(segments)
        if self.wild.any():
            first = int(self.rows[self.wild].min()) + 1
            repairs.append(
                f"{_rows(int(self.wild.sum()))} with a stamp that fits neither neighbour left out (first: row {first})"
            )
        if self.swapped:
            repairs.append(f"{_rows(len(self.swapped))} out of order sorted (first: row {min(self.swapped) + 1})")
        if self.restarts:
            at = self.restarts[0]
            repairs.append(
                f"split at {len(self.restarts)} {'restart' if len(self.restarts) == 1 else 'restarts'} of the clock "
                f"(first: row {self.rows[at] + 1}, from {self.time_s[at - 1]:.9g} to {self.time_s[at]:.9g} s)"
            )
        kept = ~self.wild
        return OrderedStamps(self.time_s[kept], self.rows[kept], segments[kept], tuple(repairs))


def _rows(count: int) -> str:
    return "1 row" if count == 1 else f"{count} rows"


def _most_damaged(rows: int, rules: TimeRules) -> float:
    return max(3.0, rules.damaged_share * rows)


@numba.njit(cache=True)
def _next_backward(time_s: Array, start: int) -> int:
    """Return the first position from ``start`` on whose stamp is before the one before; the length if none is."""
    for position in range(max(start, 1), len(time_s)):
        if time_s[position] < time_s[position - 1]:
            return position
    return len(time_s)

"""Put rows in the order in which they were sampled: repair damaged, duplicate and coarse stamps, find restarts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.timestamps import LATEST_S, Indices, TimeRules, whole_hertz

LONGEST_WILD = 5
"""A stamp that fits neither neighbour is damage; more than this many in a row are a clock that restarted."""

WINDOWS = (4, 16, 64)  # rows to either side within which swapped rows are looked for
FEWEST_STAMPS = 10  # a coarse clock is distinguished from chance by at least this many different stamps

LOOKED_AT = 4096  # rows at a time in which a step backwards is looked for

LAG = 32
"""Stamps over which the first estimate of a coarse clock's rate is taken, so that their rounding averages out."""


@dataclass(frozen=True)
class OrderedStamps:
    """Stamps that never run backwards between two starts of the clock."""

    time_s: Array  # Shape ``(m,)`` [s]; finite, equal or increasing within a segment
    rows: Indices  # Row of the table (from 0) that each came from, shape ``(m,)``
    segments: Indices  # Number of the segment, from 0 up, shape ``(m,)``: the clock restarted where it changes
    repairs: tuple[str, ...]  # What was done, one text each, without its subject


def order_stamps(time_s: Array, blank: Mask, rules: TimeRules) -> OrderedStamps:
    """Return the stamps in order.

    Rows that hold neither stamp nor value (``blank``) are ignored. Stamps that are not finite (or 1e15 s and more), and
    up to five in a row that fit neither of their neighbours, are left out. Rows that fall into place when sorted (out
    of order by up to 64 rows) are sorted. Any other step backwards is a clock that restarted, was set back, or rolled
    over.

    Raises:
        RecordingError: Fewer than three rows, time that stands still, or too many damaged stamps.
    """
    finite = np.abs(time_s) < LATEST_S
    rows = np.flatnonzero(finite).astype(np.int64)
    lost = np.flatnonzero(~finite & ~blank)
    logged = len(rows) + len(lost)
    if logged < 3:
        raise RecordingError(f"has {logged} rows, expected at least 3")
    most_damaged = max(3.0, rules.damaged_share * logged)
    repairs = []
    if len(lost):
        if len(lost) > min(most_damaged, logged - 3):
            raise RecordingError(
                f"time_s is not a number, or beyond {LATEST_S:.0e} s, in {len(lost)} of {logged} rows (first: row "
                f"{lost[0] + 1}), expected at most {100.0 * rules.damaged_share:.3g} %; check the time channel and its "
                "unit or date format"
            )
        repairs.append(f"{counted(len(lost), 'row')} without a time stamp left out (first: row {lost[0] + 1})")
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
    sorting.run(most_damaged)
    return sorting.result(repairs)


class _Sorting:
    """Goes through the backward steps in order and applies the mildest explanation of each."""

    def __init__(self, time_s: Array, rows: Indices, step_s: float, rules: TimeRules) -> None:
        self.time_s, self.rows, self.step_s = time_s, rows, step_s
        self.longest_s = (rules.longest_bridge_samples + 1.5) * step_s
        self.wild = np.zeros(len(time_s), dtype=np.bool_)
        self.swapped: list[int] = []
        self.restarts: list[int] = []

    def run(self, most_damaged: float) -> None:
        position = _next_backward(self.time_s, 1)
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
            position = _next_backward(self.time_s, position)

    def _segment_start(self) -> int:
        return self.restarts[-1] if self.restarts else 0

    def _sort(self, position: int) -> bool:
        """Sort the rows around a backward step if the steps are then those of a running clock."""
        for window in WINDOWS:
            start, end = max(self._segment_start(), position - window), min(len(self.time_s), position + window)
            here = self.time_s[start:end]
            order = np.argsort(here, kind="stable")
            moved = np.flatnonzero(order != np.arange(len(order)))
            first, last = int(moved[0]), int(moved[-1])
            # Rows that would move to the end of the window may have to go further still.
            if (first == 0 and start > self._segment_start()) or (last == len(here) - 1 and end < len(self.time_s)):
                continue
            steps_s = np.diff(here[order])[max(first - 1, 0) : last + 1]
            standing = int((np.diff(here) == 0.0).sum()) >= int((np.diff(here[order]) == 0.0).sum())
            plausible = (steps_s == 0.0) | ((steps_s >= 0.5 * self.step_s) & (steps_s <= self.longest_s))
            if standing and plausible.all():
                self.swapped.extend(int(row) for row in self.rows[start:end][moved])
                for values in (self.time_s, self.rows, self.wild):
                    values[start:end] = values[start:end][order]
                return True
        return False

    def _leave_out(self, position: int) -> bool:
        """Leave out a few rows before or after a backward step if time runs on without them."""
        return any(
            self._bridge(position - count, position) or self._bridge(position, position + count)
            for count in range(1, LONGEST_WILD + 1)
        )

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
            # Placed between its neighbours for now, so that later rows are compared with a running clock.
            inside = np.arange(1, end - start + 1) / (end - start + 1)
            self.time_s[start:end] = self.time_s[start - 1] + inside * step_s
        elif start == first and not (end < rows):
            return False
        else:
            self.time_s[start:end] = self.time_s[end] if start == first else self.time_s[start - 1]
        self.wild[start:end] = True
        return True

    def result(self, repairs: list[str]) -> OrderedStamps:
        segments = np.searchsorted(self.restarts, np.arange(len(self.time_s)), side="right")
        if self.wild.any():
            wild, first = counted(int(self.wild.sum()), "row"), int(self.rows[self.wild].min()) + 1
            repairs.append(f"{wild} with a stamp that fits neither neighbour left out (first: row {first})")
        if self.swapped:
            repairs.append(
                f"{counted(len(self.swapped), 'row')} out of order sorted (first: row {min(self.swapped) + 1})"
            )
        if self.restarts:
            at = self.restarts[0]
            repairs.append(
                f"split at {counted(len(self.restarts), 'restart')} of the clock "
                f"(first: row {self.rows[at] + 1}, from {self.time_s[at - 1]:.9g} to {self.time_s[at]:.9g} s)"
            )
        kept = ~self.wild
        return OrderedStamps(self.time_s[kept], self.rows[kept], segments[kept], tuple(repairs))


def _next_backward(time_s: Array, start: int) -> int:
    """Return the first position from ``start`` on with an earlier stamp than its predecessor; the length if none."""
    for first in range(max(start, 1), len(time_s), LOOKED_AT):
        backward = np.flatnonzero(np.diff(time_s[first - 1 : first + LOOKED_AT]) < 0.0)
        if len(backward):
            return first + int(backward[0])
    return len(time_s)


def resolve_duplicates(
    stamps: OrderedStamps, values: Sequence[Array], rules: TimeRules
) -> tuple[Array, Mask, list[str]]:
    """Return the stamps, which increase over the rows to keep, the mask of these rows, and what was done.

    - Copies of the row before (same stamp, same values) are left out, however many there are.
    - Where more than ``damaged_share`` of the rows repeat a stamp with other values, the clock is coarse (a tick of
      10 or 15.6 ms, or one stamp for a block of samples): the samples are spread evenly, on a straight line along
      the first sample of each stamp and none of these before its stamp. Stamps off that line by more than the usual
      time between two of them were not sampled evenly. Fewer lost samples than that are hidden by the rounding.
    - Fewer duplicates with other values: the first row of a stamp stays.

    Columns are in the order of the stamps, shape ``(n,)`` each, as the results are.

    Raises:
        RecordingError: Many rows repeat a stamp and were not sampled evenly.
    """
    keep = np.ones(len(stamps.time_s), dtype=np.bool_)
    repeated = np.append(False, (np.diff(stamps.time_s) == 0.0) & (np.diff(stamps.segments) == 0))
    if not repeated.any():
        return stamps.time_s, keep, []
    same = np.append(False, keep[1:])
    for column in values:
        same[1:] &= (column[:-1] == column[1:]) | (np.isnan(column[:-1]) & np.isnan(column[1:]))
    copies = repeated & same
    repairs = []
    # A sensor at rest repeats its values without being copied; then they repeat from stamp to stamp as well.
    at_rest = float(same[~repeated][1:].mean()) if (~repeated).sum() > 1 else 0.0
    others = repeated & ~copies
    few = repeated.sum() <= rules.damaged_share * len(keep)
    if copies.any() and (few or (at_rest < 0.5 and copies.sum() >= 0.9 * repeated.sum())):
        keep &= ~copies
        repairs.append(_first(copies, stamps, "stamp and values of the row before"))
    else:
        others = repeated
    if not others.any():
        return stamps.time_s, keep, repairs
    if others.sum() <= max(3.0, rules.damaged_share * len(keep)):
        keep &= ~others
        repairs.append(_first(others, stamps, "the stamp of the row before but other values"))
        return stamps.time_s, keep, repairs
    spread_s, rate_hz, tick_s = _spread(stamps.time_s[keep], stamps.segments[keep], rules)
    time_s = stamps.time_s.copy()
    time_s[keep] = spread_s
    repairs.append(
        f"coarse stamps, {others.sum()} of {len(keep)} rows with the stamp of the row before (a new stamp every "
        f"{1e3 * tick_s:.4g} ms), spread evenly at {rate_hz:.6g} Hz"
    )
    return time_s, keep, repairs


def _spread(time_s: Array, segments: Indices, rules: TimeRules) -> tuple[Array, float, float]:
    """Return evenly spread stamps, their rate [Hz] and the usual time between two different stamps [s]."""
    firsts = np.flatnonzero(np.concatenate([[True], (np.diff(time_s) != 0.0) | (np.diff(segments) != 0)]))
    stamps_s, segment = time_s[firsts], segments[firsts]
    within = np.diff(segment) == 0
    if within.sum() < FEWEST_STAMPS:
        raise RecordingError(
            f"time_s has {len(firsts)} different stamps for {len(time_s)} rows, too few to spread the rows evenly "
            f"between them, expected at least {FEWEST_STAMPS + 1}; log time with a finer resolution"
        )
    tick_s = float(np.median(np.diff(stamps_s)[within]))
    lag = min(LAG, max(1, int(within.sum()) // 4))
    one_segment = segment[lag:] == segment[:-lag]
    slopes_s = (stamps_s[lag:] - stamps_s[:-lag]) / (firsts[lag:] - firsts[:-lag])
    step_s = float(np.median(slopes_s[one_segment] if one_segment.any() else slopes_s))
    surplus_s = np.diff(stamps_s) - np.diff(firsts) * step_s
    gap = ~within | (surplus_s > tick_s + (rules.longest_bridge_samples + 1) * step_s)
    stretch = np.concatenate([[0], np.cumsum(gap)])
    row_mean, stamp_mean = _means(firsts.astype(np.float64), stretch), _means(stamps_s, stretch)
    row_off, stamp_off = firsts - row_mean[stretch], stamps_s - stamp_mean[stretch]
    step_s = 1.0 / whole_hertz(float((row_off**2).sum() / (row_off * stamp_off).sum()))
    worst = int(np.argmax(np.abs(stamp_off - step_s * row_off)))
    off_s = abs(float(stamp_off[worst] - step_s * row_off[worst]))
    stretch_of_row = np.repeat(stretch, np.diff(np.append(firsts, len(time_s))))
    # A tick shows the time that was: a sample is taken when its stamp is reached, or later.
    start_s = np.full(len(stamp_mean), -np.inf)
    np.maximum.at(start_s, stretch, stamps_s - step_s * firsts)
    spread_s = start_s[stretch_of_row] + step_s * np.arange(len(time_s))
    backwards = (np.diff(spread_s) <= 0.0) & (np.diff(segments) == 0)
    if off_s > 1.05 * tick_s or backwards.any():
        raise RecordingError(
            f"time_s has {len(firsts)} different stamps for {len(time_s)} rows, and the rows were not sampled evenly: "
            f"the stamp {stamps_s[worst]:.9g} s is {1e3 * off_s:.4g} ms off an even {1.0 / step_s:.5g} Hz, expected "
            f"at most {1e3 * tick_s:.4g} ms; log time with a finer resolution"
        )
    return spread_s, 1.0 / step_s, tick_s


def _means(values: Array, groups: Indices) -> Array:
    means: Array = np.bincount(groups, weights=values) / np.bincount(groups)
    return means


def counted(count: int, thing: str, plural: str = "s") -> str:
    return f"{count} {thing}{'' if count == 1 else plural}"


def _first(mask: Mask, stamps: OrderedStamps, what: str) -> str:
    return f"{counted(int(mask.sum()), 'row')} with {what} left out (first: row {int(stamps.rows[mask].min()) + 1})"

"""Find restarts of a clock, and resolve duplicate and coarse stamps. Rows out of order are refused."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.timestamps import LATEST_S, Indices, TimeRules, whole_hertz

RUNS_ON = 16
"""Number of rows before and after a backward step that must be in order for the step to be a restart of the clock."""
UNDONE_SHARE = 0.5
"""Least forward jump near a backward step, as a share of it, that shows that the clock did not restart."""
DAMAGED_SHARE = 0.05
"""Largest share of rows with damaged stamps at which the order of the rows is known."""
FEWEST_STAMPS = 10  # Fewest different stamps of a coarse clock
LAG = 32
"""Number of stamps for the first estimate of a coarse clock's rate, over which rounding averages out."""


@dataclass(frozen=True)
class OrderedStamps:
    """Stamps that never decrease between two starts of the clock."""

    time_s: Array  # Finite stamps, equal or increasing within a segment, shape ``(m,)`` [s]
    rows: Indices  # Row of each stamp in the table, counted from 0, shape ``(m,)``
    segments: Indices  # Number of each stamp's segment, from 0, shape ``(m,)``; a segment ends when the clock restarts
    repairs: tuple[str, ...]  # Repairs, one text each, without a subject


def order_stamps(time_s: Array, blank: Mask) -> OrderedStamps:
    """Check and repair the order of stamps.

    Rows without stamp and value (``blank``) are ignored. A few stamps that are not finite, or 1e11 s and more, are left
    out. A clock may restart, be set back or roll over.

    Raises:
        RecordingError: There are fewer than three rows, time stands still or runs backwards, too many rows have no
            stamp, or rows are swapped or have a damaged stamp.
    """
    finite = np.abs(time_s) < LATEST_S
    rows = np.flatnonzero(finite).astype(np.int64)
    lost = np.flatnonzero(~finite & ~blank)
    logged = len(rows) + len(lost)
    if logged < 3:
        raise RecordingError(f"has {logged} rows, expected at least 3")
    most_damaged = max(3.0, DAMAGED_SHARE * logged)
    repairs = []
    if len(lost):
        if len(lost) > min(most_damaged, logged - 3):
            raise RecordingError(
                f"time_s is not a number, or beyond {LATEST_S:.0e} s, in {len(lost)} of {logged} rows (first: row "
                f"{lost[0] + 1}), expected at most {100.0 * DAMAGED_SHARE:.3g} %; check the time channel and its "
                "unit or date format"
            )
        repairs.append(f"{counted(len(lost), 'row')} without a time stamp left out (first: row {lost[0] + 1})")
    stamps = time_s[rows]
    forward_s = np.diff(stamps)
    if not (forward_s > 0.0).any():
        stands = (forward_s == 0.0).all()
        what = f"stands at {stamps[0]:.9g} s" if stands else "runs backwards from row to row"
        newest = "" if stands else "; if a log too long to be read at once has its newest row first, sort it by time"
        raise RecordingError(
            f"time_s {what} in all {len(stamps)} rows, expected increasing time; check the time channel in the mapping"
            f"{newest}"
        )
    if forward_s.min() >= 0.0:
        return OrderedStamps(stamps, rows, np.zeros(len(rows), dtype=np.int64), tuple(repairs))
    restarts = _restarts(stamps, rows)
    at = restarts[0]
    repairs.append(
        f"split at {counted(len(restarts), 'restart')} of the clock "
        f"(first: row {rows[at] + 1}, from {stamps[at - 1]:.9g} to {stamps[at]:.9g} s)"
    )
    segments = np.searchsorted(restarts, np.arange(len(stamps)), side="right")
    return OrderedStamps(stamps, rows, segments, tuple(repairs))


def _restarts(time_s: Array, rows: Indices) -> Indices:
    """Find the rows at which a clock restarts; refuse a backward step that rows near it undo."""
    steps_s = np.diff(time_s)
    restarts = np.flatnonzero(steps_s < 0.0) + 1
    for at in restarts:
        back_s = time_s[at - 1] - time_s[at]
        around_s = np.concatenate([steps_s[max(at - 1 - RUNS_ON, 0) : at - 1], steps_s[at : at + RUNS_ON]])
        runs_on = 1 < at < len(time_s) - 1 and ((around_s >= 0.0) & (around_s <= UNDONE_SHARE * back_s)).all()
        if not runs_on:
            raise RecordingError(
                f"time_s goes back in row {rows[at] + 1}, from {time_s[at - 1]:.9g} to {time_s[at]:.9g} s, and does "
                "not run on from there: rows are swapped, or stamps are damaged; expected increasing time, or a clock "
                "that starts anew; correct or cut these rows, and check the time channel in the mapping"
            )
    return restarts


def resolve_duplicates(
    stamps: OrderedStamps, values: Sequence[Array], rules: TimeRules
) -> tuple[Array, Mask, list[str]]:
    """Return stamps that increase over the rows to keep, the mask of these rows, and the repairs.

    - Copies of the row before (same stamp, same values) are left out, however many there are.
    - If more than 5 % of the rows repeat a stamp with other values, the clock is coarse (a tick of
      10 or 15.6 ms, or one stamp for a block of samples). The samples are then spread evenly on a straight line through
      the first samples of the stamps, none of them before its stamp. If stamps are off that line by more than the usual
      time between two stamps, sampling was uneven. Rounding hides fewer lost samples than that.
    - If fewer rows repeat a stamp with other values, the first row of each stamp is kept.

    Columns and results are in the order of the stamps, shape ``(n,)`` each.

    Raises:
        RecordingError: Many rows repeat a stamp, and sampling was uneven.
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
    # The values of a sensor at rest repeat without being copies, but then they also repeat from stamp to stamp.
    at_rest = float(same[~repeated][1:].mean()) if (~repeated).sum() > 1 else 0.0
    others = repeated & ~copies
    few = repeated.sum() <= DAMAGED_SHARE * len(keep)
    if copies.any() and (few or (at_rest < 0.5 and copies.sum() >= 0.9 * repeated.sum())):
        keep &= ~copies
        repairs.append(_first(copies, stamps, "stamp and values of the row before"))
    else:
        others = repeated
    if not others.any():
        return stamps.time_s, keep, repairs
    if others.sum() <= max(3.0, DAMAGED_SHARE * len(keep)):
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
    # A tick shows a past time, so each sample was taken at its stamp or later.
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

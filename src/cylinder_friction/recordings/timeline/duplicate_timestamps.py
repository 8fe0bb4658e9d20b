"""Rows that repeat the stamp of the row before: copies of a row, or a clock too coarse for its samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.clock import whole_hertz

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.timeline.clock_order import OrderedStamps
    from cylinder_friction.recordings.timeline.time_rules import TimeRules

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

FEWEST_STAMPS = 10
"""A coarse clock is told from chance by this many different stamps at least."""

LAG = 32
"""Stamps over which the first estimate of a coarse clock's rate is taken, so that their rounding averages out."""


def resolve_repeats(stamps: OrderedStamps, values: Sequence[Array], rules: TimeRules) -> tuple[Array, Mask, list[str]]:
    """Return stamps that increase, the rows to keep, and what was done.

    - Copies of the row before (same stamp, same values) are left out, however many there are.
    - Where more than ``damaged_share`` of the rows repeat a stamp with other values, the clock is coarse (a tick of
      10 or 15.6 ms, or one stamp for a block of samples): the samples are spread evenly, on a straight line along
      the first sample of each stamp and none of these before its stamp. Stamps off that line by more than the usual
      time between two of them were not sampled evenly. Fewer lost samples than that cannot be told from the rounding.
    - Fewer repeats with other values: the first row of a stamp stays.

    Args:
        stamps: In order, shape ``(n,)``.
        values: Columns in the same order, shape ``(n,)`` each.
        rules: How much is too much.

    Returns:
        Stamps of all rows, shape ``(n,)``, increasing within a segment over the rows to keep; those rows, shape
        ``(n,)``; one text for each repair.

    Raises:
        RecordingError: Many rows repeat a stamp and were not sampled evenly.
    """
    keep = np.ones(len(stamps.time_s), dtype=np.bool_)
    repeated = np.zeros(len(keep), dtype=np.bool_)
    repeated[1:] = (np.diff(stamps.time_s) == 0.0) & (np.diff(stamps.segments) == 0)
    if not repeated.any():
        return stamps.time_s, keep, []
    same = _same_as_before(values)
    copies = repeated & same
    repairs = []
    # A sensor at rest repeats its values without being copied; then they repeat from stamp to stamp as well.
    at_rest = float(same[~repeated][1:].mean()) if (~repeated).sum() > 1 else 0.0
    others = repeated & ~copies
    few = repeated.sum() <= rules.damaged_share * len(keep)
    if copies.any() and (few or (at_rest < 0.5 and copies.sum() >= 0.9 * repeated.sum())):
        keep &= ~copies
        repairs.append(
            f"{_rows(copies)} with stamp and values of the row before left out (first: row {_first(copies, stamps)})"
        )
    else:
        others = repeated
    if not others.any():
        return stamps.time_s, keep, repairs
    if others.sum() <= max(3.0, rules.damaged_share * len(keep)):
        keep &= ~others
        repairs.append(
            f"{_rows(others)} with the stamp of the row before but other values left out "
            f"(first: row {_first(others, stamps)})"
        )
        return stamps.time_s, keep, repairs
    spread_s, rate_hz, tick_s = _spread(stamps.time_s[keep], stamps.segments[keep], rules)
    time_s = stamps.time_s.copy()
    time_s[keep] = spread_s
    repairs.append(
        f"coarse stamps, {others.sum()} of {len(keep)} rows with the stamp of the row before (a new stamp every "
        f"{1e3 * tick_s:.4g} ms), spread evenly at {rate_hz:.6g} Hz"
    )
    return time_s, keep, repairs


def _same_as_before(values: Sequence[Array]) -> Mask:
    same = np.ones(len(values[0]), dtype=np.bool_)
    same[0] = False
    for column in values:
        before, after = column[:-1], column[1:]
        same[1:] &= (before == after) | (np.isnan(before) & np.isnan(after))
    return same


def _spread(time_s: Array, segments: NDArray[np.int64], rules: TimeRules) -> tuple[Array, float, float]:
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
    apart = segment[lag:] == segment[:-lag]
    slopes_s = (stamps_s[lag:] - stamps_s[:-lag]) / (firsts[lag:] - firsts[:-lag])
    step_s = float(np.median(slopes_s[apart] if apart.any() else slopes_s))
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


def _means(values: Array, groups: NDArray[np.int64]) -> Array:
    means: Array = np.bincount(groups, weights=values) / np.bincount(groups)
    return means


def _rows(mask: Mask) -> str:
    count = int(mask.sum())
    return "1 row" if count == 1 else f"{count} rows"


def _first(mask: Mask, stamps: OrderedStamps) -> int:
    return int(stamps.rows[mask].min()) + 1

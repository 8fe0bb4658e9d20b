"""Find the timeline of each channel: its valid samples in order, each with a stamp and a number on a sample grid."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.recording import RecordingError, Signal
from cylinder_friction.recordings.timeline.timestamps import (
    JITTER_SHARE,
    LATEST_S,
    Indices,
    TimeRules,
    explaining_resolution,
    follows_even_clock,
    printed_resolution,
    whole_hertz,
)
from cylinder_friction.wording import counted

RUNS_ON = 16  # Rows before and after a backward step that must be in order if the clock was restarted
UNDONE_SHARE = 0.5  # Least forward jump near a backward step, as a share of it, that shows no restart of the clock
DAMAGED_SHARE = 0.05  # Largest share of rows with damaged stamps at which the order of the rows is known
OTHER_SHARE = 0.1  # Largest share of rows with other values among rows that repeat a stamp and count as copies
FEWEST_STAMPS = 10  # Fewest different stamps of a coarse clock
LAG = 32  # Number of stamps for the first estimate of a coarse clock's rate, over which rounding averages out
TOGETHER = 0.8
"""Least share of common rows of columns that were sampled together. Two raster rates of one table share at most half of
their rows, or the slower one shares all of its rows."""
SHORT_BLOCK = 32
"""Samples over which a step is averaged if rounding hides single steps, and which show whether one was lost."""
STEADY = 0.2  # Largest uncertainty of two such blocks' duration, in steps, if single steps give the first estimate
PASSES = 4  # Times that samples are numbered by the step that the numbers before showed
SURE = 3.0  # Standard deviations by which the rate of a clock with jitter may miss a whole number of hertz


@dataclass(frozen=True)
class OrderedStamps:
    """Stamps that never decrease between two starts of the clock."""

    time_s: Array  # Finite stamps, equal or increasing within a segment, shape ``(m,)`` [s]
    rows: Indices  # Row of each stamp in the table, counted from 0, shape ``(m,)``
    segments: Indices  # Number of each stamp's segment, from 0, shape ``(m,)``; a segment ends when the clock restarts
    repairs: tuple[str, ...]  # Repairs, one text each, without a subject


def order_stamps(time_s: Array, blank: Mask) -> OrderedStamps:
    """Check and repair the order of stamps: clocks may restart, and a few wild or missing stamps are left out."""
    finite = np.abs(time_s) < LATEST_S
    rows = np.flatnonzero(finite).astype(np.int64)
    lost = np.flatnonzero(~finite & ~blank)
    logged = len(rows) + len(lost)
    if logged < 3:
        raise RecordingError(f"has {counted(logged, 'row')}, expected at least 3")
    most_damaged = max(3.0, DAMAGED_SHARE * logged)
    repairs = []
    if len(lost):
        if len(lost) > min(most_damaged, logged - 3):
            date = "write a date such as 20260314081500.005 as 2026-03-14 08:15:00.005"
            remedy = date if 19e12 < time_s[lost[0]] < 21e12 else "check the time channel"
            raise RecordingError(
                f"time_s is not a number, or beyond {LATEST_S:.0e} s, in {len(lost)} of {logged} rows (first: row "
                f"{lost[0] + 1}), expected at most {100.0 * DAMAGED_SHARE:.3g} %; {remedy}"
            )
        repairs.append(f"{counted(len(lost), 'row')} without a time stamp left out (first: row {lost[0] + 1})")
    stamps = time_s[rows]
    forward_s = np.diff(stamps)
    if not (forward_s > 0.0).any():
        stands = (forward_s == 0.0).all()
        what = f"stands at {stamps[0]:.9g} s" if stands else "runs backwards from row to row"
        newest = "" if stands else "; if a log too long to be read at once has its newest row first, sort it by time"
        problem = f"time_s {what} in all {len(stamps)} rows, expected increasing time"
        raise RecordingError(f"{problem}; check the time channel in the mapping{newest}")
    if forward_s.min() >= 0.0:
        return OrderedStamps(stamps, rows, np.zeros(len(rows), dtype=np.int64), tuple(repairs))
    restarts = _restarts(stamps, rows)
    at, back_s = restarts[0], stamps[restarts[0] - 1] - stamps[restarts[0]]
    hour = ", an hour back: the end of summer time, or a clock without hours" if round(back_s / 60) == 60 else ""
    repairs.append(
        f"split at {counted(len(restarts), 'restart')} of the clock "
        f"(first: row {rows[at] + 1}, from {stamps[at - 1]:.9g} to {stamps[at]:.9g} s{hour})"
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

    - If at most 5 % of the rows repeat a stamp, or nearly all of these are copies of the row before (the same values),
      the first row of each stamp is kept.
    - Rows of a clock with jitter may share a stamp because its last digit is rounded. They are spread over that digit.
    - Otherwise the clock is coarse (a tick of 10 or 15.6 ms, or one stamp for a block of samples). The samples are then
      spread evenly on a straight line through the first samples of the stamps, none of them before its stamp. If stamps
      are off that line by more than the usual time between two stamps, the rows are refused. Rounding hides fewer lost
      samples than that.
    """
    keep = np.ones(len(stamps.time_s), dtype=np.bool_)
    repeated = np.append(False, (np.diff(stamps.time_s) == 0.0) & (np.diff(stamps.segments) == 0))
    if not repeated.any():
        return stamps.time_s, keep, []
    same = np.append(False, keep[1:])
    for column in values:
        same[1:] &= (column[:-1] == column[1:]) | (np.isnan(column[:-1]) & np.isnan(column[1:]))
    others = int((repeated & ~same).sum())
    # The values of a sensor at rest repeat without being copies, but then they also repeat from stamp to stamp.
    at_rest = float(same[~repeated][1:].mean()) if (~repeated).sum() > 1 else 0.0
    copies = at_rest < 0.5 and others <= OTHER_SHARE * repeated.sum()
    if not copies and (spread_s := _spread_within_digit(stamps.time_s, repeated)) is not None:
        return spread_s, keep, []
    if copies or repeated.sum() <= max(3.0, DAMAGED_SHARE * len(keep)):
        unlike = f", {others} of them with other values" if others else ""
        rows = counted(int(repeated.sum()), "row")
        first = int(stamps.rows[repeated].min()) + 1
        note = f"{rows} with the stamp of the row before left out (first: row {first}{unlike})"
        return stamps.time_s, ~repeated, [note]
    spread_s, rate_hz, tick_s = _spread(stamps, rules)
    note = (
        f"coarse stamps, {repeated.sum()} of {len(keep)} rows with the stamp of the row before (a new stamp every "
        f"{1e3 * tick_s:.4g} ms), spread evenly at {rate_hz:.6g} Hz"
    )
    return spread_s, keep, [note]


def _spread_within_digit(time_s: Array, repeated: Mask) -> Array | None:
    """Spread equal stamps over their last digit if jitter explains them: steps of one digit are then more common."""
    digit_s, steps_s = printed_resolution(time_s), np.diff(time_s)
    one_digit = np.count_nonzero(np.abs(steps_s - digit_s) < 0.5 * digit_s)
    if repeated.sum() > min(one_digit, DAMAGED_SHARE * len(time_s)) or np.median(steps_s) < 2.5 * digit_s:
        return None
    rows = np.arange(len(time_s))
    turn = rows - np.maximum.accumulate(np.where(repeated, 0, rows))
    return np.asarray(time_s + digit_s * turn / (1 + turn.max()))


def _spread(stamps: OrderedStamps, rules: TimeRules) -> tuple[Array, float, float]:
    """Return evenly spread stamps, their rate [Hz] and the largest usual time between different stamps [s]."""
    time_s, segments = stamps.time_s, stamps.segments
    firsts = np.flatnonzero(np.concatenate([[True], (np.diff(time_s) != 0.0) | (np.diff(segments) != 0)]))
    stamps_s, segment = time_s[firsts], segments[firsts]
    within = np.diff(segment) == 0
    if within.sum() < FEWEST_STAMPS:
        raise RecordingError(
            f"time_s has {len(firsts)} different stamps for {len(time_s)} rows, too few to spread the rows evenly "
            f"between them, expected at least {FEWEST_STAMPS + 1}; log time with a finer resolution"
        )
    own_s = (np.diff(stamps_s[segment == each]) for each in range(segment[-1] + 1))
    tick_s = np.array([np.median(steps_s) if len(steps_s) else 0.0 for steps_s in own_s])[segment]
    lag = min(LAG, max(1, int(within.sum()) // 4))
    one_segment = segment[lag:] == segment[:-lag]
    slopes_s = (stamps_s[lag:] - stamps_s[:-lag]) / (firsts[lag:] - firsts[:-lag])
    step_s = float(np.median(slopes_s[one_segment] if one_segment.any() else slopes_s))
    surplus_s = np.diff(stamps_s) - np.diff(firsts) * step_s
    gap = ~within | (surplus_s > tick_s[1:] + (rules.longest_bridge_samples + 1) * step_s)
    stretch = np.concatenate([[0], np.cumsum(gap)])
    _refuse_short_seconds(stamps, firsts, stretch)
    # A stretch may begin within a tick, so that only its later stamps show the row at which their tick began.
    fits = (np.diff(stretch, prepend=-1) == 0) | (np.bincount(stretch) < 3)[stretch]
    row_mean, stamp_mean = (
        np.bincount(stretch, each * fits) / np.bincount(stretch, fits) for each in (firsts, stamps_s)
    )
    row_off, stamp_off = firsts - row_mean[stretch], stamps_s - stamp_mean[stretch]
    step_s = 1.0 / whole_hertz(float((row_off**2)[fits].sum() / (row_off * stamp_off)[fits].sum()))
    off_s = np.abs(stamp_off - step_s * row_off)
    worst = int(np.argmax(off_s - 1.05 * tick_s))
    stretch_of_row = np.repeat(stretch, np.diff(np.append(firsts, len(time_s))))
    # A tick shows a past time, so each sample was taken at its stamp or later.
    start_s = np.full(len(stamp_mean), -np.inf)
    np.maximum.at(start_s, stretch, stamps_s - step_s * firsts)
    spread_s = start_s[stretch_of_row] + step_s * np.arange(len(time_s))
    backwards = (np.diff(spread_s) <= 0.0) & (np.diff(segments) == 0)
    if off_s[worst] > 1.05 * tick_s[worst] or backwards.any():
        raise RecordingError(
            f"time_s has {len(firsts)} different stamps for {len(time_s)} rows, and the rows were not sampled evenly: "
            f"the stamp {stamps_s[worst]:.9g} s is {1e3 * off_s[worst]:.4g} ms off an even {1.0 / step_s:.5g} Hz, "
            f"expected at most {1e3 * tick_s[worst]:.4g} ms; log time with a finer resolution"
        )
    return spread_s, 1.0 / step_s, float(tick_s.max())


def _refuse_short_seconds(stamps: OrderedStamps, firsts: Indices, stretch: Indices) -> None:
    """Refuse stamps of whole seconds if a second within a stretch has fewer rows than the others."""
    if printed_resolution(stamps.time_s) < 1.0:
        return
    rows, whole = np.diff(firsts), (np.diff(stretch) == 0) & (np.diff(stretch, prepend=-1)[:-1] == 0)
    usual = float(np.median(rows[whole])) if whole.any() else 0.0
    beside = np.convolve(np.maximum(rows - usual, 0.0), [1.0, 0.0, 1.0], "same")  # written a second early or late
    short = np.flatnonzero(whole & (rows + beside < (1.0 - DAMAGED_SHARE) * usual - 1.0))
    if len(short):
        first = firsts[short[0]]
        raise RecordingError(
            f"time_s holds whole seconds: {stamps.time_s[first]:.9g} s (from row {stamps.rows[first] + 1} on) has "
            f"{rows[short[0]]} rows, a second usually {usual:.0f}: samples are missing somewhere in it; log time with "
            "a finer resolution, or cut the file there"
        )


@dataclass(frozen=True)
class SampleGrid:
    """Sample numbers of the stamps of columns that were sampled together."""

    time_s: Array  # Stamps in order, shape ``(n,)`` [s]
    segments: Indices  # Number of each stamp's segment, shape ``(n,)``; a segment ends when the clock restarts
    step_s: float  # Time between two samples [s]; if they are uneven, that of whole stretches
    even: bool  # Whether the stamps are those of an even clock, apart from lost samples
    index: Indices  # Sample number of each stamp, shape ``(n,)``; meaningless across a gap or a restart
    gaps: Mask  # Whether too many samples are lost after a stamp, or the clock restarts, shape ``(n - 1,)``


@dataclass(frozen=True)
class ChannelTimeline:
    """Valid samples of one column."""

    column: str  # Name of the column
    grid: SampleGrid  # The grid that it was sampled on
    time_s: Array  # Stamps of the samples, shape ``(m,)`` [s]
    index: Indices  # Numbers of the samples on the grid, shape ``(m,)``
    segments: Indices  # Number of each sample's segment, shape ``(m,)``; a segment ends when the clock restarts
    values: Array  # Finite values, shape ``(m,)``
    stride: int  # Grid numbers from one sample to the next; 1 unless the column is slower than its table
    even: bool  # Whether samples are ``stride`` numbers of an even clock apart, except for lost samples
    lost: Indices  # Number of samples lost between two samples, shape ``(m - 1,)``
    gaps: Mask  # Whether too many samples are lost, or the clock restarts, after a sample, shape ``(m - 1,)``

    @property
    def step_s(self) -> float:
        return self.stride * self.grid.step_s

    def stretches(self) -> list[tuple[int, int]]:
        """Return start and end position of each stretch without a gap."""
        return list(pairwise([0, *(int(gap) + 1 for gap in np.flatnonzero(self.gaps)), len(self.values)]))


def find_timelines(signals: Mapping[str, Signal], rules: TimeRules) -> tuple[list[ChannelTimeline], list[str]]:
    """Return one timeline per column, and the repairs of stamps, one sentence each."""
    timelines: list[ChannelTimeline] = []
    repairs: list[str] = []
    tables: dict[int, dict[str, Signal]] = {}
    for column, signal in signals.items():
        tables.setdefault(id(signal.time_s), {})[column] = signal
    for table in tables.values():
        values = {name: signal.values for name, signal in table.items()}
        blank = np.logical_and.reduce([~np.isfinite(column) for column in values.values()])
        stamps = order_stamps(next(iter(table.values())).time_s, blank)
        repairs += _with_subject(stamps.repairs, values, signals)
        for columns, together in _sampled_together(stamps, values):
            more, done = _timelines_of(stamps, columns, together, rules)
            timelines += more
            repairs += _with_subject(done, columns, signals)
    order = list(signals)
    return sorted(timelines, key=lambda timeline: order.index(timeline.column)), repairs


def _with_subject(repairs: Sequence[str], columns: Mapping[str, Array], signals: Mapping[str, Signal]) -> list[str]:
    of = "" if len(columns) == len(signals) else f" of {', '.join(name for name in signals if name in columns)}"
    return [f"time{of}: {repair}" for repair in repairs]


def _sampled_together(stamps: OrderedStamps, values: Mapping[str, Array]) -> list[tuple[dict[str, Array], Mask]]:
    """Group columns that share most of their rows; return each group with the mask of rows with any value."""
    ordered = {name: column[stamps.rows] for name, column in values.items()}
    valid = {name: np.isfinite(column) for name, column in ordered.items()}
    for name, rows in valid.items():
        _refuse_few(name, rows)
    groups: list[tuple[dict[str, Array], Mask]] = []
    for name in sorted(ordered, key=lambda name: -int(valid[name].sum())):
        for place, (columns, together) in enumerate(groups):
            if (valid[name] & together).sum() >= TOGETHER * valid[name].sum():
                groups[place] = ({**columns, name: ordered[name]}, together | valid[name])
                break
        else:
            groups.append(({name: ordered[name]}, valid[name]))
    return groups


def _refuse_few(column: str, valid: Mask) -> None:
    if valid.sum() < 3:
        found = f"{valid.sum()} finite values in {len(valid)} rows"
        raise RecordingError(f"{column} has {found}, expected at least 3; check its channel in the mapping")


def _timelines_of(
    stamps: OrderedStamps, columns: Mapping[str, Array], together: Mask, rules: TimeRules
) -> tuple[list[ChannelTimeline], list[str]]:
    part = OrderedStamps(stamps.time_s[together], stamps.rows[together], stamps.segments[together], ())
    values = [column[together] for column in columns.values()]
    time_s, keep, repairs = resolve_duplicates(part, values, rules)
    time_s, segments = time_s[keep], part.segments[keep]
    grid = find_grid(time_s, segments, rules)
    return [_timeline(name, grid, column[keep], rules) for name, column in zip(columns, values, strict=True)], repairs


def _timeline(column: str, grid: SampleGrid, values: Array, rules: TimeRules) -> ChannelTimeline:
    valid = np.isfinite(values)
    _refuse_few(column, valid)
    time_s, index, segments = grid.time_s[valid], grid.index[valid], grid.segments[valid]
    distances = np.diff(index)
    gap_before = np.concatenate([[0], np.cumsum(grid.gaps)])
    across = np.diff(gap_before[valid]) > 0
    stride = max(1, int(np.median(distances[~across]))) if not across.all() else 1
    samples = np.maximum(np.rint(distances / stride).astype(np.int64), 1)
    gaps = across | (samples > rules.longest_bridge_samples + 1)
    even = grid.even and not (distances[~gaps] % stride).any()
    lost = np.where(gaps, 0, samples - 1)
    return ChannelTimeline(column, grid, time_s, index, segments, values[valid], stride, even, lost, gaps)


def find_grid(time_s: Array, segments: Indices, rules: TimeRules) -> SampleGrid:
    """Find the grid of stamps that increase within each segment, shape ``(n,)``, with at least 2 stamps."""
    steps_s = np.diff(time_s)
    restarts = np.diff(segments) != 0
    usual_s = float(np.median(steps_s[~restarts])) if not restarts.all() else 1.0
    for step_s in (usual_s, _averaged_step(time_s, restarts)):
        if step_s is not None and (grid := _even_grid(time_s, segments, step_s, rules)) is not None:
            return grid
    return _uneven_grid(time_s, segments, usual_s, rules)


def _uneven_grid(time_s: Array, segments: Indices, usual_s: float, rules: TimeRules) -> SampleGrid:
    """Find the grid of a clock with jitter: its rate is that of whole stretches, from which single steps deviate."""
    steps_s, restarts = np.diff(time_s), np.diff(segments) != 0
    # Only steps without a lost sample count; otherwise 2 % of lost samples would turn 200 Hz into 199 Hz.
    single = steps_s[~restarts & (np.rint(steps_s / usual_s) == 1.0)] if usual_s > 0.0 else steps_s[:0]
    step_s = float(single.mean()) if len(single) else usual_s
    if len(single) and 2 * SHORT_BLOCK * single.std() > STEADY * step_s * math.sqrt(len(single)):
        # Single steps jitter too much: start as if no sample was lost between two gaps
        step_s = float(steps_s[~restarts & (steps_s < (rules.longest_bridge_samples + 2) * usual_s)].mean())
    for _ in range(PASSES):
        index, gaps = _numbered_with_jitter(time_s, restarts, step_s, rules)
        stretch = np.concatenate([[0], np.cumsum(gaps)])
        number_off, stamp_off = (
            each - (np.bincount(stretch, each) / np.bincount(stretch))[stretch] for each in (index, time_s)
        )
        spread = float((number_off**2).sum())
        if spread == 0.0:
            break
        step_s = float((number_off * stamp_off).sum()) / spread
        jitter_s = float(np.std(stamp_off - step_s * number_off))
    else:
        step_s = 1.0 / whole_hertz(1.0 / step_s, SURE * jitter_s / (step_s * math.sqrt(spread)))
    return SampleGrid(time_s, segments, step_s, False, index, gaps)


def _numbered_with_jitter(time_s: Array, restarts: Mask, step_s: float, rules: TimeRules) -> tuple[Indices, Mask]:
    """Number samples like ``_numbered``, but count a lost sample only if all later stamps are late by it.

    A late stamp lengthens one step and shortens the next. After a lost sample, even the earliest of the next stamps is
    late. Near the ends of a stretch there are too few stamps to tell; there, a step may be one sample too long.
    """
    steps_s = np.diff(time_s)
    samples = np.maximum(np.rint(steps_s / step_s), 1.0)
    unclear = ~restarts & (samples > 1) & (samples <= rules.longest_bridge_samples + 2)
    bounds = np.concatenate([[0], np.flatnonzero(restarts | (samples > 1) & ~unclear) + 1, [len(time_s)]])
    for start, end in pairwise(bounds):
        late_s = time_s[start:end] - step_s * np.arange(end - start)
        for place in np.flatnonzero(unclear[start : end - 1]) + 1:
            lost = samples[start + place - 1] - 2.0
            if SHORT_BLOCK <= place <= end - start - SHORT_BLOCK:
                earliest_s = (late_s[place - SHORT_BLOCK : place].min(), late_s[place : place + SHORT_BLOCK].min())
                lost = np.rint((earliest_s[1] - earliest_s[0]) / step_s)
            lost = max(float(lost), 0.0)
            late_s[place:] -= lost * step_s
            samples[start + place - 1] = lost + 1.0
    return _numbered(samples * step_s, restarts, step_s, rules)


def _averaged_step(time_s: Array, restarts: Mask) -> float | None:
    """Return the median step over short blocks, which average out the rounding of steps such as 3, 3, 4 ms."""
    block = min(SHORT_BLOCK, len(time_s) // 4)
    if block < 2:
        return None
    restarted = np.concatenate([[0], np.cumsum(restarts)])
    inside = restarted[block:] == restarted[:-block]
    slopes_s = (time_s[block:] - time_s[:-block])[inside] / block
    return float(np.median(slopes_s)) if len(slopes_s) else None


def _numbered(steps_s: Array, restarts: Mask, step_s: float, rules: TimeRules) -> tuple[Indices, Mask]:
    """Return sample numbers and gaps."""
    samples = np.maximum(np.rint(steps_s / step_s), 1.0)
    gaps = restarts | (samples > rules.longest_bridge_samples + 1)
    # Numbers continue after a gap as if it were one sample too long, so that they cannot become too large.
    samples[gaps] = rules.longest_bridge_samples + 2
    return np.concatenate([[0], np.cumsum(samples)]).astype(np.int64), gaps


def _even_grid(time_s: Array, segments: Indices, step_s: float, rules: TimeRules) -> SampleGrid | None:
    steps_s = np.diff(time_s)
    index, gaps = _numbered(steps_s, np.diff(segments) != 0, step_s, rules)
    if gaps.all():
        return None
    covered_s = float(steps_s[~gaps].sum())
    mean_s = covered_s / float(np.diff(index)[~gaps].sum())
    resolution_s = explaining_resolution(time_s, mean_s)
    tolerance_s = max(JITTER_SHARE * mean_s, 1.05 * resolution_s)
    bounds = np.concatenate([[0], np.flatnonzero(gaps) + 1, [len(time_s)]])
    for start, end in pairwise(bounds):
        if end - start > 1 and not follows_even_clock(time_s[start:end], index[start:end], mean_s, tolerance_s):
            return None
    step_s = 1.0 / whole_hertz(1.0 / mean_s, resolution_s / covered_s)
    return SampleGrid(time_s, segments, step_s, True, index, gaps)

"""Align sampled columns to pieces at one constant rate, and report lost samples and resampling."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import OIL_TEMPERATURE, TIME
from cylinder_friction.recordings.recording import (
    UNNAMED,
    Columns,
    Recording,
    RecordingError,
    RecordingMetadata,
    Signal,
    Start,
)
from cylinder_friction.recordings.timeline.channel_timelines import ChannelTimeline, find_timelines
from cylinder_friction.recordings.timeline.resampling import fill_lost, own_rate, sampled_at, uniform_segments
from cylinder_friction.recordings.timeline.timestamps import WHOLE_HERTZ, TimeRules, even_rate, whole_hertz
from cylinder_friction.wording import counted

Number = TypeVar("Number", int, float)
Placed = tuple[list[tuple[Columns, int]], dict[str, list[str]]]
"""Pieces with their segment of the clock, and the columns resampled by each method."""
HIGHEST_RATIO = 10.0  # Largest ratio of a wanted rate to the fastest channel's rate
SHORTEST_PIECE = 10  # Fewest samples of a stretch between two gaps that is used
MOST_SHORT = 0.01  # Largest share of the rows in shorter stretches that is not stated


class RowsLeftOut(str):
    """A repair that leaves rows out, which count as refused."""


def align(
    signals: Mapping[str, Signal], rules: TimeRules, about: RecordingMetadata = UNNAMED, start: Start | None = None
) -> list[Recording]:
    """Make a recording of each unbroken stretch of a file, at one constant rate, in the order of sampling.

    - Complete columns with even stamps of one clock at the wanted rate stay unchanged, stamps included.
    - Damaged stamps are repaired (``order_stamps``, ``resolve_duplicates``) or refused.
    - Lost samples (in the stamps, or NaN in a column): up to ``longest_bridge_samples`` in a row are interpolated
      (shape-preserving cubic) and reported; more split the whole recording. The other samples stay unchanged.
    - Columns with uneven stamps are interpolated (shape-preserving cubic) at the rate of all stamps, four digits of it.
    - Columns of other rates or phases are resampled with anti-aliasing (``windowed_sinc``). The grid has multiples of
      the sample time from the first stamp, over the time that all columns cover; nothing is extrapolated.

    The recordings contain no NaN and are not checked yet. ``time_s`` continues the logger's time, and restarts when the
    logger's clock did. ``start`` is when that clock was at 0 s, if it is known.
    """
    if (unchanged_hz := _rate_of_unchanged(signals, rules)) is not None:
        columns = {TIME: next(iter(signals.values())).time_s} | {name: each.values for name, each in signals.items()}
        return [_piece(columns, unchanged_hz, about, start)]
    timelines, repairs = find_timelines(signals, rules)
    restarts = sorted({int(timeline.grid.segments[-1]): timeline.column for timeline in timelines}.items())
    if len(restarts) > 1:
        (fewest, one), *_, (most, other) = restarts
        raise RecordingError(
            f"the clock of {one} restarts {counted(fewest, 'time')}, but the clock of {other} {counted(most, 'time')}, "
            "so that their samples cannot be matched; split the file where the logger was restarted"
        )
    rate_hz = _common_rate(timelines, rules)
    one_grid = all(each.grid is timelines[0].grid and each.even and each.stride == 1 for each in timelines)
    same_rate = one_grid and abs(rate_hz * timelines[0].step_s - 1.0) <= WHOLE_HERTZ
    pieces, methods = _on_logged_grid(timelines) if same_rate else _on_new_grid(timelines, rate_hz)
    repairs += _gap_note(timelines, rules)
    if not pieces:
        why = "; ".join(repairs) or "the columns do not overlap in time"
        raise RecordingError(
            f"has no stretch of {SHORTEST_PIECE} samples at {rate_hz:.6g} Hz without a gap in any column "
            f"({why}), expected at least one; log without gaps, or leave the column with the gaps out of the mapping"
        )
    short = max(([b - a for a, b in each.stretches() if b - a < SHORTEST_PIECE] for each in timelines), key=sum)
    if sum(short) > MOST_SHORT * len(timelines[0].values):
        stretches = f"{sum(short)} rows in {len(short)} stretches of fewer than {SHORTEST_PIECE} samples"
        repairs.append(RowsLeftOut(f"left out between gaps: {stretches}"))
    repairs += [*_edge_note(timelines, rate_hz), *_sentences(methods, len(timelines))]
    return [
        _piece(columns, rate_hz, about, start, segment, (*repairs, *_bridged_note(timelines, columns[TIME], segment)))
        for columns, segment in pieces
    ]


def _piece(
    columns: Columns,
    rate_hz: float,
    about: RecordingMetadata,
    start: Start | None,
    segment: int = 0,
    repairs: Sequence[str] = (),
) -> Recording:
    """Make a recording of columns, which is not checked yet. A start is valid until the clock restarts."""
    own = start if start is not None and (segment == 0 or start.dated_rows) else None
    about = replace(about, sample_time_s=1.0 / rate_hz, repairs=(*about.repairs, *repairs))
    if own is not None:
        about = replace(about, start=own.after(float(columns[TIME][0])).text(), start_source=own.source)
    return Recording.unchecked(about, columns)


def _rate_of_unchanged(signals: Mapping[str, Signal], rules: TimeRules) -> float | None:
    """Return the rate of columns that need no repair and no resampling [Hz]; None if they do."""
    time_s, *others = {id(signal.time_s): signal.time_s for signal in signals.values()}.values()
    one_clock = all(np.array_equal(time_s, other) for other in others)
    complete = one_clock and all(np.isfinite(signal.values).all() for signal in signals.values())
    rate_hz = even_rate(time_s) if complete else None
    if rate_hz is None:
        return None
    wanted_hz = whole_hertz(rate_hz) if rules.rate_hz is None else rules.rate_hz
    return wanted_hz if abs(wanted_hz - rate_hz) <= WHOLE_HERTZ * rate_hz else None


def _common_rate(timelines: Sequence[ChannelTimeline], rules: TimeRules) -> float:
    """Return the wanted rate, or that of the slowest column but oil temperature, which changes slowly [Hz]."""
    own_hz = {timeline.column: own_rate(timeline) for timeline in timelines}
    fast = [rate for column, rate in own_hz.items() if column != OIL_TEMPERATURE]
    rate_hz = min(fast or own_hz.values()) if rules.rate_hz is None else rules.rate_hz
    if rate_hz > HIGHEST_RATIO * max(own_hz.values()):
        raise RecordingError(
            f"cannot be resampled to {rate_hz:.6g} Hz: its fastest channel is sampled at {max(own_hz.values()):.6g} "
            f"Hz, expected at most {HIGHEST_RATIO:.0f} times that; lower rate_hz"
        )
    return rate_hz


def _on_logged_grid(timelines: Sequence[ChannelTimeline]) -> Placed:
    """Cut columns of one grid at their gaps, and interpolate lost samples."""
    grid = timelines[0].grid
    own = ([(int(each.index[a]), int(each.index[b - 1])) for a, b in each.stretches()] for each in timelines)
    pieces: list[tuple[Columns, int]] = []
    for first, last in reduce(_overlap, own):
        if last - first + 1 >= SHORTEST_PIECE:
            a, b = np.searchsorted(grid.index, [first, last + 1])
            numbers, time_s = np.arange(first, last + 1), grid.time_s[a:b]
            if len(time_s) < len(numbers):
                time_s = np.interp(numbers, grid.index, grid.time_s)
            columns = {TIME: time_s} | {each.column: _filled(each, numbers) for each in timelines}
            pieces.append((columns, int(grid.segments[a])))
    return pieces, {}


def _filled(timeline: ChannelTimeline, numbers: NDArray[np.int64]) -> Array:
    index = timeline.index
    a, b = np.searchsorted(index, [numbers[0], numbers[-1] + 1])
    if b - a == len(numbers):
        return timeline.values[a:b]
    # Include some samples beyond the piece up to the next gap, because its first or last sample may be lost.
    gaps = np.flatnonzero(timeline.gaps) + 1
    start = max(a - 3, *gaps[gaps <= a][-1:], 0)
    end = min(b + 3, *gaps[gaps > a][:1], len(index))
    filled = fill_lost(index[start:end], timeline.values[start:end])
    return filled[numbers[0] - index[start] :][: len(numbers)]


def _on_new_grid(timelines: Sequence[ChannelTimeline], rate_hz: float) -> Placed:
    """Resample columns at ``rate_hz``, on a grid from the first stamp of any column after each start of the clock."""
    pieces: list[tuple[Columns, int]] = []
    methods: dict[str, list[str]] = {}
    for segment, stamps in enumerate(_stamps_by_segment(timelines)):
        if len(stamps) < len(timelines):
            continue
        start_s = min(float(time_s[0]) for time_s in stamps)
        uniform = {each.column: uniform_segments(each, segment, start_s) for each in timelines}
        own = ([(each.first_s, each.last_s) for each in of_column] for of_column in uniform.values())
        for first_s, last_s in reduce(_overlap, own):
            # A stamp may miss its multiple of the sample time by rounding.
            first = int(np.ceil((first_s - start_s) * rate_hz - 1e-6))
            last = int(np.floor((last_s - start_s) * rate_hz + 1e-6))
            if last - first + 1 < SHORTEST_PIECE:
                continue
            columns = {TIME: start_s + np.arange(first, last + 1) / rate_hz}
            for column, of_column in uniform.items():
                covering = next(each for each in of_column if each.first_s <= first_s <= each.last_s)
                columns[column], method = sampled_at(covering, columns[TIME], rate_hz)
                if method and column not in methods.setdefault(method, []):
                    methods[method].append(column)
            pieces.append((columns, segment))
    return pieces, methods


def _stamps_by_segment(timelines: Sequence[ChannelTimeline]) -> list[list[Array]]:
    """List the stamps of the columns after each start of the clock, without columns that have none then."""
    segments = range(int(timelines[0].grid.segments[-1]) + 1)
    stamps = ([each.time_s[each.segments == segment] for each in timelines] for segment in segments)
    return [[time_s for time_s in own if len(time_s)] for own in stamps]


def _overlap(one: list[tuple[Number, Number]], other: list[tuple[Number, Number]]) -> list[tuple[Number, Number]]:
    """Intersect two lists of spans, each in order and without overlap."""
    result = []
    i = j = 0
    while i < len(one) and j < len(other):
        first, last = max(one[i][0], other[j][0]), min(one[i][1], other[j][1])
        if first <= last:
            result.append((first, last))
        if one[i][1] < other[j][1]:
            i += 1
        else:
            j += 1
    return result


def _sentences(done: Mapping[str, Sequence[str]], all_columns: int) -> list[str]:
    """Write a sentence for each repair; its subject is the columns concerned, or time if all columns are."""
    return [
        f"{'time' if len(columns) == all_columns else ', '.join(columns)}: {what}" for what, columns in done.items()
    ]


def _gap_note(timelines: Sequence[ChannelTimeline], rules: TimeRules) -> list[str]:
    """State the gaps that split the recording, and the columns without samples in the first gap."""
    gaps: dict[tuple[float, float], list[str]] = {}
    for each in timelines:
        for place in np.flatnonzero(each.gaps & (np.diff(each.segments) == 0)):
            gaps.setdefault((float(each.time_s[place]), float(each.time_s[place + 1])), []).append(each.column)
    if not gaps:
        return []
    before_s, after_s = min(gaps)
    columns = gaps[(before_s, after_s)]
    without = "" if len(columns) == len(timelines) else f" without {', '.join(columns)}"
    first = f"first: {after_s - before_s:.4g} s{without} after {before_s:.6g} s"
    most = counted(rules.longest_bridge_samples, "lost sample")
    return [f"time: split at {counted(len(gaps), 'gap')} of more than {most} ({first})"]


def _bridged_note(timelines: Sequence[ChannelTimeline], stamps_s: Array, segment: int) -> list[str]:
    """State how many lost samples of a piece were interpolated, for columns with the same lost samples together."""
    done: dict[str, list[str]] = {}
    for each in timelines:
        time_s, lost = each.time_s, np.flatnonzero(each.lost)
        within = (time_s[lost] < stamps_s[-1]) & (time_s[lost + 1] > stamps_s[0])
        lost = lost[within & (each.segments[lost] == segment)]
        if len(lost):
            text = (
                f"{counted(int(each.lost[lost].sum()), 'lost sample')} interpolated (at most {each.lost[lost].max()} "
                f"in a row, first after {time_s[lost[0]]:.6g} s)"
            )
            done.setdefault(text, []).append(each.column)
    return _sentences(done, len(timelines))


def _edge_note(timelines: Sequence[ChannelTimeline], rate_hz: float) -> list[str]:
    """State the time at both ends that only some of the columns cover."""
    starts_s = ends_s = 0.0
    for stamps in filter(None, _stamps_by_segment(timelines)):
        firsts, lasts = ([float(time_s[end]) for time_s in stamps] for end in (0, -1))
        everywhere = len(stamps) == len(timelines)
        starts_s += max(firsts) - min(firsts) if everywhere else 0.0
        ends_s += max(lasts) - min(lasts if everywhere else firsts)
    slowest_s = max(1.0 / rate_hz, *(each.step_s for each in timelines))
    if max(starts_s, ends_s) <= 1.5 * slowest_s:
        return []
    start, end = (f"{round(lost_s, 6):.4g} s" for lost_s in (starts_s, ends_s))
    return [f"time: {start} at the start and {end} at the end left out, not covered by every column"]

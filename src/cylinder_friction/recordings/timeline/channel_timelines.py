"""Find the timeline of each channel: its valid samples in order, each with a stamp and a number on a sample grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.recording import RecordingError, Signal
from cylinder_friction.recordings.timeline.stamp_repair import OrderedStamps, order_stamps, resolve_duplicates
from cylinder_friction.recordings.timeline.timestamps import (
    JITTER_SHARE,
    Indices,
    TimeRules,
    explaining_resolution,
    follows_even_clock,
    whole_hertz,
)

TOGETHER = 0.8
"""Least share of common rows of columns that were sampled together. Two raster rates of one table share at most half of
their rows, or the slower one shares all of its rows."""
SHORT_BLOCK = 32  # Samples over which a step is averaged if rounding hides single steps


@dataclass(frozen=True)
class SampleGrid:
    """Sample numbers of the stamps of columns that were sampled together."""

    time_s: Array  # Stamps in order, shape ``(n,)`` [s]
    segments: Indices  # Number of each stamp's segment, shape ``(n,)``; a segment ends when the clock restarts
    step_s: float  # Time between two samples [s]; if they are uneven, the median time
    even: bool  # Whether the stamps are those of an even clock, apart from lost samples
    index: Indices  # Sample number of each stamp, shape ``(n,)``; meaningless across a gap or a restart
    gaps: Mask  # Whether too many samples are lost after a stamp, or the clock restarts, shape ``(n - 1,)``


@dataclass(frozen=True)
class ChannelTimeline:
    """Valid samples of one column."""

    column: str  # Name of the column
    grid: SampleGrid  # The grid that it was sampled on
    at: Indices  # Index of each sample's stamp in the grid, shape ``(m,)``
    values: Array  # Finite values, shape ``(m,)``
    stride: int  # Grid numbers from one sample to the next; 1 unless the column is slower than its table
    even: bool  # Whether samples are ``stride`` numbers of an even clock apart, except for lost samples
    lost: Indices  # Number of samples lost between two samples, shape ``(m - 1,)``
    gaps: Mask  # Whether too many samples are lost, or the clock restarts, after a sample, shape ``(m - 1,)``

    @cached_property
    def time_s(self) -> Array:
        """Stamps of the samples, shape ``(m,)`` [s]."""
        return self.grid.time_s[self.at]

    @cached_property
    def index(self) -> Indices:
        """Numbers of the samples on the grid, shape ``(m,)``."""
        return self.grid.index[self.at]

    @cached_property
    def segments(self) -> Indices:
        """Number of each sample's segment, shape ``(m,)``; a segment ends when the clock restarts."""
        return self.grid.segments[self.at]

    @property
    def step_s(self) -> float:
        return self.stride * self.grid.step_s

    def stretches(self) -> list[tuple[int, int]]:
        """Return start and end position of each stretch without a gap."""
        return list(pairwise([0, *(int(gap) + 1 for gap in np.flatnonzero(self.gaps)), len(self.at)]))


def find_timelines(signals: Mapping[str, Signal], rules: TimeRules) -> tuple[list[ChannelTimeline], list[str]]:
    """Return one timeline per column, and the repairs of stamps, one sentence each.

    Raises:
        RecordingError: A clock cannot be put in order, or a column has fewer than three valid samples.
    """
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
    if len(time_s) < 3:
        raise RecordingError(f"has {len(time_s)} different time stamps, expected at least 3")
    grid = find_grid(time_s, segments, rules)
    return [_timeline(name, grid, column[keep], rules) for name, column in zip(columns, values, strict=True)], repairs


def _timeline(column: str, grid: SampleGrid, values: Array, rules: TimeRules) -> ChannelTimeline:
    valid = np.isfinite(values)
    at = np.flatnonzero(valid).astype(np.int64)
    _refuse_few(column, valid)
    distances = np.diff(grid.index[at])
    gap_before = np.concatenate([[0], np.cumsum(grid.gaps)])
    across = np.diff(gap_before[at]) > 0
    stride = max(1, int(np.median(distances[~across]))) if not across.all() else 1
    samples = np.maximum(np.rint(distances / stride).astype(np.int64), 1)
    gaps = across | (samples > rules.longest_bridge_samples + 1)
    even = grid.even and not (distances[~gaps] % stride).any()
    return ChannelTimeline(column, grid, at, values[valid], stride, even, np.where(gaps, 0, samples - 1), gaps)


def find_grid(time_s: Array, segments: Indices, rules: TimeRules) -> SampleGrid:
    """Find the grid of stamps that increase within each segment, shape ``(n,)``, with at least 2 stamps."""
    steps_s = np.diff(time_s)
    restarts = np.diff(segments) != 0
    usual_s = float(np.median(steps_s[~restarts])) if not restarts.all() else 1.0
    for step_s in (usual_s, _averaged_step(time_s, restarts)):
        if step_s is not None and (grid := _even_grid(time_s, segments, step_s, rules)) is not None:
            return grid
    # Only steps without a lost sample count; otherwise 2 % of lost samples would turn 200 Hz into 199 Hz.
    single = steps_s[~restarts & (np.rint(steps_s / usual_s) == 1.0)] if usual_s > 0.0 else steps_s[:0]
    step_s = float(np.median(single)) if len(single) else usual_s
    return SampleGrid(time_s, segments, step_s, False, *_numbered(steps_s, restarts, step_s, rules))


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

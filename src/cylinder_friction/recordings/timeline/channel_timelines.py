"""One track a column: its good samples in order, each with its stamp and its number on the clock of its table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.clock_order import OrderedStamps, order_stamps
from cylinder_friction.recordings.timeline.duplicate_timestamps import resolve_repeats
from cylinder_friction.recordings.timeline.sample_grid import Grid, find_grid

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.signal import Signal
    from cylinder_friction.recordings.timeline.time_rules import TimeRules

    Array = NDArray[np.float64]
    Indices = NDArray[np.int64]
    Mask = NDArray[np.bool_]

TOGETHER = 0.8
"""Columns that share this share of their rows were sampled together. Two raster rates of one table share half of their
rows at most, or the slower shares all of its own."""

ROUNDING = 1e-4
"""Stamps of two tables this close, as a share of a step, are one: 0.1 s + 37·0.001 s is not 137·0.001 s to the bit."""


@dataclass(frozen=True)
class Clock:
    """The clock of columns that were sampled together.

    Attributes:
        columns: Their names.
        time_s: Stamps in order, shape ``(n,)`` [s].
        segments: The clock restarted where this number changes, shape ``(n,)``.
        grid: Step, sample numbers and gaps.
    """

    columns: tuple[str, ...]
    time_s: Array
    segments: Indices
    grid: Grid


@dataclass(frozen=True)
class Track:
    """Good samples of one column.

    Attributes:
        column: Its name.
        clock: The clock it was sampled by.
        at: Which of the clock's stamps each sample has, shape ``(m,)``.
        values: Shape ``(m,)``, all finite.
        stride: Numbers of the clock's grid from one sample to the next; 1 unless the column is slower than its table.
        even: Whether its samples lie ``stride`` numbers apart, lost samples left aside, on an even clock.
        lost: Samples lost between one and the next, shape ``(m - 1,)``.
        gaps: Whether too many are lost to be bridged, or the clock restarts, shape ``(m - 1,)``.
    """

    column: str
    clock: Clock
    at: Indices
    values: Array
    stride: int
    even: bool
    lost: Indices
    gaps: Mask

    @cached_property
    def time_s(self) -> Array:
        """Stamps of the samples, shape ``(m,)`` [s]."""
        return self.clock.time_s[self.at]

    @cached_property
    def index(self) -> Indices:
        """Numbers of the samples on the clock's grid, shape ``(m,)``."""
        return self.clock.grid.index[self.at]

    @cached_property
    def segments(self) -> Indices:
        """The clock restarted where this number changes, shape ``(m,)``."""
        return self.clock.segments[self.at]

    @cached_property
    def lost_after(self) -> Indices:
        """Samples after which some were lost but can be bridged."""
        return np.flatnonzero(self.lost).astype(np.int64)

    @property
    def step_s(self) -> float:
        return self.stride * self.clock.grid.step_s


def find_tracks(signals: Mapping[str, Signal], rules: TimeRules) -> tuple[list[Track], list[str]]:
    """Return one track a column and what was done to the clocks, one sentence each.

    Raises:
        RecordingError: A clock cannot be put in order, or a column has fewer than three good samples.
    """
    tracks: list[Track] = []
    repairs: list[str] = []
    for table in _share_stamps(_tables(signals)):
        time_s, values = table
        blank = np.logical_and.reduce([~np.isfinite(column) for column in values.values()])
        stamps = order_stamps(time_s, blank, rules)
        repairs += _named(stamps.repairs, values, signals)
        for columns, together in _sampled_together(stamps, values):
            more, done = _tracks_of(stamps, columns, together, rules)
            tracks += more
            repairs += _named(done, columns, signals)
    order = list(signals)
    return sorted(tracks, key=lambda track: order.index(track.column)), repairs


def _named(repairs: Sequence[str], columns: Mapping[str, Array], signals: Mapping[str, Signal]) -> list[str]:
    where = (
        "time" if len(columns) == len(signals) else f"time of {', '.join(name for name in signals if name in columns)}"
    )
    return [f"{where}: {repair}" for repair in repairs]


def _tables(signals: Mapping[str, Signal]) -> list[tuple[Array, dict[str, Array]]]:
    tables: dict[int, tuple[Array, dict[str, Array]]] = {}
    for column, signal in signals.items():
        tables.setdefault(id(signal.time_s), (signal.time_s, {}))[1][column] = signal.values
    return list(tables.values())


def _share_stamps(tables: list[tuple[Array, dict[str, Array]]]) -> list[tuple[Array, dict[str, Array]]]:
    """Return tables of one clock (increasing stamps, most of them the same) as one table."""
    result: list[tuple[Array, dict[str, Array]]] = []
    for time_s, values in tables:
        for place, (other_s, others) in enumerate(result):
            union = _union(other_s, time_s)
            if union is not None:
                union_s, other_rows, rows = union
                filled = {name: _placed(column, other_rows, len(union_s)) for name, column in others.items()}
                filled |= {name: _placed(column, rows, len(union_s)) for name, column in values.items()}
                result[place] = (union_s, filled)
                break
        else:
            result.append((time_s, dict(values)))
    return result


def _union(one_s: Array, other_s: Array) -> tuple[Array, Indices, Indices] | None:
    """Return the stamps of two tables as one, and the row of each table's stamps in it; None for two clocks.

    Stamps within ``ROUNDING`` of a step are the same one: two tables may add up their steps from different starts. A
    slower table keeps its clock though its stamps are all among the other's: a gap in one is then none in the other.
    """
    if not ((one_s[1:] > one_s[:-1]).all() and (other_s[1:] > other_s[:-1]).all()):
        return None
    both_s = np.concatenate([one_s, other_s])
    order = np.argsort(both_s, kind="stable")
    step_s = min(float(np.median(np.diff(one_s))), float(np.median(np.diff(other_s))))
    new = np.concatenate([[True], np.diff(both_s[order]) > ROUNDING * step_s])
    rows = np.empty(len(both_s), dtype=np.int64)
    rows[order] = np.cumsum(new) - 1
    one_rows, other_rows = rows[: len(one_s)], rows[len(one_s) :]
    # Two stamps of one table that became one are no rounding.
    if not (np.diff(one_rows).all() and np.diff(other_rows).all()):
        return None
    common = len(both_s) - int(new.sum())
    return (both_s[order][new], one_rows, other_rows) if common >= TOGETHER * max(len(one_s), len(other_s)) else None


def _placed(values: Array, rows: Indices, length: int) -> Array:
    result = np.full(length, np.nan)
    result[rows] = values
    return result


def _sampled_together(stamps: OrderedStamps, values: Mapping[str, Array]) -> list[tuple[dict[str, Array], Mask]]:
    """Return columns that share most of their rows, and the rows where any of them has a value, in order."""
    ordered = {name: column[stamps.rows] for name, column in values.items()}
    counts: dict[str, tuple[int, Mask]] = {}
    for name, column in ordered.items():
        good = np.isfinite(column)
        counts[name] = (int(good.sum()), good)
        if counts[name][0] < 3:
            raise RecordingError(
                f"{name} has {counts[name][0]} finite values in {len(column)} rows, expected at least 3; "
                "check its channel in the mapping"
            )
    groups: list[tuple[dict[str, Array], Mask]] = []
    for name in sorted(ordered, key=lambda name: -counts[name][0]):
        count, good = counts[name]
        for place, (columns, together) in enumerate(groups):
            if (good & together).sum() >= TOGETHER * count:
                groups[place] = ({**columns, name: ordered[name]}, together | good)
                break
        else:
            groups.append(({name: ordered[name]}, good))
    return groups


def _tracks_of(
    stamps: OrderedStamps, columns: Mapping[str, Array], together: Mask, rules: TimeRules
) -> tuple[list[Track], list[str]]:
    part = OrderedStamps(stamps.time_s[together], stamps.rows[together], stamps.segments[together], ())
    values = [column[together] for column in columns.values()]
    time_s, keep, repairs = resolve_repeats(part, values, rules)
    time_s, segments = time_s[keep], part.segments[keep]
    if len(time_s) < 3:
        raise RecordingError(f"has {len(time_s)} different time stamps, expected at least 3")
    clock = Clock(tuple(columns), time_s, segments, find_grid(time_s, segments, rules))
    return [_track(name, clock, column[keep], rules) for name, column in zip(columns, values, strict=True)], repairs


def _track(column: str, clock: Clock, values: Array, rules: TimeRules) -> Track:
    good = np.isfinite(values)
    at = np.flatnonzero(good).astype(np.int64)
    if len(at) < 3:
        raise RecordingError(
            f"{column} has {len(at)} finite values in {len(values)} rows, expected at least 3; check its channel in "
            "the mapping"
        )
    numbers = clock.grid.index[at]
    apart = np.diff(numbers)
    gap_before = np.concatenate([[0], np.cumsum(clock.grid.gaps)])
    across = np.diff(gap_before[at]) > 0
    stride = max(1, int(np.median(apart[~across]))) if not across.all() else 1
    samples = np.maximum(np.rint(apart / stride).astype(np.int64), 1)
    gaps = across | (samples > rules.longest_bridge_samples + 1)
    even = clock.grid.even and not (apart[~gaps] % stride).any()
    return Track(column, clock, at, values[good], stride, even, np.where(gaps, 0, samples - 1), gaps)

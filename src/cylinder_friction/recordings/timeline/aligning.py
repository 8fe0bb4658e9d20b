"""From columns as they were sampled to pieces at one constant rate; nothing is bridged or moved without a word."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.signal import Piece
from cylinder_friction.recordings.timeline.aligning_notes import bridged_note, edge_note, gap_note, said_of
from cylinder_friction.recordings.timeline.channel_timelines import Track, find_tracks
from cylinder_friction.recordings.timeline.clock import WHOLE_HERTZ, even_rate, whole_hertz
from cylinder_friction.recordings.timeline.resampling import fill_lost
from cylinder_friction.recordings.timeline.uniform_segments import EvenRun, even_runs, own_rate, sampled_at

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.signal import Signal
    from cylinder_friction.recordings.timeline.time_rules import TimeRules

    Array = NDArray[np.float64]
    Spans = list[tuple[float, float]]

SLOW_COLUMNS = ("oil_temperature_c",)
"""Changes over minutes: logged once a second, it does not set the rate of the others."""

HIGHEST_RATIO = 10.0
"""A rate more than this many times that of the fastest channel is a mistake."""


def align(signals: Mapping[str, Signal], rules: TimeRules) -> list[Piece]:
    """Return the unbroken stretches of a file, each at one constant rate, in the order they were sampled.

    - Columns with even stamps of one clock, nothing missing, at the wanted rate: as they are, stamps included.
    - Damaged stamps are put right (``order_stamps``, ``resolve_repeats``) or refused.
    - Lost samples, by the stamps or as NaN in a column: up to ``longest_bridge_samples`` in a row are interpolated
      (shape-preserving cubic) and said; more split the whole recording. The other samples stay as they are.
    - Uneven stamps: shape-preserving cubic onto an even grid of the median rate, rounded to three digits.
    - Other rates or phases: windowed sinc, anti-aliasing included (``windowed_sinc``). The grid runs in multiples of
      the sample time from the first stamp, over the time that every column covers; nothing is extrapolated.

    Args:
        signals: Columns; those of one logged table share their ``time_s`` array.
        rules: The wanted rate and what may be repaired.

    Returns:
        Pieces, at least one. ``time_s`` continues the logger's time, and starts anew where its clock did.

    Raises:
        RecordingError: The stamps cannot be put in order, a column has no samples, or no stretch is long enough.
    """
    _check(signals)
    untouched = _as_it_is(signals, rules)
    if untouched is not None:
        return [untouched]
    tracks, repairs = find_tracks(signals, rules)
    _check_segments(tracks)
    own_hz = [own_rate(track) for track in tracks]
    rate_hz = _common_rate(tracks, own_hz) if rules.rate_hz is None else rules.rate_hz
    if rate_hz > HIGHEST_RATIO * max(own_hz):
        raise RecordingError(
            f"cannot be resampled to {rate_hz:.6g} Hz: its fastest channel is sampled at {max(own_hz):.6g} Hz, "
            f"expected at most {HIGHEST_RATIO:.0f} times that; lower rate_hz"
        )
    one_grid = all(track.clock is tracks[0].clock and track.even and track.stride == 1 for track in tracks)
    if one_grid and abs(rate_hz * tracks[0].step_s - 1.0) <= WHOLE_HERTZ:
        pieces, more, short = _on_logged_grid(tracks, rate_hz, rules)
    else:
        pieces, more, short = _on_new_grid(tracks, rate_hz, rules)
    if not pieces:
        why = "; ".join([*repairs, *gap_note(tracks, rules)]) or "the columns do not overlap in time"
        raise RecordingError(
            f"has no stretch of {rules.shortest_piece_samples} samples at {rate_hz:.6g} Hz without a gap in any column "
            f"({why}), expected at least one; log without gaps, or leave the column with the gaps out of the mapping"
        )
    whole = (*repairs, *gap_note(tracks, rules), *edge_note(tracks, rate_hz), *_short_note(short, rules), *more)
    return [Piece(piece.table, piece.sample_time_s, (*whole, *piece.repairs)) for piece in pieces]


def _common_rate(tracks: Sequence[Track], own_hz: Sequence[float]) -> float:
    """Return the rate of the slowest channel that matters [Hz]."""
    fast = [rate for track, rate in zip(tracks, own_hz, strict=True) if track.column not in SLOW_COLUMNS]
    return min(fast or own_hz)


def _check(signals: Mapping[str, Signal]) -> None:
    if not signals:
        raise RecordingError("has no columns, expected at least one; map its channels")
    for column, signal in signals.items():
        if signal.time_s.shape != signal.values.shape or signal.values.ndim != 1:
            raise ValueError(
                f"{column}: expected one time stamp a value, but got shapes {signal.time_s.shape} and "
                f"{signal.values.shape}"
            )
        if len(signal.values) < 3:
            raise RecordingError(f"has {len(signal.values)} rows, expected at least 3")
        if not np.isfinite(signal.values).any():
            raise RecordingError(
                f"{column} has no finite value in {len(signal.values)} rows, expected at least 3; check its channel in "
                "the mapping"
            )


def _as_it_is(signals: Mapping[str, Signal], rules: TimeRules) -> Piece | None:
    """Return columns that need nothing done, not copied; None if they need something."""
    clocks = {id(signal.time_s): signal.time_s for signal in signals.values()}
    time_s, *others = clocks.values()
    if not all(np.array_equal(time_s, other) for other in others):
        return None
    if not all(np.isfinite(signal.values).all() for signal in signals.values()):
        return None
    rate_hz = even_rate(time_s, rules.jitter_share)
    if rate_hz is None:
        return None
    wanted_hz = whole_hertz(rate_hz) if rules.rate_hz is None else rules.rate_hz
    if abs(wanted_hz - rate_hz) > WHOLE_HERTZ * rate_hz:
        return None
    return _piece(time_s, {column: signal.values for column, signal in signals.items()}, wanted_hz, ())


def _piece(time_s: Array, columns: Mapping[str, Array], rate_hz: float, repairs: Sequence[str]) -> Piece:
    table = pd.DataFrame({"time_s": time_s, **columns}, copy=False)
    return Piece(table, 1.0 / rate_hz, tuple(repairs))


def _check_segments(tracks: Sequence[Track]) -> None:
    restarts = {int(track.clock.segments[-1]): track.column for track in tracks}
    if len(restarts) > 1:
        (fewest, one), *_, (most, other) = sorted(restarts.items())
        raise RecordingError(
            f"the clock restarts {fewest} times in the table of {one} and {most} times in that of {other}, expected "
            "as often in each; split the file where the logger was restarted"
        )


def _on_logged_grid(tracks: Sequence[Track], rate_hz: float, rules: TimeRules) -> tuple[list[Piece], list[str], Spans]:
    """Return pieces whose samples stay as they are but for the bridged ones, and stretches that were too short."""
    clock = tracks[0].clock
    spans: Spans = [(-np.inf, np.inf)]
    for track in tracks:
        spans = _both(spans, [(float(track.index[a]), float(track.index[b - 1])) for a, b in runs_of(track)])
    pieces, short = [], []
    for first, last in ((int(a), int(b)) for a, b in spans):
        a, b = np.searchsorted(clock.grid.index, [first, last + 1])
        if last - first + 1 < rules.shortest_piece_samples:
            if b > a:
                short.append((float(clock.time_s[a]), float(clock.time_s[b - 1])))
            continue
        numbers = np.arange(first, last + 1)
        time_s = clock.time_s[a:b]
        if len(time_s) < len(numbers):
            time_s = np.interp(numbers, clock.grid.index, clock.time_s)
        columns = {track.column: _filled(track, numbers) for track in tracks}
        repairs = bridged_note(tracks, float(time_s[0]), float(time_s[-1]), int(clock.segments[a]))
        pieces.append(_piece(time_s, columns, rate_hz, repairs))
    return pieces, [], short


def _filled(track: Track, numbers: NDArray[np.int64]) -> Array:
    index = track.index
    a, b = np.searchsorted(index, [numbers[0], numbers[-1] + 1])
    if b - a == len(numbers):
        return track.values[a:b]
    # A few samples beyond the piece, this side of the next gap: its first or last sample may be a lost one here.
    gaps = np.flatnonzero(track.gaps) + 1
    start = max(a - 3, *gaps[gaps <= a][-1:], 0)
    end = min(b + 3, *gaps[gaps > a][:1], len(index))
    filled = fill_lost(index[start:end], track.values[start:end])
    return filled[numbers[0] - index[start] :][: len(numbers)]


def _on_new_grid(tracks: Sequence[Track], rate_hz: float, rules: TimeRules) -> tuple[list[Piece], list[str], Spans]:
    """Return pieces on the grid of ``rate_hz``, how each column got there, and stretches that were too short."""
    segments = int(tracks[0].clock.segments[-1]) + 1
    pieces: list[Piece] = []
    short: Spans = []
    methods: dict[str, list[str]] = {}
    for segment in range(segments):
        firsts = [track.time_s[track.segments == segment] for track in tracks]
        if not all(len(first) for first in firsts):
            continue
        start_s = min(float(first[0]) for first in firsts)
        runs = {track.column: even_runs(track, segment, start_s, runs_of(track)) for track in tracks}
        spans: Spans = [(-np.inf, np.inf)]
        for of_column in runs.values():
            spans = _both(spans, [(run.first_s, run.last_s) for run in of_column])
        for first_s, last_s in spans:
            # A stamp may miss its multiple of the sample time by rounding.
            first = int(np.ceil((first_s - start_s) * rate_hz - 1e-6))
            last = int(np.floor((last_s - start_s) * rate_hz + 1e-6))
            if last - first + 1 < rules.shortest_piece_samples:
                short.append((first_s, last_s))
                continue
            time_s = start_s + np.arange(first, last + 1) / rate_hz
            columns: dict[str, Array] = {}
            for column, of_column in runs.items():
                columns[column], method = sampled_at(_covering(of_column, first_s), time_s, rate_hz, rules)
                if method and column not in methods.setdefault(method, []):
                    methods[method].append(column)
            repairs = bridged_note(tracks, first_s, last_s, segment)
            pieces.append(_piece(time_s, columns, rate_hz, repairs))
    done = [said_of(columns, len(tracks), method) for method, columns in methods.items()]
    return pieces, done, short


def _covering(runs: Sequence[EvenRun], first_s: float) -> EvenRun:
    return next(run for run in runs if run.first_s <= first_s <= run.last_s)


def runs_of(track: Track) -> list[tuple[int, int]]:
    """Return start and end position of each stretch of a track without a gap."""
    bounds = [0, *(int(gap) + 1 for gap in np.flatnonzero(track.gaps)), len(track.at)]
    return list(pairwise(bounds))


def _both(one: Spans, other: Spans) -> Spans:
    """Return where both lie; each list is in order and without overlap."""
    result: Spans = []
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


def _short_note(short: Spans, rules: TimeRules) -> list[str]:
    if not short:
        return []
    stretches = "1 stretch" if len(short) == 1 else f"{len(short)} stretches"
    return [
        f"time: {stretches} of fewer than {rules.shortest_piece_samples} samples between gaps left out (first: "
        f"{short[0][0]:.6g} to {short[0][1]:.6g} s)"
    ]

"""A stretch of one column on an even grid of its own, and its values at other instants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.timeline.clock import BLOCK, WHOLE_HERTZ, whole_hertz
from cylinder_friction.recordings.timeline.resampling import CUT_OFF, fill_lost, shape_preserving_cubic, windowed_sinc

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.recordings.timeline.channel_timelines import Track
    from cylinder_friction.recordings.timeline.time_rules import TimeRules

    Array = NDArray[np.float64]

ON_THE_LINE = 1e-3
"""A stretch whose stamps follow one straight line this closely, as a share of a step, is read off that line."""


@dataclass(frozen=True)
class EvenRun:
    """Even samples of one column without a gap.

    Attributes:
        values: Shape ``(n,)``.
        knot_s: Instants at which the sample number is known, increasing, two or more [s].
        knot_number: Sample number at these, from 0, fractions allowed.
        rate_hz: Rate of the samples [Hz].
        first_s: Instant of the first sample [s].
        last_s: Instant of the last sample [s].
        method: How uneven stamps became even, empty if they were.
    """

    values: Array
    knot_s: Array
    knot_number: Array
    rate_hz: float
    first_s: float
    last_s: float
    method: str = ""


def own_rate(track: Track) -> float:
    """Return the rate of a column [Hz]: whole if within 1e-4 of whole.

    Where stamps are uneven, the median rate to three digits, or to a whole number from 100 Hz on: the files of one
    logger are to share a rate.
    """
    rate_hz = whole_hertz(1.0 / track.step_s)
    if track.even:
        return rate_hz
    return float(round(rate_hz)) if rate_hz >= 100.0 else float(f"{rate_hz:.3g}")


def even_runs(track: Track, segment: int, start_s: float, runs: Sequence[tuple[int, int]]) -> list[EvenRun]:
    """Return the stretches of a column in one segment of its clock, in order; uneven ones on an even grid.

    Args:
        track: The column.
        segment: Between two restarts of the clock.
        start_s: Uneven stretches come to lie on multiples of their sample time from here [s].
        runs: Start and end position of the track's stretches without a gap.
    """
    result = []
    for a, b in runs:
        if track.segments[a] != segment or b - a < 2:
            continue
        run = _even(track, a, b) if track.even else _made_even(track, a, b, start_s)
        if run is not None:
            result.append(run)
    return result


def sampled_at(run: EvenRun, time_s: Array, rate_hz: float, rules: TimeRules) -> tuple[Array, str]:
    """Return the values at even instants within the run, shape ``(m,)``, and how they were got; empty if as logged."""
    numbers = np.clip(_number_at(run, time_s), 0.0, len(run.values) - 1.0)
    nearest = np.rint(numbers).astype(np.int64)
    on_samples = np.abs(numbers - nearest).max() <= max(rules.jitter_share, 1e-6)
    if on_samples and (np.diff(nearest) == 1).all():
        return run.values[nearest], run.method
    lower_hz = min(rate_hz, run.rate_hz)
    change = (
        f"resampled from {run.rate_hz:.6g} to {rate_hz:.6g} Hz"
        if abs(run.rate_hz - rate_hz) > WHOLE_HERTZ * rate_hz
        else f"moved by part of a sample at {rate_hz:.6g} Hz"
    )
    method = f"{change} (windowed sinc, cut-off {CUT_OFF * lower_hz:.4g} Hz)"
    values = windowed_sinc(run.values, numbers, rate_hz / run.rate_hz)
    return values, f"{run.method}, then {method}" if run.method else method


def _number_at(run: EvenRun, time_s: Array) -> Array:
    """Return sample numbers, straight between the knots and straight on beyond them."""
    numbers: Array = np.interp(time_s, run.knot_s, run.knot_number)
    for beyond, edge, end in ((time_s < run.knot_s[0], 0, 1), (time_s > run.knot_s[-1], -1, -2)):
        slope = (run.knot_number[edge] - run.knot_number[end]) / (run.knot_s[edge] - run.knot_s[end])
        numbers[beyond] = run.knot_number[edge] + slope * (time_s[beyond] - run.knot_s[edge])
    return numbers


def _even(track: Track, a: int, b: int) -> EvenRun:
    time_s = track.time_s[a:b]
    numbers = (track.index[a:b] - track.index[a]) // track.stride
    values = fill_lost(numbers, track.values[a:b])
    knot_s, knot_number = _knots(time_s, numbers, track.step_s)
    rate_hz = own_rate(track)
    return EvenRun(values, knot_s, knot_number, rate_hz, float(time_s[0]), float(time_s[-1]))


def _knots(time_s: Array, numbers: NDArray[np.int64], step_s: float) -> tuple[Array, Array]:
    """Return instants and sample numbers of the line through all stamps, or of blocks of them if it drifts."""
    middle, middle_s = float(numbers.mean()), float(time_s.mean())
    off = numbers - middle
    slope_s = float((off * (time_s - middle_s)).sum() / (off**2).sum())
    line_s = np.asarray(middle_s + slope_s * off, dtype=np.float64)
    blocks = len(time_s) // BLOCK
    if blocks < 3 or np.abs(time_s - line_s).max() <= ON_THE_LINE * step_s:
        return line_s[[0, -1]], numbers[[0, -1]].astype(np.float64)
    parts = np.array_split(np.arange(len(time_s)), blocks)
    knot_s = np.array([float(time_s[part].mean()) for part in parts])
    return knot_s, np.array([float(numbers[part].mean()) for part in parts])


def _made_even(track: Track, a: int, b: int, start_s: float) -> EvenRun | None:
    time_s, rate_hz = track.time_s[a:b], own_rate(track)
    first = int(np.ceil((time_s[0] - start_s) * rate_hz - 1e-6))
    last = int(np.floor((time_s[-1] - start_s) * rate_hz + 1e-6))
    if last - first < 1:
        return None
    grid_s = start_s + np.arange(first, last + 1) / rate_hz
    values = shape_preserving_cubic(time_s, track.values[a:b], grid_s)
    steps_s = np.diff(track.time_s)[~track.gaps]
    method = (
        f"resampled from uneven stamps ({1e3 * steps_s.min():.4g} to {1e3 * steps_s.max():.4g} ms) to "
        f"{rate_hz:.6g} Hz (shape-preserving cubic)"
    )
    knot_number = np.array([0.0, float(last - first)])
    first_s, last_s = max(float(grid_s[0]), float(time_s[0])), min(float(grid_s[-1]), float(time_s[-1]))
    return EvenRun(values, grid_s[[0, -1]], knot_number, rate_hz, first_s, last_s, method)

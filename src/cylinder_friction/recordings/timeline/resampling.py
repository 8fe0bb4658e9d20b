"""Resample channels: make uniform segments, and compute their values at other instants."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.timeline.channel_timelines import ChannelTimeline
from cylinder_friction.recordings.timeline.timestamps import BLOCK, JITTER_SHARE, WHOLE_HERTZ, whole_hertz

ON_THE_LINE = 1e-3  # Largest deviation of stamps from a straight line that replaces them, as a share of a step


def shape_preserving_cubic(at: Array, values: Array, wanted: Array) -> Array:
    """Interpolate between two or more samples at increasing positions without overshoot, shape ``(m,)``.

    Beyond the first or last sample, that sample is returned.

    Source: Fritsch and Carlson 1980, Monotone piecewise cubic interpolation; slopes after Fritsch and Butland 1984.
    """
    inside = np.clip(wanted, at[0], at[-1])
    # Scale positions to steps of one from the first sample, because divided differences of small steps lose digits.
    step = (at[-1] - at[0]) / (len(at) - 1)
    from scipy.interpolate import PchipInterpolator  # slow to import, and even stamps do not need it

    result: Array = PchipInterpolator((at - at[0]) / step, values)((inside - at[0]) / step)
    return result


def fill_lost(numbers: NDArray[np.int64], values: Array) -> Array:
    """Return one value per sample number; lost samples are interpolated (shape-preserving cubic)."""
    if numbers[-1] - numbers[0] + 1 == len(numbers):
        return values
    filled = np.full(int(numbers[-1] - numbers[0]) + 1, np.nan)
    filled[numbers - numbers[0]] = values
    lost = np.setdiff1d(np.arange(numbers[0], numbers[-1]), numbers)
    # The cubic depends on two samples on either side only.
    beside = np.searchsorted(numbers, lost)[:, None] + np.arange(-3, 3)
    used = np.unique(np.clip(beside, 0, len(numbers) - 1))
    filled[lost - numbers[0]] = shape_preserving_cubic(numbers[used] * 1.0, values[used], lost * 1.0)
    return filled


@dataclass(frozen=True)
class UniformSegment:
    """Uniformly sampled values of one column, without a gap."""

    values: Array  # Values, shape ``(n,)``
    knot_s: Array  # Two or more increasing instants at which the sample number is known [s]
    knot_number: Array  # Sample number at these instants, from 0; fractions are allowed
    rate_hz: float  # Rate of the samples [Hz]
    # first_s, last_s: Instants of the first and the last sample [s]
    first_s: float
    last_s: float
    method: str = ""  # How uneven stamps were made uniform; empty if they were uniform


def own_rate(timeline: ChannelTimeline) -> float:
    """Return a column's rate [Hz], whole within 1e-4; of uneven stamps rounded to four digits."""
    rate_hz = whole_hertz(1.0 / timeline.step_s)
    return rate_hz if timeline.even else float(f"{rate_hz:.4g}")


def uniform_segments(timeline: ChannelTimeline, segment: int, start_s: float) -> list[UniformSegment]:
    """List a column's gapless stretches in one segment; uneven ones at multiples of its step from ``start_s``."""
    result = []
    for a, b in timeline.stretches():
        if timeline.segments[a] == segment and b - a >= 2:
            uniform = _as_sampled(timeline, a, b) if timeline.even else _made_uniform(timeline, a, b, start_s)
            result += [] if uniform is None else [uniform]
    return result


def sampled_at(segment: UniformSegment, time_s: Array, rate_hz: float) -> tuple[Array, str]:
    """Return values at uniform instants in the segment, shape ``(m,)``, and the method; empty if as logged."""
    knot_s, knot_number = segment.knot_s, segment.knot_number
    numbers: Array = np.interp(time_s, knot_s, knot_number)
    for beyond, edge, end in ((time_s < knot_s[0], 0, 1), (time_s > knot_s[-1], -1, -2)):
        slope = (knot_number[edge] - knot_number[end]) / (knot_s[edge] - knot_s[end])
        numbers[beyond] = knot_number[edge] + slope * (time_s[beyond] - knot_s[edge])
    numbers = np.clip(numbers, 0.0, len(segment.values) - 1.0)
    nearest = np.rint(numbers).astype(np.int64)
    on_samples = np.abs(numbers - nearest).max() <= JITTER_SHARE
    if on_samples and (np.diff(nearest) == 1).all():
        return segment.values[nearest], segment.method
    from cylinder_friction.recordings.timeline.windowed_sinc import CUT_OFF, windowed_sinc  # Numba

    change = (
        f"resampled from {segment.rate_hz:.6g} to {rate_hz:.6g} Hz"
        if abs(segment.rate_hz - rate_hz) > WHOLE_HERTZ * rate_hz
        else f"moved by part of a sample at {rate_hz:.6g} Hz"
    )
    method = f"{change} (windowed sinc, cut-off {CUT_OFF * min(rate_hz, segment.rate_hz):.4g} Hz)"
    values = windowed_sinc(segment.values, numbers, rate_hz / segment.rate_hz)
    return values, f"{segment.method}, then {method}" if segment.method else method


def _as_sampled(timeline: ChannelTimeline, a: int, b: int) -> UniformSegment:
    time_s = timeline.time_s[a:b]
    numbers = (timeline.index[a:b] - timeline.index[a]) // timeline.stride
    knots = _knots(time_s, numbers, timeline.step_s)
    values = fill_lost(numbers, timeline.values[a:b])
    return UniformSegment(values, *knots, own_rate(timeline), float(time_s[0]), float(time_s[-1]))


def _knots(time_s: Array, numbers: NDArray[np.int64], step_s: float) -> tuple[Array, Array]:
    """Return instants and sample numbers on a line through all stamps, or blocks of them if the clock drifts."""
    middle, middle_s = float(numbers.mean()), float(time_s.mean())
    off = numbers - middle
    slope_s = float((off * (time_s - middle_s)).sum() / (off**2).sum())
    line_s = np.asarray(middle_s + slope_s * off, dtype=np.float64)
    blocks = len(time_s) // BLOCK
    if blocks < 3 or np.abs(time_s - line_s).max() <= ON_THE_LINE * step_s:
        return line_s[[0, -1]], numbers[[0, -1]].astype(np.float64)
    knot_s, knot_number = (np.array([p.mean() for p in np.array_split(each, blocks)]) for each in (time_s, numbers))
    return knot_s, knot_number


def _made_uniform(timeline: ChannelTimeline, a: int, b: int, start_s: float) -> UniformSegment | None:
    time_s, rate_hz = timeline.time_s[a:b], own_rate(timeline)
    first = int(np.ceil((time_s[0] - start_s) * rate_hz - 1e-6))
    last = int(np.floor((time_s[-1] - start_s) * rate_hz + 1e-6))
    if last - first < 1:
        return None
    grid_s = start_s + np.arange(first, last + 1) / rate_hz
    values = shape_preserving_cubic(time_s, timeline.values[a:b], grid_s)
    steps_s = np.diff(timeline.time_s)[~timeline.gaps]
    method = (
        f"resampled from uneven stamps ({1e3 * steps_s.min():.4g} to {1e3 * steps_s.max():.4g} ms) to "
        f"{rate_hz:.6g} Hz (shape-preserving cubic)"
    )
    first_s, last_s = max(float(grid_s[0]), float(time_s[0])), min(float(grid_s[-1]), float(time_s[-1]))
    return UniformSegment(
        values, grid_s[[0, -1]], np.array([0.0, float(last - first)]), rate_hz, first_s, last_s, method
    )

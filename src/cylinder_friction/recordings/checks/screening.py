"""Single samples that no sensor can have read: out of its range, at the end of it, spikes, infinities.

Works on signals as they were logged, before any resampling: a filter would smear one bad sample over its neighbours.
What is bad for a few rows becomes NaN, a missing sample, and is reported; for many it makes the file unusable.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask, true_runs
from cylinder_friction.recordings.checks.limits import spoken
from cylinder_friction.recordings.mapping.channel_mapping import SensorLimits
from cylinder_friction.recordings.recording import RecordingError, Signal, expect

INFINITE, OUT_OF_RANGE, AT_ITS_END, SPIKE = "infinite", "out of range", "at its end", "spike"
KINDS = {
    OUT_OF_RANGE: (
        ", which a sensor of {range} cannot read",
        "check wire, range and unit of the sensor in the mapping",
    ),
    AT_ITS_END: (
        ", the end of its sensor's range of {range}: the sensor is saturated",
        "use a sensor with a wider range, or correct the range in the mapping",
    ),
    SPIKE: (
        ", a spike: its neighbours agree with each other and not with it",
        "check wire, shielding and supply of the sensor",
    ),
    INFINITE: (", expected finite numbers", "check the channel and how it was exported"),
}
"""What is wrong with a bad sample of each kind, and what to do about it."""

PLACES = 4096  # A signal's own scale is estimated from at most this many samples
BESIDE = 5  # A sample is compared with this many on either side
MOST_ODD = 3  # Of those 11 samples this many may be odd: four in a row are an event, not a spike
QUIET = 0.1  # The others lie within this share of a spike's height; after a pressure surge they settle elsewhere


@dataclass(frozen=True)
class ScreenRules:
    """When a sample is bad, and how many may be."""

    # How far beyond the sensor's range a reading may lie, as a share of its span: 4-20 mA is live from 3.2 to 20.8 mA,
    # close to what NAMUR NE 43 takes for the limits of a failure
    overrange: float = 0.05
    most_bad: float = 1e-3  # Share of a signal's rows that may be bad in one way; more make the file unusable
    few_rows: int = 5  # As many may be bad however short the signal is
    longest_bad: int = 10  # More rows in a row than this are a failed or saturated sensor, not single samples
    spike_noise: float = 12.0  # A spike is this many times the ordinary excursion of a sample from its neighbours
    spike_range: float = 0.03  # And this share of the range over which the signal moves
    spike_steps: float = 5.0  # And this many steps of the converter

    def __post_init__(self) -> None:
        for name in ("overrange", "most_bad", "few_rows", "longest_bad"):
            expect(getattr(self, name) >= 0, name, "a number of at least 0", getattr(self, name))
        for name in ("spike_noise", "spike_range", "spike_steps"):
            expect(getattr(self, name) > 0.0, name, "a positive number", getattr(self, name))


def screen_signals(
    signals: dict[str, Signal], limits: Mapping[str, SensorLimits], rules: ScreenRules, stroke_m: float | None = None
) -> tuple[dict[str, Signal], tuple[str, ...]]:
    """Replace bad samples by NaN; return the signals, and one sentence per column and kind of bad sample.

    A signal without a bad sample is returned as it came, the same object. Samples that are missing already stay so.
    Of a sensor without ``limits`` only spikes and infinities show. A position sensor may rest at the end of its range
    if that is the end of the stroke; where ``stroke_m`` is not known, no position is called saturated.

    Raises:
        RecordingError: A sensor reads what it cannot, or rests at the end of its range, or jumps, for too many rows or
            for too many in a row. The message names the column and the first such row, counted from 1.
    """
    screened, notes = dict(signals), list[str]()
    for column, signal in signals.items():
        values, bad = _screened(column, signal.values, limits.get(column), rules, stroke_m)
        if bad:
            screened[column] = replace(signal, values=values)
            notes += _notes(column, bad, int(np.count_nonzero(~np.isnan(signal.values))), limits.get(column), rules)
    return screened, tuple(notes)


@dataclass(frozen=True)
class _Bad:
    """Samples of one column that are bad in one way."""

    row: int  # The first, counted from 0
    value: float  # Its value
    count: int
    longest: int  # Most of them in a row


def _screened(
    column: str, values: Array, sensor: SensorLimits | None, rules: ScreenRules, stroke_m: float | None
) -> tuple[Array, dict[str, _Bad]]:
    """Replace a column's bad samples by NaN; skip samples that are missing already, as in a slow channel."""
    missing = np.isnan(values)
    logged = values[~missing] if missing.any() else values
    low, high = -math.inf, math.inf
    if sensor is not None:
        beyond = rules.overrange * (sensor.high - sensor.low)
        low, high = sensor.low - beyond, sensor.high + beyond
    height = _spike_height(logged, low, high, sensor.step if sensor else None, rules)
    kinds = _kinds(logged, low, high, _ends(column, sensor, stroke_m), height)
    if not kinds:
        return values, {}
    rows, bad, screened = np.flatnonzero(~missing), {}, values.copy()
    for kind, where in kinds.items():
        row = int(rows[int(np.argmax(where))])
        longest = int(np.diff(true_runs(where), axis=1).max())
        bad[kind] = _Bad(row, float(values[row]), int(where.sum()), longest)
        screened[rows[where]] = np.nan
    return screened, bad


def _kinds(values: Array, low: float, high: float, ends: tuple[float, float], height: float) -> dict[str, Mask]:
    """Find the bad samples of each kind, shape ``(n,)``; a kind without any is absent."""
    least, most = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    hard: dict[str, Mask] = {}
    if not (least >= low and most <= high and least > ends[0] and most < ends[1] and math.isfinite(most - least)):
        hard[INFINITE] = np.isinf(values)
        hard[OUT_OF_RANGE] = ((values < low) | (values > high)) & ~hard[INFINITE]
        hard[AT_ITS_END] = ((values <= ends[0]) | (values >= ends[1])) & ~hard[INFINITE] & ~hard[OUT_OF_RANGE]
    at = np.flatnonzero(~np.logical_or.reduce(list(hard.values()))) if hard else None
    spikes = _spikes(values if at is None else values[at], height)
    if len(spikes):
        hard[SPIKE] = np.zeros(len(values), dtype=np.bool_)
        hard[SPIKE][spikes if at is None else at[spikes]] = True
    return {kind: where for kind, where in hard.items() if where.any()}


def _spikes(values: Array, height: float) -> NDArray[np.int64]:
    """Find the samples of spikes: up to three that lie far from the median of eleven, while the others agree."""
    jumps = np.flatnonzero(np.abs(values[1:] - values[:-1]) > 0.7 * height) + 1
    suspects = (jumps[:, None] + np.arange(MOST_ODD)).ravel()
    suspects = suspects[(suspects >= BESIDE) & (suspects < len(values) - BESIDE)]
    near = suspects[:, None] + np.arange(-BESIDE, BESIDE + 1)
    off = np.abs(values[near] - np.median(values[near], axis=1, keepdims=True)) if len(near) else np.empty(near.shape)
    own = off[:, BESIDE, None]
    spike = (own[:, 0] > height) & (np.sum(off > QUIET * own, axis=1) <= MOST_ODD)
    return np.unique(near[spike][off[spike] > 0.5 * own[spike]])


def _notes(
    column: str, found: Mapping[str, _Bad], logged: int, sensor: SensorLimits | None, rules: ScreenRules
) -> list[str]:
    """Write a sentence for each kind of bad sample; raises as ``screen_signals``."""
    notes, few = [], max(rules.few_rows, math.floor(rules.most_bad * logged))
    for kind, (wrong, remedy) in KINDS.items():
        bad = found.get(kind)
        if bad is None:
            continue
        value = spoken(column, bad.value) if math.isfinite(bad.value) else bad.value
        what = f"{column} is {value} in row {bad.row + 1} ({bad.count} such rows in all)"
        what += wrong.format(range=sensor.described if sensor else "")
        if bad.count > few or bad.longest > rules.longest_bad:
            raise RecordingError(
                f"{what}, at most {bad.longest} in a row; expected at most {few}, and "
                f"{rules.longest_bad} in a row; {remedy}"
            )
        notes.append(f"{what}; taken as missing")
    return notes


def _ends(column: str, sensor: SensorLimits | None, stroke_m: float | None) -> tuple[float, float]:
    """Return the bounds between which a sensor is not at an end of its range.

    The low end of a sensor that starts at zero is no saturation: a vented chamber reads it. Nor is the end of a
    position sensor that reaches the end of the stroke.
    """
    if sensor is None or (column == "position_m" and stroke_m is None):
        return -math.inf, math.inf
    span = sensor.high - sensor.low
    near = max(0.5 * (sensor.step or 0.0), 5e-4 * span)
    has_low, has_high = sensor.low < -0.01 * span, True
    if column == "position_m" and stroke_m is not None:
        slack_m = 0.01 * stroke_m
        has_low, has_high = sensor.low > slack_m, sensor.high < stroke_m - slack_m
    return sensor.low + near if has_low else -math.inf, sensor.high - near if has_high else math.inf


def _spike_height(values: Array, low: float, high: float, step: float | None, rules: ScreenRules) -> float:
    """Return how far a sample must lie from its neighbours to be a spike, from samples spread over the signal.

    Quantiles, so that bad samples themselves do not count: the 95 % quantile of how far a sample sticks out of its
    two neighbours, and the range without 1 % at either end.
    """
    if len(values) < 2 * BESIDE + 1:
        return math.inf
    step_rows = max(1, len(values) // PLACES)
    before, here, after = (values[first : len(values) - 2 + first : step_rows] for first in (0, 1, 2))
    least, most = float(values.min()), float(values.max())
    if not (least >= low and most <= high and math.isfinite(most - least)):
        valid = (here >= low) & (here <= high) & np.isfinite(before) & np.isfinite(here) & np.isfinite(after)
        if valid.sum() < 2 * BESIDE + 1:
            return math.inf
        before, here, after = before[valid], here[valid], after[valid]
    up, down = here - before, here - after
    sticks_out = np.maximum(np.maximum(np.minimum(up, down), -np.maximum(up, down)), 0.0)
    lowest, highest = np.quantile(here, (0.01, 0.99)).tolist()
    finest = step or float(np.where(up != 0.0, np.abs(up), math.inf).min())
    finest = finest if math.isfinite(finest) else 0.0
    tallest = max(
        rules.spike_noise * float(np.quantile(sticks_out, 0.95)),
        rules.spike_range * (highest - lowest),
        rules.spike_steps * finest,
    )
    return tallest if tallest > 0.0 else math.inf

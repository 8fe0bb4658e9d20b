"""Screen signals for bad samples: outside the sensor's range, at the end of it, spikes, infinities.

Signals are screened as logged, because resampling would smear a bad sample over its neighbours. A few bad samples
become missing samples (NaN) and are reported. Many bad samples make the file unusable.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask, true_runs
from cylinder_friction.recordings.checks.limits import spoken
from cylinder_friction.recordings.columns import QUANTITIES
from cylinder_friction.recordings.mapping.channel_mapping import SensorLimits
from cylinder_friction.recordings.recording import RecordingError, Signal

KINDS = {
    "out of range": (
        ", which a sensor of {range} cannot read",
        "check wire, range and unit of the sensor in the mapping",
    ),
    "at its end": (
        ", the end of its sensor's range of {range}: the sensor is saturated",
        "use a sensor with a wider range, or correct the range in the mapping",
    ),
    "spike": (
        ", a spike: its neighbours agree with each other and not with it",
        "check wire, shielding and supply of the sensor",
    ),
    "infinite": (", expected finite numbers", "check the channel and how it was exported"),
}
"""The fault behind each kind of bad sample, and the remedy."""
OVERRANGE = 0.05
"""Largest valid reading beyond the sensor's range, as a share of its span: 4-20 mA is live from 3.2 to 20.8 mA, close
to the failure limits of NAMUR NE 43."""
MOST_BAD, FEW_ROWS, LONGEST_BAD = 1e-3, 5, 10
"""Largest share of a signal's rows with one kind of bad sample, number that is always allowed, and most in a row."""
SPIKE_NOISE, SPIKE_RANGE, SPIKE_STEPS, SPIKE_JUMP = 12.0, 0.03, 5.0, 0.7
"""Least height of a spike: a multiple of a sample's usual distance from its neighbours, a share of the signal's range,
and a number of converter steps; least share of this height by which a spike's first sample jumps."""
CREDIBLE_PA = (-2e5, 7e7)  # Beyond these pressures, a value that repeats marks missing samples [Pa]
PLACES = 4096  # Most samples from which a signal's own scale is estimated
BESIDE = 5  # Number of samples on either side that a sample is compared with
MOST_ODD = 3  # Most odd samples among these 11: four in a row are an event, not a spike
QUIET = 0.1  # Largest spread of the other samples, as a share of a spike's height; it is wider around a surge


def screen_signals(
    signals: dict[str, Signal], limits: Mapping[str, SensorLimits], stroke_m: float
) -> tuple[dict[str, Signal], tuple[str, ...]]:
    """Replace bad samples by NaN; return the signals, and one sentence per column and kind of bad sample.

    A signal without a bad sample is returned as the same object. A sensor without ``limits`` has no range. A position
    sensor may rest at the end of its range if that is the end of the stroke.
    """
    screened, notes = dict(signals), list[str]()
    for column, signal in signals.items():
        sensor = limits.get(column)
        signal, coded = _without_codes(column, signal, sensor, stroke_m)
        screened[column], notes, missing = signal, [*notes, *coded], np.isnan(signal.values)
        logged = signal.values[~missing] if missing.any() else signal.values
        kinds = _bad_samples(logged, sensor, *_ends(column, sensor, stroke_m))
        if kinds:
            rows, values = np.flatnonzero(~missing), signal.values.copy()
            for kind, bad in kinds.items():
                notes.append(_note(column, kind, bad, rows, signal.values, sensor))
                values[rows[bad]] = np.nan
            screened[column] = replace(signal, values=values)
    return screened, tuple(notes)


def _without_codes(
    column: str, signal: Signal, sensor: SensorLimits | None, stroke_m: float
) -> tuple[Signal, list[str]]:
    """Replace one value by NaN, such as -9999, if it repeats far beyond all others and beyond what a sensor reads."""
    values, notes = signal.values, list[str]()
    low, high = {"pressure": CREDIBLE_PA, "length": (-stroke_m, 2.0 * stroke_m)}.get(QUANTITIES[column], (0.0, 0.0))
    if sensor is not None:
        low, high = 2.0 * sensor.low - sensor.high, 2.0 * sensor.high - sensor.low
    ends = (np.fmin.reduce(values), np.fmax.reduce(values)) if high > low and len(values) else ()
    for code in (each for each in ends if math.isfinite(each) and not low <= each <= high):
        coded, others = values == code, values[(values != code) & np.isfinite(values)]
        if coded.sum() > 1 and len(others) and np.abs(others - code).min() > np.ptp(others):
            where = f"in {coded.sum()} rows (first: row {int(np.argmax(coded)) + 1})"
            why = "which no sensor reads: a mark of missing samples, or a broken wire"
            notes.append(f"{column} is {spoken(column, code)} {where}, {why}; taken as missing")
            values = np.where(coded, np.nan, values)
    return (replace(signal, values=values) if notes else signal), notes


def _bad_samples(values: Array, sensor: SensorLimits | None, low_end: float, high_end: float) -> dict[str, Mask]:
    """Find the bad samples of each kind, shape ``(n,)``; a kind without bad samples is absent."""
    beyond = OVERRANGE * (sensor.high - sensor.low) if sensor else math.inf
    low, high = (sensor.low - beyond, sensor.high + beyond) if sensor else (-math.inf, math.inf)
    least, most = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    kinds = {kind: np.zeros(len(values), dtype=np.bool_) for kind in KINDS}
    at = np.arange(len(values))
    if not (least >= low and most <= high and least > low_end and most < high_end and math.isfinite(most - least)):
        kinds["infinite"] = np.isinf(values)
        kinds["out of range"] = ((values < low) | (values > high)) & ~kinds["infinite"]
        kinds["at its end"] = (values <= low_end) | (values >= high_end)
        kinds["at its end"] &= ~kinds["infinite"] & ~kinds["out of range"]
        at = np.flatnonzero(~np.logical_or.reduce(list(kinds.values())))
        values = values[at]
    kinds["spike"][at[_spikes(values, _spike_height(values, sensor.step if sensor else None))]] = True
    return {kind: bad for kind, bad in kinds.items() if bad.any()}


def _spikes(values: Array, height: float) -> NDArray[np.int64]:
    """Find the samples of spikes: up to three of eleven lie far from the median, while the others agree."""
    jumps = np.flatnonzero(np.abs(values[1:] - values[:-1]) > SPIKE_JUMP * height) + 1
    suspects = (jumps[:, None] + np.arange(MOST_ODD)).ravel()
    suspects = suspects[(suspects >= BESIDE) & (suspects < len(values) - BESIDE)]
    near = suspects[:, None] + np.arange(-BESIDE, BESIDE + 1)
    off = np.abs(values[near] - np.median(values[near], axis=1, keepdims=True)) if len(near) else np.empty(near.shape)
    own = off[:, BESIDE, None]
    spike = (own[:, 0] > height) & (np.sum(off > QUIET * own, axis=1) <= MOST_ODD)
    return np.unique(near[spike][off[spike] > 0.5 * own[spike]])


def _note(
    column: str, kind: str, bad: Mask, rows: NDArray[np.int64], values: Array, sensor: SensorLimits | None
) -> str:
    """Write a sentence on the bad samples of one kind among the logged ``rows``; raise as ``screen_signals``."""
    first, count, few = int(rows[int(np.argmax(bad))]), int(bad.sum()), max(FEW_ROWS, math.floor(MOST_BAD * len(bad)))
    longest, (wrong, remedy) = int(np.diff(true_runs(bad), axis=1).max()), KINDS[kind]
    value = spoken(column, values[first]) if math.isfinite(values[first]) else values[first]
    what = f"{column} is {value} in row {first + 1} ({count} in all)"
    what += wrong.format(range=sensor.described if sensor else "")
    if count > few or longest > LONGEST_BAD:
        expected = f"expected at most {few}, and {LONGEST_BAD} in a row"
        raise RecordingError(f"{what}, at most {longest} in a row; {expected}; {remedy}")
    return f"{what}; taken as missing"


def _ends(column: str, sensor: SensorLimits | None, stroke_m: float) -> tuple[float, float]:
    """Return bounds of the range beyond which a sensor is saturated, unless zero or the stroke ends there."""
    if sensor is None:
        return -math.inf, math.inf
    span = sensor.high - sensor.low
    near = max(0.5 * (sensor.step or 0.0), 5e-4 * span)
    has_low, has_high = sensor.low < -0.01 * span, True
    if column == "position_m":
        has_low, has_high = sensor.low > 0.01 * stroke_m, sensor.high < 0.99 * stroke_m
    return sensor.low + near if has_low else -math.inf, sensor.high - near if has_high else math.inf


def _spike_height(values: Array, step: float | None) -> float:
    """Estimate how far a spike lies from its neighbours at least, from quantiles, which bad samples do not affect."""
    if len(values) < 2 * BESIDE + 1:
        return math.inf
    stride = max(1, len(values) // PLACES)
    before, here, after = (values[first : len(values) - 2 + first : stride] for first in (0, 1, 2))
    lowest, highest = np.quantile(here, (0.01, 0.99)).tolist()
    of_range = SPIKE_RANGE * (highest - lowest)
    if np.abs(values[1:] - values[:-1]).max() <= SPIKE_JUMP * of_range:  # nothing jumps as far as a spike
        return math.inf
    up, down = here - before, here - after
    sticks_out = np.maximum(np.maximum(np.minimum(up, down), -np.maximum(up, down)), 0.0)
    finest = step or float(np.where(up != 0.0, np.abs(up), math.inf).min())
    of_noise = SPIKE_NOISE * float(np.quantile(sticks_out, 0.95))
    tallest = max(of_range, of_noise, SPIKE_STEPS * finest if math.isfinite(finest) else 0.0)
    return tallest if tallest > 0.0 else math.inf

"""The compiled step: the reference's, bit for bit, in one function without allocation and of constant time."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.realtime import packed as at
from cylinder_friction.realtime.bounds import next_regime
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.lstm import head_of, lstm_step

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.realtime.packed import Array, Single, Whole

    Int = NDArray[np.int32]

POSITION = 2
NOT_READY, WARMING, OUTSIDE, INVALID_FIRST, FROZEN, RECOVERING = (
    int(flag)
    for flag in (
        *(Flag.NOT_READY, Flag.WARMING, Flag.OUTSIDE),
        *(Flag.INVALID_PRESSURE_1, Flag.FROZEN, Flag.RECOVERING),
    )
)


@numba.njit(cache=True)
def step(
    taps: Array,
    scaling: Array,
    settings: Array,
    counts: Whole,
    input_weights: Single,
    recurrent: Single,
    bias: Single,
    head: Single,
    head_bias: Single,
    nodes: Int,
    splits: Single,
    roots: Int,
    history: Array,
    memory: Array,
    counters: Whole,
    lstm: Single,
    outputs: Array,
    seen: Single,
    gates: Single,
    places: Int,
    pressure_1_pa: float,
    pressure_2_pa: float,
    position_m: float,
) -> tuple[float, float, float, int]:
    """Take the arrays of ``PackedModel`` and ``PackedState`` and a sample; returns friction, bounds [N] and flags."""
    invalid = _invalid(settings, pressure_1_pa, pressure_2_pa, position_m)
    if counters[at.READY] == 0:
        if invalid != 0:
            return 0.0, 0.0, 0.0, NOT_READY | invalid * INVALID_FIRST
        _begin(counts, history, memory, counters, pressure_1_pa, pressure_2_pa, position_m)
    if invalid & 1:
        pressure_1_pa = memory[at.HELD]
    if invalid & 2:
        pressure_2_pa = memory[at.HELD + 1]
    if invalid & 4:
        position_m = memory[at.HELD + POSITION]
    _filter(taps, history, counters, outputs, pressure_1_pa, pressure_2_pa, position_m)
    base_n = outputs[outputs.shape[0] - 2]
    flags = invalid * INVALID_FIRST
    if _outside(settings, pressure_1_pa, pressure_2_pa, position_m):
        flags |= OUTSIDE
    if _frozen(settings, counts, memory, counters, invalid, base_n, pressure_1_pa, pressure_2_pa, position_m):
        flags |= FROZEN
    memory[at.HELD] = pressure_1_pa
    memory[at.HELD + 1] = pressure_2_pa
    memory[at.HELD + POSITION] = position_m
    flags |= _trust(counts, counters, flags & ~OUTSIDE != 0)
    _scale(scaling, outputs, seen[head.shape[0] + 1 :])
    friction_n = base_n + settings[at.TARGET_MEAN]
    if bias.shape[0] > 0:
        features = seen[head.shape[0] + 1 :]
        lstm_step(input_weights, recurrent, bias, counts[at.FEATURES], features, lstm[0], lstm[1], gates)
        for node in range(head.shape[0]):
            seen[node] = lstm[0, bias.shape[0] - 1, node]
        seen[head.shape[0]] = head_of(seen[: head.shape[0]], head, head_bias[0])
    if counts[at.HEAD_COUNTS]:
        friction_n += settings[at.TARGET_SCALE] * np.float64(seen[head.shape[0]])
    if roots.shape[0] > 0:
        friction_n += settings[at.TARGET_SCALE] * _forest(
            nodes, splits, roots, counts[at.DEPTH], places, seen[counts[at.SEEN_FROM] :]
        )
    regime, direction, left = next_regime(
        outputs[outputs.shape[0] - 1],
        counters[at.DIRECTION],
        counters[at.REVERSAL_LEFT],
        settings[at.STANDSTILL],
        settings[at.CREEP],
        counts[at.REVERSAL],
    )
    counters[at.DIRECTION] = direction
    counters[at.REVERSAL_LEFT] = left
    return friction_n, friction_n + settings[at.LOWER + regime], friction_n + settings[at.UPPER + regime], flags


@numba.njit(cache=True)
def _invalid(settings: Array, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> int:
    """Return one bit a channel that is no reading of a working sensor."""
    bits = 0
    for channel, value in enumerate((pressure_1_pa, pressure_2_pa, position_m)):
        if not (
            isfinite(value)
            and settings[at.ACCEPT_LOWER + channel] <= value
            and value <= settings[at.ACCEPT_UPPER + channel]
        ):
            bits |= 1 << channel
    return bits


@numba.njit(cache=True)
def _begin(
    counts: Whole, history: Array, memory: Array, counters: Whole, first: float, second: float, third: float
) -> None:
    """The first sound sample: as if it had always been there."""
    for channel, value in enumerate((first, second, third)):
        memory[at.HELD + channel] = value
        for lag in range(history.shape[1]):
            history[channel, lag] = value
    memory[at.CONSTANT_FROM] = third
    memory[at.CONSTANT_FROM + 1] = third
    counters[at.READY] = 1
    counters[at.WARMING] = counts[at.WARM_UP]


@numba.njit(cache=True)
def _filter(
    taps: Array, history: Array, counters: Whole, outputs: Array, first: float, second: float, third: float
) -> None:
    """Put the sample into the history and filters it."""
    lags = taps.shape[1]
    newest = counters[at.NEWEST] - 1
    if newest < 0:
        newest = lags - 1
    counters[at.NEWEST] = newest
    for output in range(outputs.shape[0]):
        outputs[output] = 0.0
    for channel, value in enumerate((first, second, third)):
        history[channel, newest] = value
        history[channel, newest + lags] = value
        for lag in range(lags):
            past = history[channel, newest + lag]
            for output in range(outputs.shape[0]):
                outputs[output] += taps[channel, lag, output] * past


@numba.njit(cache=True)
def _outside(settings: Array, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> bool:
    for channel, value in enumerate((pressure_1_pa, pressure_2_pa, position_m)):
        if value < settings[at.TRAINED_LOWER + channel] or value > settings[at.TRAINED_UPPER + channel]:
            return True
    return False


@numba.njit(cache=True)
def _frozen(
    settings: Array,
    counts: Whole,
    memory: Array,
    counters: Whole,
    invalid: int,
    base_n: float,
    pressure_1_pa: float,
    pressure_2_pa: float,
    position_m: float,
) -> bool:
    """Follow how long each channel has been constant; a held value is not the sensor's and starts afresh."""
    for channel, value in enumerate((pressure_1_pa, pressure_2_pa)):
        if invalid >> channel & 1 or value != memory[at.HELD + channel]:
            memory[at.CONSTANT_FROM + channel] = position_m
            counters[at.FROZEN + channel] = 0
        elif abs(position_m - memory[at.CONSTANT_FROM + channel]) > settings[at.FREEZE_TRAVEL]:
            counters[at.FROZEN + channel] = 1
    if invalid & 4 or position_m != memory[at.HELD + POSITION]:
        counters[at.CONSTANT] = 0
    else:
        counters[at.CONSTANT] = min(counters[at.CONSTANT] + 1, counts[at.FREEZE_SAMPLES] + 1)
    stuck = counters[at.CONSTANT] > counts[at.FREEZE_SAMPLES] and abs(base_n) > settings[at.FREEZE_FORCE]
    return counters[at.FROZEN] != 0 or counters[at.FROZEN + 1] != 0 or stuck


@numba.njit(cache=True)
def _trust(counts: Whole, counters: Whole, bad: bool) -> int:
    """Count warm-up and recovery down, and returns the flags of which of the two this step is in."""
    flags = 0
    if counters[at.WARMING] > 0:
        counters[at.WARMING] -= 1
        flags |= WARMING
    if bad:
        counters[at.RECOVERING] = counts[at.RECOVERY]
    elif counters[at.RECOVERING] > 0:
        counters[at.RECOVERING] -= 1
        flags |= RECOVERING
    return flags


@numba.njit(cache=True)
def _scale(scaling: Array, outputs: Array, features: Single) -> None:
    for feature in range(scaling.shape[1]):
        value, limit = outputs[feature], scaling[0, feature]
        if limit > 0.0:
            value = value / (abs(value) + limit)
        features[feature] = np.float32((value - scaling[1, feature]) / scaling[2, feature])


@numba.njit(cache=True)
def _forest(nodes: Int, splits: Single, roots: Int, depth: int, places: Int, seen: Single) -> float:
    """All trees go down together, a level at a time: the machine waits for many of them at once, not for each."""
    for tree in range(roots.shape[0]):
        places[tree] = roots[tree]
    for _ in range(depth):
        for tree in range(roots.shape[0]):
            node = places[tree]
            left = seen[nodes[node, 0]] <= splits[node, 3]
            places[tree] = nodes[node, 1] if left else nodes[node, 2]
    total = 0.0
    for tree in range(roots.shape[0]):
        total += np.float64(splits[places[tree], 3])
    return total


@numba.njit(cache=True)
def steps(model: tuple, state: tuple, samples: Array, newtons: Array, flags: Whole) -> None:  # type: ignore[type-arg]
    """Take the step on each of ``samples``, shape ``(n, 3)``; fills ``newtons``, shape ``(n, 3)``, and ``flags``."""
    for row in range(samples.shape[0]):
        sample = (samples[row, 0], samples[row, 1], samples[row, 2])
        friction, lower, upper, flags[row] = step(*model, *state, *sample)  # type: ignore[call-arg]
        newtons[row, 0] = friction
        newtons[row, 1] = lower
        newtons[row, 2] = upper

"""The compiled step, which every runtime must meet: one function without allocation and of constant time."""

from math import isfinite

import numba
import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime import packed as at
from cylinder_friction.realtime.bounds import next_regime
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.history import history_step
from cylinder_friction.realtime.lstm import head_of, lstm_step
from cylinder_friction.realtime.packed import Single, Whole
from cylinder_friction.realtime.position_load import load_at
from cylinder_friction.realtime.sensor_offset import DEVIATION, EXTENDED, OFFSET, RETRACTED, offset_step
from cylinder_friction.realtime.unmodelled_force import unmodelled_force

Int = NDArray[np.int32]

NOT_READY, WARMING, OUTSIDE, FROZEN, RECOVERING = (
    int(flag) for flag in (Flag.NOT_READY, Flag.WARMING, Flag.OUTSIDE, Flag.FROZEN, Flag.RECOVERING)
)
OFFSET_UNKNOWN, UNMODELLED_FORCE = int(Flag.OFFSET_UNKNOWN), int(Flag.UNMODELLED_FORCE)


@numba.njit(cache=True)
def step(
    taps: Array,
    scaling: Array,
    history: Array,
    limits: Array,
    offsets: Array,
    settings: Array,
    counts: Whole,
    invalid_flags: Whole,
    pressures: Whole,
    load: Array,
    input_weights: Single,
    recurrent: Single,
    bias: Single,
    head: Single,
    head_bias: Single,
    nodes: Int,
    splits: Single,
    roots: Int,
    forces: Array,
    offset_weights: Array,
    offset_settings: Array,
    offset_friction: Array,
    offset_position: Array,
    offset_ranges: Array,
    zeros: Array,
    ring: Array,
    samples: Array,
    motion: Array,
    counters: Whole,
    lstm: Single,
    outputs: Array,
    moved: Array,
    seen: Single,
    gates: Single,
    places: Int,
    offset: Array,
    sample: Array,
) -> tuple[float, float, float, int]:
    """Return friction, bounds [N] and flags from the arrays of ``PackedModel`` and ``PackedState`` and a sample."""
    flags = _check(limits, invalid_flags, samples, sample)
    if counters[at.READY] == 0 and flags != 0:
        return 0.0, 0.0, 0.0, NOT_READY | flags
    if load.shape[0] > 0:
        samples[at.NOW, sample.shape[0]] = load_at(load, samples[at.NOW, counts[at.POSITION]])
    if counters[at.READY] == 0:
        _begin(counts, ring, samples, counters)
    _filter(taps, ring, counters, outputs, samples[at.NOW])
    for output in range(zeros.shape[0]):
        outputs[output] -= offset[OFFSET] * zeros[output]
    base_n = outputs[outputs.shape[0] - 2]
    bad = flags != 0
    if _outside(limits, samples[at.NOW]):
        flags |= OUTSIDE
    if _frozen(settings, counts, pressures, samples, counters, base_n):
        flags |= FROZEN
        bad = True
    samples[at.HELD] = samples[at.NOW]
    flags |= _trust(counts, counters, bad)
    features = seen[head.shape[0] + 1 :]
    _scale(scaling, outputs, features)
    if history.shape[0] > 0:
        history_step(outputs[counts[at.HISTORY]], motion, history[0], settings[at.SAMPLE_TIME], moved)
        for feature in range(moved.shape[0]):
            scaled = (moved[feature] - history[1, feature]) / history[2, feature]
            features[scaling.shape[1] + feature] = np.float32(scaled)
    friction_n = base_n + settings[at.TARGET_MEAN]
    if bias.shape[0] > 0:
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
    unmodelled = False
    if forces.shape[1] > 0:
        unmodelled, counters[at.UNMODELLED] = unmodelled_force(
            forces,
            samples[at.NOW],
            regime,
            direction,
            counters[at.UNMODELLED],
            counts[at.CLEAR],
            settings[at.LEAST_PRESSURE],
        )
        if unmodelled:
            flags |= UNMODELLED_FORCE
    further = 1.0
    if zeros.shape[0] > 0:
        if offset[EXTENDED] * offset[RETRACTED] == 0.0:
            flags |= OFFSET_UNKNOWN
        if offsets[at.SPREAD, regime] > 0.0:
            further = np.sqrt(1.0 + (offset[DEVIATION] / offsets[at.SPREAD, regime]) ** 2)
        offset_step(
            offset_weights,
            offset_settings,
            offset_friction,
            offset_position,
            offset_ranges,
            offset,
            counts[at.POSITION],
            outputs[outputs.shape[0] - 1],
            samples[at.NOW],
            not (bad or unmodelled),
        )
    lower_n = friction_n + further * offsets[at.LOWER, regime]
    return friction_n, lower_n, friction_n + further * offsets[at.UPPER, regime], flags


@numba.njit(cache=True)
def _check(limits: Array, invalid_flags: Whole, samples: Array, sample: Array) -> int:
    """Take the sample, with the last valid value in place of an invalid one; return the flags of those."""
    flags = 0
    for channel in range(sample.shape[0]):
        value = sample[channel]
        if isfinite(value) and limits[at.ACCEPT_LOWER, channel] <= value and value <= limits[at.ACCEPT_UPPER, channel]:
            samples[at.NOW, channel] = value
            samples[at.INVALID, channel] = 0.0
        else:
            samples[at.NOW, channel] = samples[at.HELD, channel]
            samples[at.INVALID, channel] = 1.0
            flags |= invalid_flags[channel]
    return flags


@numba.njit(cache=True)
def _begin(counts: Whole, ring: Array, samples: Array, counters: Whole) -> None:
    """Begin with the first valid sample: as if it had always been there."""
    for channel in range(samples.shape[1]):
        ring[channel] = samples[at.NOW, channel]
        samples[at.HELD, channel] = samples[at.NOW, channel]
        samples[at.CONSTANT_FROM, channel] = samples[at.NOW, counts[at.POSITION]]
    counters[at.READY] = 1
    counters[at.WARMING] = counts[at.WARM_UP]


@numba.njit(cache=True)
def _filter(taps: Array, ring: Array, counters: Whole, outputs: Array, now: Array) -> None:
    """Put the sample into the ring and filter it."""
    lags = taps.shape[1]
    newest = counters[at.NEWEST] - 1
    if newest < 0:
        newest = lags - 1
    counters[at.NEWEST] = newest
    for output in range(outputs.shape[0]):
        outputs[output] = 0.0
    for channel in range(now.shape[0]):
        ring[channel, newest] = now[channel]
        ring[channel, newest + lags] = now[channel]
        for lag in range(lags):
            past = ring[channel, newest + lag]
            for output in range(outputs.shape[0]):
                outputs[output] += taps[channel, lag, output] * past


@numba.njit(cache=True)
def _outside(limits: Array, now: Array) -> bool:
    for channel in range(limits.shape[1]):
        if now[channel] < limits[at.TRAINED_LOWER, channel] or now[channel] > limits[at.TRAINED_UPPER, channel]:
            return True
    return False


@numba.njit(cache=True)
def _frozen(settings: Array, counts: Whole, pressures: Whole, samples: Array, counters: Whole, base_n: float) -> bool:
    """Follow how long each input has been constant; a held value is not the sensor's and starts afresh."""
    now, held = samples[at.NOW], samples[at.HELD]
    constant_from, invalid = samples[at.CONSTANT_FROM], samples[at.INVALID]
    place = counts[at.POSITION]
    frozen = False
    for index, channel in enumerate(pressures):
        if invalid[channel] != 0.0 or now[channel] != held[channel]:
            constant_from[channel] = now[place]
            counters[at.FROZEN + index] = 0
        elif abs(now[place] - constant_from[channel]) > settings[at.FREEZE_TRAVEL]:
            counters[at.FROZEN + index] = 1
        frozen = frozen or counters[at.FROZEN + index] != 0
    if invalid[place] != 0.0 or now[place] != held[place]:
        counters[at.CONSTANT] = 0
    else:
        counters[at.CONSTANT] = min(counters[at.CONSTANT] + 1, counts[at.FREEZE_SAMPLES] + 1)
    stuck = counters[at.CONSTANT] > counts[at.FREEZE_SAMPLES] and abs(base_n) > settings[at.FREEZE_FORCE]
    return frozen or stuck


@numba.njit(cache=True)
def _trust(counts: Whole, counters: Whole, bad: bool) -> int:
    """Count warm-up and recovery down; return the flags of those that this step is in."""
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
    """Descend all trees together, level by level: the machine waits for many of them at once, not for each."""
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
def steps(model: tuple, state: tuple, samples: Array, newtons: Array, learned: Array, flags: Whole) -> None:  # type: ignore[type-arg]
    """Take the step on each of ``samples``, shape ``(n, inputs)``.

    Fills ``newtons``, ``(n, 3)``, the offset and its standard uncertainty after each [N], ``(n, 2)``, and ``flags``.
    """
    offset = state[-1]
    for row in range(samples.shape[0]):
        friction, lower, upper, flags[row] = step(*model, *state, samples[row])  # type: ignore[call-arg]
        newtons[row, 0] = friction
        newtons[row, 1] = lower
        newtons[row, 2] = upper
        if offset.shape[0] > 0:
            learned[row, 0] = offset[OFFSET]
            learned[row, 1] = offset[DEVIATION]

"""The compiled step, the reference of every runtime: one function of constant time, without allocation.

A step, in this order: sign and offset of the sensors, guard, loss of lines, filters, history, network, forest, bounds.
Filters, scaling and sums run in double precision, LSTM and forest in single. Every sum adds in the order in which the
estimator's own ``advance`` does, so the two agree bit for bit on valid samples.
"""

from functools import partial
from math import isfinite

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled, compiled_part
from cylinder_friction.realtime.bounds import next_regime
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.history import history_step
from cylinder_friction.realtime.load_table import load_at, load_unknown
from cylinder_friction.realtime.lstm import Single, add_product, head_of, lstm_step
from cylinder_friction.realtime.packed import (
    CELL,
    CONSTANT,
    DIRECTION,
    HIDDEN,
    LEFT,
    MEAN,
    NEWEST,
    READY,
    RECOVERING,
    REVERSAL_LEFT,
    RIGHT,
    SCALE,
    SETTINGS,
    SPLIT,
    UNMODELLED,
    WARMING,
    Features,
    Inputs,
    Lines,
    Model,
    Network,
    PackedGuard,
    Places,
    State,
    Trees,
    Whole,
)
from cylinder_friction.realtime.sensor_offset import DEVIATION, EXTENDED, OFFSET, RETRACTED, offset_step, supported
from cylinder_friction.realtime.unmodelled_force import unmodelled_force

FLAG_NOT_READY, FLAG_WARMING, FLAG_OUTSIDE = int(Flag.NOT_READY), int(Flag.WARMING), int(Flag.OUTSIDE)
FLAG_FROZEN, FLAG_RECOVERING = int(Flag.FROZEN), int(Flag.RECOVERING)
FLAG_OFFSET_UNKNOWN, FLAG_UNMODELLED_FORCE = int(Flag.OFFSET_UNKNOWN), int(Flag.UNMODELLED_FORCE)

# Nothing here allocates an array, so reference counting is off; it would take a third of a step's time
_compiled, _part = partial(compiled, _nrt=False), partial(compiled_part, _nrt=False, inline="always")


@_compiled
def steps(
    model: Model, state: State, samples: Array, newtons: Array, learned: Array, flags: Whole
) -> tuple[float, float, float, int]:
    """Take the step on each of ``samples``, shape ``(n, inputs)``; return friction, bounds [N] and flags of the last.

    Fills ``newtons`` with friction and bounds, ``(n, 3)``, ``learned`` with the offset and its standard uncertainty
    after each sample [N], ``(n, 2)``, and ``flags``; updates ``state``. Blocks of rows pass filters, network and forest
    one after the other, because the processor's first cache holds the constants of one of these, not of all.
    """
    last = 0.0, 0.0, 0.0, 0
    room, network = state.seen.shape[0], model.network
    for first in range(0, samples.shape[0], room):
        end = min(first + room, samples.shape[0])
        for row in range(first, end):
            flags[row] = _uncorrected(model, state, samples[row], state.seen[row - first], newtons[row])
            if state.offset.shape[0] > 0:
                learned[row, 0], learned[row, 1] = state.offset[OFFSET], state.offset[DEVIATION]
        for row in range(first, end):
            if network.bias.shape[0] > 0 and not flags[row] & FLAG_NOT_READY:
                _run_network(network, state, state.seen[row - first])
        for row in range(first, end):
            if not flags[row] & FLAG_NOT_READY:
                _correct(model, state.places, state.seen[row - first], newtons[row])
            last = newtons[row, 0], newtons[row, 1], newtons[row, 2], flags[row]
    return last


@_part
def _uncorrected(model: Model, state: State, sample: Array, seen: Single, newtons: Array) -> int:
    """Do the step without the corrections; return the flags.

    Fills the features of ``seen``, and ``newtons`` with the base force and the distances of the bounds from it.
    """
    flags = _check(model.inputs, state, sample)
    bad = flags != 0
    if state.counters[READY] == 0 and bad:
        for each in range(newtons.shape[0]):
            newtons[each] = 0.0
        return FLAG_NOT_READY | flags
    if model.inputs.load.shape[0] > 0:
        state.now[sample.shape[0]] = load_at(model.inputs.load, state.now)
    if state.counters[READY] == 0:
        _begin(model, state)
    _to_chambers(model.lines, model.inputs.position, state)
    _filter(model.taps, state)
    for output in range(model.zeros.shape[0]):
        state.outputs[output] -= state.offset[OFFSET] * model.zeros[output]
    linear = model.features.limits.shape[0]
    base_n, velocity_m_s = float(state.outputs[linear]), float(state.outputs[linear + 1])
    if _outside(model.inputs, state.now):
        flags |= FLAG_OUTSIDE
    if _frozen(model.inputs, model.guard, state, base_n):
        flags |= FLAG_FROZEN
        bad = True
    for channel in range(state.now.shape[0]):
        state.held[channel] = state.now[channel]
    flags |= _trust(model.guard, state.counters, bad)
    _make_features(model.features, state, seen[model.network.head.shape[0] + 1 :])
    regime = _regime(model, state.counters, velocity_m_s)
    if model.guard.forces.shape[1] > 0 and _unmodelled(model.guard, state, regime):
        flags |= FLAG_UNMODELLED_FORCE
        bad = True
    further = 1.0
    if model.zeros.shape[0] > 0:
        both = state.offset[EXTENDED] * state.offset[RETRACTED] != 0.0
        if not (both and supported(model.tracker.settings, state.offset)):
            flags |= FLAG_OFFSET_UNKNOWN
        if model.bounds.spread_n[regime] > 0.0:
            further = np.sqrt(1.0 + (state.offset[DEVIATION] / model.bounds.spread_n[regime]) ** 2)
        offset_step(model.tracker, state.offset, model.inputs.position, velocity_m_s, state.chamber, not bad)
    newtons[0] = base_n + model.target_mean_n
    newtons[1], newtons[2] = further * model.bounds.lower_n[regime], further * model.bounds.upper_n[regime]
    return flags


@_part
def _check(inputs: Inputs, state: State, sample: Array) -> int:
    """Correct and store the sample; hold the last valid value of an invalid one, and return its flags."""
    flags = 0
    for channel in range(sample.shape[0]):
        value = inputs.sign[channel] * (sample[channel] - inputs.zero[channel])
        valid = isfinite(value) and inputs.accept_lower[channel] <= value and value <= inputs.accept_upper[channel]
        state.invalid[channel] = not valid
        state.now[channel] = value if valid else state.held[channel]
        if not valid:
            flags |= inputs.invalid_flags[channel]
    return flags


@_part
def _begin(model: Model, state: State) -> None:
    """Start as if the first valid sample had always been there."""
    for channel in range(state.now.shape[0]):
        for place in range(state.ring.shape[1]):
            state.ring[channel, place] = state.now[channel]
        state.held[channel] = state.now[channel]
        state.constant_from_m[channel] = state.now[model.inputs.position]
    state.counters[READY] = 1
    state.counters[WARMING] = model.guard.warm_up_samples


@_part
def _to_chambers(lines: Lines, position: int, state: State) -> None:
    """Copy the sample, and subtract the loss of lines from its pressures; earlier positions are in the ring."""
    now, chamber, newest = state.now, state.chamber, state.counters[NEWEST]
    for channel in range(now.shape[0]):
        chamber[channel] = now[channel]
    if lines.places.shape[0] == 0:
        return
    velocity_m_s = 0.0
    for lag in range(1, lines.velocity.shape[0]):
        velocity_m_s += lines.velocity[lag] * (state.ring[position, newest + lag - 1] - now[position])
    for line in range(lines.places.shape[0]):
        along, terms = lines.signs[line] * velocity_m_s, lines.terms[line]
        speed = abs(along)
        lost_pa = terms[0] * speed + terms[1] * speed * speed
        if speed > terms[3]:
            lost_pa = max(lost_pa, terms[2] * speed * np.sqrt(speed) * np.sqrt(np.sqrt(speed)))
        chamber[lines.places[line]] -= lost_pa if along > 0.0 else -lost_pa


@_part
def _filter(taps: Array, state: State) -> None:
    """Put the sample into the ring and filter it."""
    lags, ring, outputs = taps.shape[1], state.ring, state.outputs
    newest = state.counters[NEWEST] - 1
    if newest < 0:
        newest = lags - 1
    state.counters[NEWEST] = newest
    for output in range(outputs.shape[0]):
        outputs[output] = 0.0
    for channel in range(ring.shape[0]):
        ring[channel, newest] = state.chamber[channel]
        ring[channel, newest + lags] = state.chamber[channel]
        add_product(outputs, taps[channel], ring[channel, newest:], lags)


@_part
def _outside(inputs: Inputs, now: Array) -> bool:
    for channel in range(inputs.trained_lower.shape[0]):
        if now[channel] < inputs.trained_lower[channel] or now[channel] > inputs.trained_upper[channel]:
            return True
    return inputs.load.shape[0] > 0 and load_unknown(inputs.load, now)


@_part
def _frozen(inputs: Inputs, guard: PackedGuard, state: State, base_n: float) -> bool:
    """Track how long each input has been constant; a held value is not a reading, and restarts the count."""
    now, held, counters, position = state.now, state.held, state.counters, inputs.position
    frozen = False
    for channel in inputs.pressures:
        if state.invalid[channel] or now[channel] != held[channel]:
            state.constant_from_m[channel] = now[position]
            state.frozen[channel] = False
        elif abs(now[position] - state.constant_from_m[channel]) > guard.freeze_travel_m:
            state.frozen[channel] = True
        frozen = frozen or state.frozen[channel]
    if state.invalid[position] or now[position] != held[position]:
        counters[CONSTANT] = 0
    else:
        counters[CONSTANT] = min(counters[CONSTANT] + 1, guard.freeze_samples + 1)
    return frozen or (counters[CONSTANT] > guard.freeze_samples and abs(base_n) > guard.freeze_force_n)


@_part
def _trust(guard: PackedGuard, counters: Whole, bad: bool) -> int:
    """Count warm-up and recovery down; return their flags while they last."""
    flags = 0
    if counters[WARMING] > 0:
        counters[WARMING] -= 1
        flags |= FLAG_WARMING
    if bad:
        counters[RECOVERING] = guard.recovery_samples
    elif counters[RECOVERING] > 0:
        counters[RECOVERING] -= 1
        flags |= FLAG_RECOVERING
    return flags


@_part
def _make_features(made: Features, state: State, features: Single) -> None:
    """Fill the features: linear ones, ``y / (|y| + limit)`` if there is a limit, then those of the history."""
    linear = made.limits.shape[0]
    for feature in range(linear):
        value, limit = state.outputs[feature], made.limits[feature]
        if limit > 0.0:
            value = value / (abs(value) + limit)
        features[feature] = np.float32((value - made.mean[feature]) / made.scale[feature])
    if made.history.shape[0] > 0:
        smooth_m, moved = state.outputs[made.history_source], state.moved
        history_step(smooth_m, state.motion, made.history[SETTINGS], made.step_s, moved)
        for place in range(moved.shape[0]):
            scaled = (moved[place] - made.history[MEAN, place]) / made.history[SCALE, place]
            features[linear + place] = np.float32(scaled)


@_part
def _run_network(network: Network, state: State, seen: Single) -> None:
    """Put hidden state and head before the features."""
    layers, nodes = network.bias.shape[0], network.head.shape[0]
    hidden, features = state.lstm[HIDDEN], seen[nodes + 1 :]
    weights = network.input, network.recurrent, network.bias
    lstm_step(*weights, features.shape[0], features, hidden, state.lstm[CELL], state.gates)
    for node in range(nodes):
        seen[node] = hidden[layers - 1, node]
    seen[nodes] = head_of(seen[:nodes], network.head, network.head_bias)


@_part
def _correct(model: Model, places: Places, seen: Single, newtons: Array) -> None:
    """Add the corrections of network and forest to the base force, and then friction to its bounds."""
    network, trees = model.network, model.trees
    if network.head_counts:
        newtons[0] += model.target_scale_n * np.float64(seen[network.head.shape[0]])
    if trees.roots.shape[0] > 0:
        newtons[0] += model.target_scale_n * _forest(trees, places, seen[trees.seen_from :])
    newtons[1] += newtons[0]
    newtons[2] += newtons[0]


@_part
def _forest(trees: Trees, places: Places, seen: Single) -> float:
    """Descend all trees together, level by level, so that the processor waits for many reads at once."""
    nodes, splits = trees.nodes, trees.splits
    for tree in range(places.shape[0]):
        places[tree] = trees.roots[tree]
    for _ in range(trees.depth):
        for tree in range(places.shape[0]):
            node = places[tree]
            left = seen[nodes[node]] <= splits[node + SPLIT]
            places[tree] = nodes[node + LEFT] if left else nodes[node + RIGHT]
    total = 0.0
    for tree in range(places.shape[0]):
        total += np.float64(splits[places[tree] + SPLIT])
    return total


@_part
def _regime(model: Model, counters: Whole, velocity_m_s: float) -> int:
    bounds = model.bounds
    limits = bounds.standstill_m_s, bounds.creep_m_s, bounds.reversal_samples
    regime, direction, left = next_regime(velocity_m_s, counters[DIRECTION], counters[REVERSAL_LEFT], *limits)
    counters[DIRECTION], counters[REVERSAL_LEFT] = direction, left
    return regime


@_part
def _unmodelled(guard: PackedGuard, state: State, regime: int) -> bool:
    motion = regime, state.counters[DIRECTION], state.counters[UNMODELLED]
    limits = guard.clear_samples, guard.least_pressure_pa
    found, state.counters[UNMODELLED] = unmodelled_force(guard.forces, state.chamber, *motion, *limits)
    return found

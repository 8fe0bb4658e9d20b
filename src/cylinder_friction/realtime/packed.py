"""A ``StepModel`` and its state laid out for the compiled step: named groups of contiguous arrays and numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.flags import invalid_flag
from cylinder_friction.realtime.history import new_history
from cylinder_friction.realtime.lstm import AT_A_TIME, NO_NETWORK, LstmWeights, Single
from cylinder_friction.realtime.sensor_offset import NO_TRACKER, OffsetTracker
from cylinder_friction.realtime.unmodelled_force import force_limits
from cylinder_friction.recordings.line_loss import FLOW_SIGNS, LossTerms

if TYPE_CHECKING:
    from cylinder_friction.realtime.forest import Forest
    from cylinder_friction.realtime.model import StepModel

Whole = NDArray[np.int64]
Places = NDArray[np.uint32]  # Unsigned: for a signed index compiled code checks whether it counts from the end

# Places in ``State.counters``
READY, NEWEST, CONSTANT, WARMING, RECOVERING, DIRECTION, REVERSAL_LEFT, UNMODELLED = range(8)
VECTOR = 4  # Double-precision numbers that a processor adds at once
LINE = 16  # Single-precision numbers in a line of the processor's memory
ROWS = 16  # Samples that pass one part of the step together, before the next part
HIDDEN, CELL = range(2)  # Places in ``State.lstm``
SETTINGS, MEAN, SCALE = range(3)  # Rows of ``Features.history``
LEFT, RIGHT, SPLIT = np.arange(1, 4, dtype=np.uint32)  # Places in a node of ``Trees``, behind its feature


class Inputs(NamedTuple):
    """Corrections and limits of valid samples; arrays have one number per input."""

    # A sample's value is ``sign * (reading - zero)``
    sign: Array
    zero: Array
    # Limits of a working sensor's readings
    accept_lower: Array
    accept_upper: Array
    # Outside, the estimate is an extrapolation
    trained_lower: Array
    trained_upper: Array
    invalid_flags: Whole  # Flags of an invalid value
    pressures: Whole  # Places of the raw pressures
    position: int  # Place of the position
    load: Array  # The load that position decides, ``PositionLoad.packed``; empty without one


class Lines(NamedTuple):
    """Lines between pressure sensors and chambers; see ``recordings.line_loss``."""

    places: Whole  # Places of their pressures among the inputs
    signs: Array  # Sign of the velocity while oil flows to the chamber
    terms: Array  # ``LossTerms``, shape ``(lines, 4)``
    velocity: Array  # Taps of the causal velocity on the position; newest first


class PackedGuard(NamedTuple):
    """See ``model.Guard``."""

    freeze_travel_m: float
    freeze_samples: int
    freeze_force_n: float
    warm_up_samples: int
    recovery_samples: int
    forces: Array  # See ``unmodelled_force.force_limits``; no columns if the range is unknown
    clear_samples: int
    least_pressure_pa: float


class PackedBounds(NamedTuple):
    """See ``model.Bounds``; arrays have one number per regime."""

    lower_n: Array
    upper_n: Array
    spread_n: Array
    standstill_m_s: float
    creep_m_s: float
    reversal_samples: int


class Features(NamedTuple):
    """From filtered samples to what network and forest take."""

    # Of the linear features; see ``StepModel``
    limits: Array
    mean: Array
    scale: Array
    history: Array  # Settings, means and scales of the history features, shape ``(3, 6)``; no rows without history
    history_source: int  # Which linear feature is the smoothed position
    step_s: float  # Between two samples [s]
    total: int  # Number of all features


class Network(NamedTuple):
    """An LSTM; a model without LSTM has no layer and no node here."""

    input: Single
    recurrent: Single
    bias: Single
    head: Single
    head_bias: np.float32
    head_counts: bool  # Whether the head is part of the estimate


class Trees(NamedTuple):
    """A forest; a model without forest has no root here."""

    # Each node's feature, places of its left and right child, and a fourth number that ``splits`` reads, shape
    # ``(4 n,)``; a leaf is its own child, so that each tree takes the same number of steps
    nodes: Places
    splits: Single  # The same memory as float32: the threshold, or a leaf's value
    roots: Places  # Each tree's first node
    depth: int
    seen_from: int  # Where in ``State.seen`` its inputs begin


class Model(NamedTuple):
    """Constants of the compiled step."""

    # Shape ``(channels, lags, outputs)``: the linear features, then the base force, then the velocity; as many zeros at
    # the ends of lags and outputs as make full vectors
    taps: Array
    inputs: Inputs
    lines: Lines
    guard: PackedGuard
    bounds: PackedBounds
    features: Features
    network: Network
    trees: Trees
    # Mean and scale of the outputs of network and forest [N]
    target_mean_n: float
    target_scale_n: float
    tracker: OffsetTracker  # Tracker of the sensors' offset; no rows without one
    zeros: Array  # Change of each filter output per newton of offset; empty without a tracker


class State(NamedTuple):
    """State that the compiled step updates. Arrays of samples have one number per channel."""

    # Last samples, newest first from the place ``NEWEST`` on, shape ``(channels, 2 lags)``; each is written twice,
    # ``lags`` places apart, so that the last ``lags`` samples are always contiguous
    ring: Array
    now: Array  # This sample, with held values in place of invalid ones
    chamber: Array  # This sample without the loss of lines
    held: Array  # The last sample
    invalid: NDArray[np.bool_]
    constant_from_m: Array  # Position at which each channel last changed [m]
    frozen: NDArray[np.bool_]
    counters: Whole  # At the places named above
    motion: Array  # Features of the past motion, see ``history.new_history``
    lstm: Single  # Hidden and cell state, shape ``(2, layers, nodes)``
    offset: Array  # State of the sensors' offset, see ``sensor_offset``; empty without a tracker
    # Room for the filters' outputs, the history features, the gates, and the place in each tree
    outputs: Array
    moved: Array
    gates: Single
    places: Places
    seen: Single  # Room for hidden state, head and features, in this order, of some samples


def packed_model(model: StepModel) -> Model:
    """Lay out a model for the compiled step."""
    banks = [*model.feature_taps, model.base_taps, model.velocity_taps]
    lags = -(-max(bank.shape[1] for bank in banks) // AT_A_TIME) * AT_A_TIME
    taps = np.stack([np.pad(bank, ((0, 0), (0, lags - bank.shape[1]))) for bank in banks], axis=2)
    taps = np.pad(taps, ((0, 0), (0, 0), (0, -len(banks) % VECTOR)))
    guard, bounds, history = model.guard, model.bounds, model.history
    network: LstmWeights = model.network or NO_NETWORK
    tracker = model.offset or NO_TRACKER
    return Model(
        taps=_doubles(taps),
        inputs=Inputs(
            sign=_doubles([each.sign for each in model.input_corrections]),
            zero=_doubles([each.offset for each in model.input_corrections]),
            accept_lower=_doubles(guard.accept_lower),
            accept_upper=_doubles(guard.accept_upper),
            trained_lower=_doubles(guard.trained_lower),
            trained_upper=_doubles(guard.trained_upper),
            invalid_flags=np.array([int(invalid_flag(name)) for name in model.inputs]),
            pressures=np.array(model.pressures, dtype=np.int64),
            position=model.position,
            load=np.zeros(0) if model.position_load is None else model.position_load.packed(model.inputs),
        ),
        lines=packed_lines(model),
        guard=PackedGuard(
            freeze_travel_m=float(guard.freeze_travel_m),
            freeze_samples=guard.freeze_samples,
            freeze_force_n=float(guard.freeze_force_n),
            warm_up_samples=guard.warm_up_samples,
            recovery_samples=guard.recovery_samples,
            forces=_doubles(force_limits(model)),
            clear_samples=guard.clear_samples,
            least_pressure_pa=float(guard.least_pressure_pa),
        ),
        bounds=PackedBounds(
            lower_n=_doubles(bounds.lower_n),
            upper_n=_doubles(bounds.upper_n),
            spread_n=_doubles(bounds.spread_n),
            standstill_m_s=float(bounds.standstill_m_s),
            creep_m_s=float(bounds.creep_m_s),
            reversal_samples=bounds.reversal_samples,
        ),
        features=Features(
            limits=_doubles(model.feature_limits),
            mean=_doubles(model.feature_mean),
            scale=_doubles(model.feature_scale),
            history=_doubles([] if history is None else [history.settings(), history.mean, history.scale]).reshape(
                -1, 6
            ),
            history_source=-1 if history is None else history.position_feature,
            step_s=float(model.sample_time_s),
            total=model.feature_count,
        ),
        network=Network(
            input=_aligned(network.input),
            recurrent=_aligned(network.recurrent),
            bias=np.ascontiguousarray(network.bias),
            head=np.ascontiguousarray(network.head),
            head_bias=np.float32(network.head_bias),
            head_counts=bool(model.head_counts),
        ),
        trees=_trees(model.forest, network.nodes + 1 if model.forest_sees == "features" else 0),
        target_mean_n=float(model.target_mean_n),
        target_scale_n=float(model.target_scale_n),
        tracker=tracker,
        zeros=np.zeros(0) if model.offset is None else tracker.zero_of(taps.transpose(2, 0, 1)),
    )


def packed_lines(model: StepModel) -> Lines:
    """Lay out the lines that lose pressure."""
    lost = {name: line.terms() for name, line in model.line_loss.items()}
    return Lines(
        places=np.array([model.inputs.index(name) for name in lost], dtype=np.int64),
        signs=_doubles([FLOW_SIGNS[name] for name in lost]),
        terms=_doubles(list(lost.values())).reshape(-1, len(LossTerms._fields)),
        velocity=_doubles(model.velocity_taps[model.position]),
    )


def new_state(model: Model, offset: Array) -> State:
    """Make the state before the first sample, with this state of the sensors' offset."""
    channels, lags, outputs = model.taps.shape
    layers, nodes = len(model.network.bias), len(model.network.head)
    return State(
        ring=np.zeros((channels, 2 * lags)),
        now=np.zeros(channels),
        chamber=np.zeros(channels),
        held=np.zeros(channels),
        invalid=np.zeros(channels, dtype=np.bool_),
        constant_from_m=np.zeros(channels),
        frozen=np.zeros(channels, dtype=np.bool_),
        counters=np.zeros(UNMODELLED + 1, dtype=np.int64),
        motion=new_history(),
        lstm=np.zeros((2, layers, nodes), dtype=np.float32),
        offset=offset,
        outputs=np.zeros(outputs),
        moved=np.zeros(6),
        gates=np.zeros(4 * nodes, dtype=np.float32),
        places=np.zeros(len(model.trees.roots), dtype=np.uint32),
        seen=np.zeros((ROWS, nodes + 1 + model.features.total), dtype=np.float32),
    )


def _doubles(values: ArrayLike) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64)


def _aligned(values: Single) -> Single:
    """Copy an array to an address at which a cache line begins, so that no vector is spread over two lines."""
    room = np.empty(values.size + LINE, dtype=np.float32)
    start = -(room.ctypes.data // room.itemsize) % LINE
    aligned = room[start : start + values.size].reshape(values.shape)
    aligned[...] = values
    return aligned


def _trees(forest: Forest | None, seen_from: int) -> Trees:
    if forest is None:
        nothing = np.zeros(0, dtype=np.uint32)
        return Trees(nothing, nothing.view(np.float32), nothing, 0, seen_from)
    leaf = forest.feature < 0
    own = np.arange(len(leaf))
    nodes = np.zeros((len(leaf), 4), dtype=np.uint32)
    nodes[:, 0] = np.where(leaf, 0, forest.feature)
    nodes[:, LEFT] = 4 * np.where(leaf, own, forest.left)
    nodes[:, RIGHT] = 4 * np.where(leaf, own, forest.right)
    nodes.view(np.float32)[:, SPLIT] = np.where(leaf, forest.value, forest.threshold)
    flat = nodes.ravel()
    return Trees(flat, flat.view(np.float32), 4 * forest.roots.astype(np.uint32), forest.depth, seen_from)

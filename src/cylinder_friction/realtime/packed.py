"""A ``StepModel`` and its state laid out for the compiled step: few arrays, contiguous, nothing to look up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.flags import invalid_flag
from cylinder_friction.realtime.history import new_history
from cylinder_friction.realtime.lstm import LstmWeights
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.realtime.unmodelled_force import force_limits

if TYPE_CHECKING:
    from cylinder_friction.realtime.forest import Forest
    from cylinder_friction.realtime.model import StepModel

Single = NDArray[np.float32]
Whole = NDArray[np.int64]

# Places in ``PackedModel.settings``.
FREEZE_TRAVEL, FREEZE_FORCE, TARGET_MEAN, TARGET_SCALE, STANDSTILL, CREEP, SAMPLE_TIME, LEAST_PRESSURE = range(8)
# Rows of ``PackedModel.limits`` and of ``PackedModel.offsets``.
ACCEPT_LOWER, ACCEPT_UPPER, TRAINED_LOWER, TRAINED_UPPER = range(4)
LOWER, UPPER, SPREAD = range(3)
# Places in ``PackedModel.counts``.
FREEZE_SAMPLES, WARM_UP, RECOVERY, REVERSAL, FEATURES, HEAD_COUNTS, SEEN_FROM, DEPTH, POSITION, HISTORY, CLEAR = range(
    11
)
# Places in ``PackedState.counters``; FROZEN is one per raw pressure.
READY, NEWEST, CONSTANT, WARMING, RECOVERING, DIRECTION, REVERSAL_LEFT, UNMODELLED, FROZEN = range(9)
# Rows of ``PackedState.samples``.
NOW, HELD, CONSTANT_FROM, INVALID = range(4)

_NOTHING = np.zeros((0, 0, 0), dtype=np.float32)
NO_NETWORK = LstmWeights(_NOTHING, _NOTHING, _NOTHING.reshape(0, 0), _NOTHING.ravel(), 0.0, 0)

_NONE = np.zeros((0, 0))
NO_TRACKER = OffsetTracker(_NONE, _NONE.ravel(), _NONE.ravel(), _NONE.ravel(), _NONE, _NONE.ravel())


@dataclass(frozen=True)
class PackedModel:
    """Constants of the compiled step."""

    taps: Array  # Shape ``(channels, lags, features + 2)``: the linear features, then the base force, then the velocity
    scaling: Array  # Limits, means and scales of the linear features, shape ``(3, features)``
    history: Array  # Settings, means and scales of the history features, shape ``(3, 6)``; no rows without history
    limits: Array  # Guard limits of each input, see the rows above, shape ``(4, inputs)``
    offsets: Array  # Bounds of each regime, see the rows above, shape ``(3, 4)``
    settings: Array  # Numbers of guard, target and bounds, see the places above
    counts: Whole  # Whole numbers of guard, bounds and shape, see the places above
    invalid_flags: Whole  # Flag that an invalid value of each input sets, shape ``(inputs,)``
    pressures: Whole  # Place of each raw pressure among the inputs
    load: Array  # The load that position decides, ``PositionLoad.packed``; none without
    # The network's weights; without network no layer and no node
    input: Single
    recurrent: Single
    bias: Single
    head: Single
    head_bias: Single  # Added to the head, shape ``(1,)``
    # Each node's feature, left and right child, and a fourth column that ``splits`` reads, shape ``(n, 4)``; a leaf is
    # its own child, so that each tree takes the same number of steps
    nodes: NDArray[np.int32]
    splits: Single  # The same memory as float32: column 3 is the threshold, or a leaf's value
    roots: NDArray[np.int32]  # Each tree's first node
    forces: Array  # See ``unmodelled_force.force_limits``
    tracker: OffsetTracker  # Of the sensors' offset; without one no rows
    zeros: Array  # What one newton of offset adds to each output of the filters; none without a tracker

    @classmethod
    def of(cls, model: StepModel) -> PackedModel:
        """Return a model laid out."""
        banks = [*model.feature_taps, model.base_taps, model.velocity_taps]
        lags = max(bank.shape[1] for bank in banks)
        taps = np.stack([np.pad(bank, ((0, 0), (0, lags - bank.shape[1]))) for bank in banks], axis=2)
        history, places = model.history, model.pressures
        network = NO_NETWORK if model.network is None else model.network
        seen_from = {"nothing": 0, "hidden": 0, "hidden_head_features": 0, "features": network.nodes + 1}[
            model.forest_sees
        ]
        guard, bounds = model.guard, model.bounds
        packed_nodes, roots, depth = _packed_forest(model.forest)
        tracker = model.offset or NO_TRACKER
        return cls(
            taps=np.ascontiguousarray(taps, dtype=np.float64),
            scaling=np.ascontiguousarray([model.feature_limits, model.feature_mean, model.feature_scale]),
            history=np.array(
                [] if history is None else [history.settings(), history.mean, history.scale], dtype=np.float64
            ).reshape(-1, 6),
            limits=np.array([guard.accept_lower, guard.accept_upper, guard.trained_lower, guard.trained_upper]),
            offsets=np.array([bounds.lower_n, bounds.upper_n, bounds.spread_n]),
            settings=np.array(
                [
                    *(guard.freeze_travel_m, guard.freeze_force_n, model.target_mean_n, model.target_scale_n),
                    *(bounds.standstill_m_s, bounds.creep_m_s, model.sample_time_s, guard.least_pressure_pa),
                ]
            ),
            counts=np.array(
                [
                    *(guard.freeze_samples, guard.warm_up_samples, guard.recovery_samples, bounds.reversal_samples),
                    *(model.feature_count, int(model.head_counts), seen_from, depth, model.position),
                    -1 if history is None else history.position_feature,
                    guard.clear_samples,
                ],
                dtype=np.int64,
            ),
            invalid_flags=np.array([int(invalid_flag(name)) for name in model.inputs]),
            pressures=np.array(places, dtype=np.int64),
            load=np.zeros(0) if model.position_load is None else model.position_load.packed(),
            input=np.ascontiguousarray(network.input),
            recurrent=np.ascontiguousarray(network.recurrent),
            bias=np.ascontiguousarray(network.bias),
            head=np.ascontiguousarray(network.head),
            head_bias=np.array([network.head_bias], dtype=np.float32),
            nodes=packed_nodes,
            splits=packed_nodes.view(np.float32),
            roots=roots,
            forces=force_limits(model),
            tracker=tracker,
            zeros=np.zeros(0) if model.offset is None else tracker.zero_of(taps.transpose(2, 0, 1)),
        )

    def arrays(self) -> tuple[Any, ...]:
        """Return the arrays in the order in which the compiled step takes them."""
        return (
            *(self.taps, self.scaling, self.history, self.limits, self.offsets, self.settings, self.counts),
            *(self.invalid_flags, self.pressures, self.load),
            *(self.input, self.recurrent, self.bias, self.head, self.head_bias),
            *(self.nodes, self.splits, self.roots, self.forces),
            *(*self.tracker.constants(), self.zeros),
        )


@dataclass(frozen=True)
class PackedState:
    """What the compiled step changes."""

    # Each input's last samples, written twice, ``lags`` places from each other, so that from the newest on they always
    # lie in a row, newest first, shape ``(channels, 2 lags)``
    ring: Array
    # One number per channel in each row, see the rows above: this sample as it counts, the last one, the position at
    # which the input last changed [m], whether the input is invalid
    samples: Array
    motion: Array  # Memory of the motion, see ``history.new_history``
    counters: Whole  # See the places above
    lstm: Single  # Hidden and cell state, shape ``(2, layers, nodes)``
    outputs: Array  # Room for the filters' outputs, shape ``(linear features + 2,)``
    moved: Array  # Room for the history features, shape ``(6,)``
    seen: Single  # Room for hidden state, head and features, shape ``(nodes + 1 + features,)``
    gates: Single  # Room for the gates, shape ``(4 nodes,)``
    places: NDArray[np.int32]  # Room for where each tree is, shape ``(trees,)``
    offset: Array  # Of the sensors, see ``sensor_offset``; none without a tracker

    @classmethod
    def of(cls, model: PackedModel) -> PackedState:
        """Return a state before the first sample."""
        channels, lags, outputs = model.taps.shape
        layers, nodes = len(model.bias), len(model.head)
        return cls(
            ring=np.zeros((channels, 2 * lags)),
            samples=np.zeros((4, channels)),
            motion=new_history(),
            counters=np.zeros(FROZEN + len(model.pressures), dtype=np.int64),
            lstm=np.zeros((2, layers, nodes), dtype=np.float32),
            outputs=np.zeros(outputs),
            moved=np.zeros(6),
            seen=np.zeros(nodes + 1 + int(model.counts[FEATURES]), dtype=np.float32),
            gates=np.zeros(4 * nodes, dtype=np.float32),
            places=np.zeros(len(model.roots), dtype=np.int32),
            offset=model.tracker.new_state() if len(model.zeros) else np.zeros(0),
        )

    def reset(self, offset: Array) -> None:
        """Forget everything but the sensors' offset, which is as given."""
        self.offset[:] = offset
        self.counters[:] = 0
        self.lstm[:] = 0.0
        self.motion[:] = new_history()

    def arrays(self) -> tuple[Any, ...]:
        """Return the arrays in the order in which the compiled step takes them."""
        return (
            *(self.ring, self.samples, self.motion, self.counters, self.lstm),
            *(self.outputs, self.moved, self.seen, self.gates, self.places, self.offset),
        )


def _packed_forest(forest: Forest | None) -> tuple[NDArray[np.int32], NDArray[np.int32], int]:
    if forest is None:
        return np.zeros((0, 4), dtype=np.int32), np.zeros(0, dtype=np.int32), 0
    leaf = forest.feature < 0
    own = np.arange(len(leaf))
    nodes = np.zeros((len(leaf), 4), dtype=np.int32)
    nodes[:, 0] = np.where(leaf, 0, forest.feature)
    nodes[:, 1] = np.where(leaf, own, forest.left)
    nodes[:, 2] = np.where(leaf, own, forest.right)
    nodes.view(np.float32)[:, 3] = np.where(leaf, forest.value, forest.threshold)
    return nodes, forest.roots.astype(np.int32), forest.depth

"""The step graph: one raw sample and the state in, newtons, flags and the state out."""

import numpy as np
import onnx
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs import sensor_offset as learning
from cylinder_friction.deployment.onnx_graphs.checks import Validity, check_validity, checked, follow_motion, unchanging
from cylinder_friction.deployment.onnx_graphs.description import described, input_text, outputs_of
from cylinder_friction.deployment.onnx_graphs.estimated import estimated, filtered, lags_of
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.history import STATE, begin_history, history_step
from cylinder_friction.deployment.onnx_graphs.position_load import with_load
from cylinder_friction.deployment.onnx_graphs.rows import (
    CHANGED_AT,
    DIRECTION,
    FAR,
    HAPPENED_AT,
    LONG_AGO,
    TURNED_AT,
    UNMODELLED,
    Rows,
)
from cylinder_friction.realtime.history import History
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OffsetTracker

MEANING = (
    "Friction of a hydraulic cylinder from one raw sample. Feed memory_out and network_out back as memory and network "
    "at the next sample; zeros before the first."
)


def step_graph(model: StepModel) -> onnx.ModelProto:
    """Return the whole of one step as one graph; a state of zeros is a fresh start."""
    graph = Graph()
    validity = check_validity(graph, model, "sample")
    rows = StepRows(graph, model, validity)
    filtered(graph, model, rows)
    if model.offset is not None:
        begin_offset(graph, model.offset)
        learning.take_off(graph, model, model.offset)
    unmodelled = follow_motion(graph, model, rows)
    flags, regime = checked(graph, model, rows, unchanging(graph, model, rows), unmodelled)
    newtons = estimated(graph, model, rows, regime)
    graph.add("Where", "running", flags, validity.unready_flags, to="final_flags")
    graph.cast("final_flags", "flags", TensorProto.INT32)
    graph.add("Mul", newtons, "running_number", to="newtons")  # 0 before the first valid sample
    graph.split("newtons", dict.fromkeys(("friction_n", "lower_n", "upper_n"), 1))
    rows.remember()
    graph.takes("sample", TensorProto.DOUBLE, [1, len(model.inputs)], input_text(model))
    graph.takes("memory", TensorProto.DOUBLE, [1, rows.size], "what filters and guard remember; zeros at a start")
    for name, meaning in outputs_of(model).items():
        graph.gives(name, TensorProto.INT32 if name == "flags" else TensorProto.DOUBLE, [1, 1], meaning)
    graph.gives("memory_out", TensorProto.DOUBLE, [1, rows.size], "memory of the next step")
    if model.network is not None:
        shape = [2 * model.network.layers, 1, model.network.nodes]
        graph.takes("network", TensorProto.FLOAT, shape, "hidden and cell state, layer by layer; zeros at a start")
        graph.gives("network_out", TensorProto.FLOAT, shape, "network of the next step")
        graph.add("Where", "running", "network_state", "network", to="network_out")
    if model.offset is not None:
        learn_offset(graph, model, model.offset, rows, unmodelled)
    return graph.model("step", MEANING, described(model))


class StepRows:
    """One row, whose past lies in ``memory``.

    Memory, as doubles: the last samples (newest first, one number per channel each), ``CHANGED_AT``, ``HAPPENED_AT``,
    ``TURNED_AT``, ``UNMODELLED`` where the model knows the range of the force balance, direction, clock, the state of
    the history where the model has one, and 1 once a valid sample has come. While that is 0, the rest means nothing.
    """

    single = True
    sample = "clean"
    clock = "clock"
    window = "window"

    def __init__(self, graph: Graph, model: StepModel, validity: Validity) -> None:
        self._graph, self._model = graph, model
        block_lags = 0 if model.offset is None else learning.block_taps(model, model.offset).shape[2]
        self.lags = max(lags_of(model), block_lags)
        channels, past = len(model.channels), (self.lags - 1) * len(model.channels)
        lengths = {"past": past, "oldest": channels, CHANGED_AT: len(model.pressures) + 1, HAPPENED_AT: 2, TURNED_AT: 1}
        lengths |= {UNMODELLED: int(bool(model.guard.force_weights)), DIRECTION: 1, "clock": 1}
        lengths |= {"history": 0 if model.history is None else len(STATE), "ready": 1}
        self._lengths = {name: length for name, length in lengths.items() if length}
        self.size = sum(lengths.values())
        self.accepted = validity.accepted
        self.never = graph.constant([[False]], np.bool_)
        self._begin(validity)

    def latest(self, what: str, values: str, fresh: str) -> str:
        return self._graph.add("Where", fresh, values, what + "_before", to=what)

    def latched(self, what: str, over: str, fresh: str) -> str:  # noqa: ARG002 - a change takes FAR back
        self._graph.add("Where", over, self._graph.constant(FAR), what, to=what + "_or_far")
        return over

    def since(self, what: str, happens: str, counts: str) -> str:
        graph = self._graph
        graph.add("Where", happens, graph.constant(0.0), what + "_before", to=what)
        graph.cast(counts, what + "_counts", TensorProto.DOUBLE)
        graph.add("Add", what, what + "_counts", to=what + "_after")
        return what

    def direction_before(self, direction: str) -> str:
        return direction + "_before"

    def lasting(self, holds: str) -> str:
        graph = self._graph
        graph.cast(holds, holds + "_number", TensorProto.DOUBLE)
        graph.add("Add", holds + "_before", graph.constant([[1.0]]), to=holds + "_longer")
        return graph.add("Mul", holds + "_longer", holds + "_number", to=holds + "_rows_each")

    def advance_history(self, history: History, smooth_m: str, sample_time_s: float) -> str:
        begun = begin_history(self._graph, smooth_m)
        before = self._graph.add("Where", "ready", "history_before", begun, to="history_state")
        return history_step(self._graph, history, sample_time_s, smooth_m, before)[0]

    def remember(self) -> None:
        """Make ``memory_out``."""
        after = ["window", CHANGED_AT + "_or_far", HAPPENED_AT, TURNED_AT]
        after += [UNMODELLED + "_after"] if UNMODELLED in self._lengths else []
        after += [DIRECTION, "clock"]
        after += ["history_state_out"] if "history" in self._lengths else []
        self._graph.add("Concat", *after, "running_number", to="memory_out", axis=1)

    def _begin(self, validity: Validity) -> None:
        """Hold invalid values; at the first valid sample, make a memory as if it had always been there."""
        graph, inputs, channels = self._graph, len(self._model.inputs), len(self._model.channels)
        graph.add("Gather", "memory", graph.indices(self.size - 1), to="ready_number", axis=1)
        graph.cast("ready_number", "ready", TensorProto.BOOL)
        graph.add("Or", "ready", validity.valid, to="running")
        graph.cast("running", "running_number", TensorProto.DOUBLE)
        graph.add("Gather", "memory", graph.indices(*range(inputs)), to="held", axis=1)
        graph.add("Where", validity.accepted, "sample", "held", to="clean")
        self.channels = with_load(graph, self._model, self.sample)
        graph.add("Concat", self.channels, graph.constant([[0.0, LONG_AGO, FAR]]), to="beginnings", axis=1)
        position, zero, never, far = self._model.position, channels, channels + 1, channels + 2
        begun = [*range(channels)] * self.lags
        begun += [*[position] * len(self._model.pressures), zero, never, zero, never]
        begun += [far] if UNMODELLED in self._lengths else []
        begun += [zero] * (self.size - len(begun))
        graph.add("Gather", "beginnings", graph.indices(*begun), to="memory_at_first", axis=1)
        graph.add("Where", "ready", "memory", "memory_at_first", to="memory_before")
        graph.split("memory_before", {f"{name}_before": length for name, length in self._lengths.items()})
        graph.add("Add", "clock_before", graph.constant([[1.0]]), to="clock")
        graph.add("Concat", self.channels, "past_before", to="window", axis=1)


OFFSET_STATE = {
    "offset_given": learning.GIVEN,
    "offset_taken_n": 1,
    "offset_variance": 1,
    "offset_known": 1,
    "offset_learned": learning.LEARNED,
    "sliding_before": 3,
}
"""Lengths of the parts of the state ``offset``: what was given before the first sample; the offset [N] and its stated
variance that the next step takes; whether the piston has slid in both directions; what is learned; and for how many
steps it has slid outwards, inwards, and rested."""
OFFSET_SIZE = [1, sum(OFFSET_STATE.values())]
OFFSET_MEANING = (
    "what is known of the sensors' offset: offset_out of the step before; at a start zeros, or the offset in friction "
    "and its standard uncertainty [N], then zeros"
)


def begin_offset(graph: Graph, tracker: OffsetTracker) -> None:
    """Make the parts of ``OFFSET_STATE``; until the first valid sample they follow from what was given alone."""
    going, new = Graph("going_"), Graph("new_")
    going.gives(going.add("Identity", "offset", to="offset_as_was"), TensorProto.DOUBLE, OFFSET_SIZE, "state")
    given = new.add("Slice", "offset", *(new.indices(each) for each in (0, learning.GIVEN, 1)), to="given")
    learned, variance = learning.new_learned(new, tracker, given, "learned_at_first")
    # Before the first valid sample no time passes in which the offset could drift: less what ``learn_offset`` will add
    new.add("Sub", "running_number", new.constant([[1.0]]), to="steps_too_many")
    new.add("Mul", "steps_too_many", new.constant(learning.walk(tracker)), to="walk_too_many")
    new.add("Add", learned, "walk_too_many", to="learned_before_first")
    variance = learning.stated(new, tracker, variance, "stated_at_first")
    parts = [given, "given_n", variance, "given_number", "learned_before_first"]
    new.add("Concat", *parts, new.constant([[0.0, 0.0, 0.0]]), to="offset_at_first", axis=1)
    new.gives("offset_at_first", TensorProto.DOUBLE, OFFSET_SIZE, "state")
    branches = {"then_branch": going.body("going"), "else_branch": new.body("new")}
    graph.add("If", "ready", to="offset_before", **branches)
    graph.split("offset_before", OFFSET_STATE)


def learn_offset(graph: Graph, model: StepModel, tracker: OffsetTracker, rows: Rows, unmodelled: list[str]) -> None:
    """Make ``offset_out``, ``offset_n`` and ``offset_uncertainty_n``: what the next step takes off."""
    trouble = graph.add("Or", "bad", *unmodelled, to="bad_or_unmodelled") if unmodelled else "bad"
    ends, sliding = learning.block_ends(graph, tracker, rows, graph.add("Not", trouble, to="sound"))
    walked = graph.add("Add", "offset_learned", graph.constant(learning.walk(tracker)), to="offset_walked")
    ended, going = Graph("block_"), Graph("between_")
    averages = learning.averaged(ended, model, tracker, rows.window, rows.lags, "averages")
    block = learning.explained(ended, tracker, averages, "block")
    learning.learn(ended, tracker, block, learning.first_block(ended, tracker), walked, "learned_now")
    ended.gives("learned_now", TensorProto.DOUBLE, [1, learning.LEARNED], "learned")
    going.gives(
        going.add("Identity", walked, to="learned_before"), TensorProto.DOUBLE, [1, learning.LEARNED], "learned"
    )
    branches = {"then_branch": ended.body("ended"), "else_branch": going.body("between")}
    graph.add("If", ends, to="learned", **branches)
    learning.shown(graph, tracker, "learned", ("offset_n", "learned_variance", "learned_known"))
    variance = learning.stated(graph, tracker, "learned_variance", "stated_variance")
    graph.add("Sqrt", variance, to="offset_uncertainty_n")
    after = ["offset_given", "offset_n", variance, "learned_known", "learned", sliding]
    graph.add("Concat", *after, to="offset_out", axis=1)
    graph.takes("offset", TensorProto.DOUBLE, OFFSET_SIZE, OFFSET_MEANING)
    graph.gives("offset_out", TensorProto.DOUBLE, OFFSET_SIZE, "offset of the next step")

"""The step graph: one raw sample and the state in, newtons, flags and the state out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.checks import Validity, check_validity, checked, unchanging
from cylinder_friction.deployment.onnx_graphs.description import described, input_text, outputs_of
from cylinder_friction.deployment.onnx_graphs.estimated import estimated, filtered, lags_of
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.history import STATE, begin_history, history_step
from cylinder_friction.deployment.onnx_graphs.offset_in_step import begin_offset, learn_offset
from cylinder_friction.deployment.onnx_graphs.rows import CHANGED_AT, DIRECTION, FAR, HAPPENED_AT, LONG_AGO
from cylinder_friction.deployment.onnx_graphs.sensor_offset import block_taps, take_off
from cylinder_friction.realtime.history import History
from cylinder_friction.realtime.model import StepModel

if TYPE_CHECKING:
    import onnx

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
        take_off(graph, model, model.offset)
    flags, regime = checked(graph, model, rows, unchanging(graph, model, rows))
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
        learn_offset(graph, model, model.offset, rows)
    return graph.model("step", MEANING, described(model))


class StepRows:
    """One row, whose past lies in ``memory``.

    Memory, as doubles: the last samples (newest first, one number per input each), ``CHANGED_AT``, ``HAPPENED_AT``,
    direction, clock, the state of the history where the model has one, and 1 once a valid sample has come. While that
    is 0, the rest means nothing.
    """

    single = True
    sample = "clean"
    clock = "clock"
    window = "window"

    def __init__(self, graph: Graph, model: StepModel, validity: Validity) -> None:
        self._graph, self._model = graph, model
        block_lags = 0 if model.offset is None else block_taps(model, model.offset).shape[2]
        self.lags = max(lags_of(model), block_lags)
        inputs, past = len(model.inputs), (self.lags - 1) * len(model.inputs)
        lengths = {"past": past, "oldest": inputs, CHANGED_AT: len(model.pressures) + 1, HAPPENED_AT: 3}
        lengths |= {DIRECTION: 1, "clock": 1, "history": 0 if model.history is None else len(STATE), "ready": 1}
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
        after = ["window", CHANGED_AT + "_or_far", HAPPENED_AT, DIRECTION, "clock"]
        after += ["history_state_out"] if "history" in self._lengths else []
        self._graph.add("Concat", *after, "running_number", to="memory_out", axis=1)

    def _begin(self, validity: Validity) -> None:
        """Hold invalid values; at the first valid sample, make a memory as if it had always been there."""
        graph, inputs = self._graph, len(self._model.inputs)
        graph.add("Gather", "memory", graph.indices(self.size - 1), to="ready_number", axis=1)
        graph.cast("ready_number", "ready", TensorProto.BOOL)
        graph.add("Or", "ready", validity.valid, to="running")
        graph.cast("running", "running_number", TensorProto.DOUBLE)
        graph.add("Gather", "memory", graph.indices(*range(inputs)), to="held", axis=1)
        graph.add("Where", validity.accepted, "sample", "held", to="clean")
        graph.add("Concat", "clean", graph.constant([[0.0, LONG_AGO]]), to="beginnings", axis=1)
        position, zero, never = self._model.position, inputs, inputs + 1
        begun = [*range(inputs)] * self.lags
        begun += [*[position] * len(self._model.pressures), zero, never, never, zero]
        begun += [zero] * (self.size - len(begun))
        graph.add("Gather", "beginnings", graph.indices(*begun), to="memory_at_first", axis=1)
        graph.add("Where", "ready", "memory", "memory_at_first", to="memory_before")
        graph.split("memory_before", {f"{name}_before": length for name, length in self._lengths.items()})
        graph.add("Add", "clock_before", graph.constant([[1.0]]), to="clock")
        graph.add("Concat", "clean", "past_before", to="window", axis=1)

"""The step graph: one raw sample and the state in, newtons, flags and the state out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.description import INPUTS, OUTPUTS, described
from cylinder_friction.deployment.onnx_graphs.estimated import estimated, filtered, lags_of
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.judged import Validity, judged, judged_valid
from cylinder_friction.deployment.onnx_graphs.rows import CHANGED_AT, DIRECTION, FAR, HAPPENED_AT, LONG_AGO

if TYPE_CHECKING:
    import onnx

    from cylinder_friction.realtime.model import StepModel

MEANING = (
    "Friction of a hydraulic cylinder from one raw sample. Feed memory_out and network_out back as memory and network "
    "at the next sample; zeros before the first."
)


def step_graph(model: StepModel) -> onnx.ModelProto:
    """Return the whole of one step as one graph; a state of zeros is a fresh start."""
    graph = Graph()
    validity = judged_valid(graph, model.guard, "sample")
    rows = StepRows(graph, model, validity)
    filtered(graph, model, rows)
    flags, regime = judged(graph, model, rows)
    newtons = estimated(graph, model, rows, regime)
    graph.add("Where", "running", flags, validity.unready_flags, to="final_flags")
    graph.cast("final_flags", "flags", TensorProto.INT32)
    graph.add("Mul", newtons, "running_number", to="newtons")  # 0 before the first sound sample
    graph.split("newtons", dict.fromkeys(("friction_n", "lower_n", "upper_n"), 1))
    rows.remember()
    graph.takes("sample", TensorProto.DOUBLE, [1, 3], INPUTS)
    graph.takes("memory", TensorProto.DOUBLE, [1, rows.size], "what filters and guard remember; zeros at a start")
    for name, meaning in OUTPUTS.items():
        graph.gives(name, TensorProto.INT32 if name == "flags" else TensorProto.DOUBLE, [1, 1], meaning)
    graph.gives("memory_out", TensorProto.DOUBLE, [1, rows.size], "memory of the next step")
    if model.network is not None:
        shape = [2 * model.network.layers, 1, model.network.nodes]
        graph.takes("network", TensorProto.FLOAT, shape, "hidden and cell state, layer by layer; zeros at a start")
        graph.gives("network_out", TensorProto.FLOAT, shape, "network of the next step")
        graph.add("Where", "running", "network_state", "network", to="network_out")
    return graph.model("step", MEANING, described(model))


class StepRows:
    """One row, whose past lies in ``memory``.

    Memory, as doubles: the last samples (newest first, three each), ``CHANGED_AT``, ``HAPPENED_AT``, direction, clock,
    and 1 once a sound sample has come. While it is 0, the rest means nothing.
    """

    single = True
    sample = "clean"
    clock = "clock"
    window = "window"

    def __init__(self, graph: Graph, model: StepModel, validity: Validity) -> None:
        self._graph = graph
        self._lags = lags_of(model)
        self.size = 3 * self._lags + 9
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

    def remember(self) -> None:
        """Make ``memory_out``."""
        after = ("window", CHANGED_AT + "_or_far", HAPPENED_AT, DIRECTION, "clock", "running_number")
        self._graph.add("Concat", *after, to="memory_out", axis=1)

    def _begin(self, validity: Validity) -> None:
        """Hold invalid values; at the first sound sample, makes a memory as if it had always been there."""
        graph, past = self._graph, self._lags - 1
        graph.add("Gather", "memory", graph.indices(self.size - 1), to="ready_number", axis=1)
        graph.cast("ready_number", "ready", TensorProto.BOOL)
        graph.add("Or", "ready", validity.sound, to="running")
        graph.cast("running", "running_number", TensorProto.DOUBLE)
        graph.add("Gather", "memory", graph.indices(0, 1, 2), to="held", axis=1)
        graph.add("Where", validity.accepted, "sample", "held", to="clean")
        graph.add("Concat", "clean", graph.constant([[0.0, LONG_AGO]]), to="beginnings", axis=1)
        position, zero, never = 2, 3, 4
        begun = [*([0, 1, 2] * self._lags), position, position, zero, never, never, zero, zero, zero, zero]
        graph.add("Gather", "beginnings", graph.indices(*begun), to="memory_at_first", axis=1)
        graph.add("Where", "ready", "memory", "memory_at_first", to="memory_before")
        lengths = {"past": 3 * past, "oldest": 3, CHANGED_AT: 3, HAPPENED_AT: 3, DIRECTION: 1, "clock": 1, "ready": 1}
        graph.split("memory_before", {f"{name}_before": length for name, length in lengths.items()})
        graph.add("Add", "clock_before", graph.constant([[1.0]]), to="clock")
        graph.add("Concat", "clean", "past_before", to="window", axis=1)

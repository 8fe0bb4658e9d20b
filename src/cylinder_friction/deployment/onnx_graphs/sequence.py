"""The sequence graph: a whole recording in, newtons and flags of every sample out, from a fresh state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.checks import Validity, check_validity, checked, unchanging
from cylinder_friction.deployment.onnx_graphs.description import OUTPUTS, described, input_text, outputs_of
from cylinder_friction.deployment.onnx_graphs.estimated import estimated, filtered, lags_of
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.history import history_rows
from cylinder_friction.deployment.onnx_graphs.offset_in_sequence import PADDING, learn_offset
from cylinder_friction.deployment.onnx_graphs.rows import CHANGED_AT, LONG_AGO
from cylinder_friction.deployment.onnx_graphs.sensor_offset import take_off
from cylinder_friction.realtime.history import History
from cylinder_friction.realtime.model import StepModel

if TYPE_CHECKING:
    import onnx

MEANING = "Friction of a hydraulic cylinder from a recording's raw samples, as if stepped through from a fresh start."
LAST = np.iinfo(np.int64).max


def sequence_graph(model: StepModel) -> onnx.ModelProto:
    """Return the estimate of whole recordings as one graph, without loops but those of LSTM, history and offset."""
    graph = Graph()
    text = input_text(model).replace("raw sample", "raw samples")
    graph.takes("samples", TensorProto.DOUBLE, ["time", len(model.inputs)], text)
    validity = check_validity(graph, model, "samples")
    rows = SequenceRows(graph, model, validity)
    filtered(graph, model, rows)
    constant = unchanging(graph, model, rows)
    if model.offset is not None:
        learn_offset(graph, model, model.offset, rows, constant)
        take_off(graph, model, model.offset)
    flags, regime = checked(graph, model, rows, constant)
    newtons = estimated(graph, model, rows, regime)
    graph.add("Pad", newtons, rows.padding, to="newtons")  # 0 before the first valid sample
    parts = {name: 1 for name in OUTPUTS if name != "flags"}
    graph.split("newtons", {f"{name}_column": width for name, width in parts.items()})
    graph.add("Pad", flags, rows.padding, to="padded_flags")
    graph.add("Where", "started", "padded_flags", validity.unready_flags, to="final_flags")
    graph.cast("final_flags", "flags_column", TensorProto.INT32)
    for name, meaning in outputs_of(model).items():
        graph.add("Squeeze", f"{name}_column", graph.indices(1), to=name)
        graph.gives(name, TensorProto.INT32 if name == "flags" else TensorProto.DOUBLE, ["time"], meaning)
    return graph.model("sequence", MEANING, described(model))


class SequenceRows:
    """All rows from the first valid sample on, and one made-up valid row of zeros after the last.

    That row, cut off in the end, is there so that a recording without a valid sample has a first row too; nothing
    looks ahead, so no other row sees it.
    """

    single = False
    sample = "clean"
    accepted = "accepted_rows"
    clock = "clock"
    window = "window"
    never = "never"
    padding = PADDING

    def __init__(self, graph: Graph, model: StepModel, validity: Validity) -> None:
        self._graph, self._model, self.lags = graph, model, lags_of(model)
        self._begin(validity)
        self._hold()
        self._windows(self.lags)

    def latest(self, what: str, values: str, fresh: str) -> str:
        graph = self._graph
        pressures = len(self._model.pressures)
        if what == CHANGED_AT:  # as if the first sample had been there one step before it
            begin = graph.add("Sub", values, graph.constant([[*[0.0] * pressures, 1.0]]), to=what + "_begin")
        else:
            begin = graph.constant([[LONG_AGO, LONG_AGO, 0.0]])
        graph.add("Where", fresh, values, begin, to=what + "_values")
        return self._filled(what, what + "_values", fresh, pressures + 1 if what == CHANGED_AT else 3)

    def latched(self, what: str, over: str, fresh: str) -> str:
        graph = self._graph
        graph.cast(over, "over_number", TensorProto.DOUBLE)
        graph.add("CumSum", "over_number", graph.constant(0, np.int64), to="over_count")
        since = self._filled(what + "_over", "over_count", fresh, len(self._model.pressures) + 1)
        graph.add("Greater", "over_count", since, to="over_since")
        return graph.add("Or", over, "over_since", to="over_latched")

    def lasting(self, holds: str) -> str:
        graph = self._graph
        graph.add("Not", holds, to=holds + "_not")
        graph.add("Where", holds + "_not", self.clock, graph.constant([[0.0, 0.0, 0.0]]), to=holds + "_not_at")
        last = self._filled(holds, holds + "_not_at", holds + "_not", 3)
        return graph.add("Sub", self.clock, last, to=holds + "_rows_each")

    def advance_history(self, history: History, smooth_m: str, sample_time_s: float) -> str:
        return history_rows(self._graph, history, sample_time_s, smooth_m)

    def direction_before(self, direction: str) -> str:
        graph = self._graph
        bounds = graph.indices(0), graph.indices(-1), graph.indices(0)
        graph.add("Slice", direction, *bounds, to="direction_but_last")
        return graph.add("Concat", graph.constant([[0.0]]), "direction_but_last", to="direction_before", axis=0)

    def _begin(self, validity: Validity) -> None:
        """Cut off what comes before the first valid sample."""
        graph, inputs = self._graph, len(self._model.inputs)
        extra = {"samples": graph.constant(np.zeros((1, inputs)))}
        extra[validity.accepted] = graph.constant([[True] * inputs], np.bool_)
        graph.cast(validity.valid, "valid_number", TensorProto.INT64)
        graph.add("CumSum", "valid_number", graph.constant(0, np.int64), to="valid_count")
        graph.add("Greater", "valid_count", graph.constant(0, np.int64), to="started")
        graph.add("Concat", "started", graph.constant([[True]], np.bool_), to="started_extended", axis=0)
        graph.add("Squeeze", "started_extended", graph.indices(1), to="kept")
        for (source, row), kept in zip(extra.items(), ("raw", self.accepted), strict=True):
            graph.add("Concat", source, row, to=kept + "_extended", axis=0)
            graph.add("Compress", kept + "_extended", "kept", to=kept, axis=0)
        graph.cast("started_extended", "started_number", TensorProto.DOUBLE)
        graph.add("CumSum", "started_number", graph.constant(0, np.int64), to="clock_extended")
        graph.add("Compress", "clock_extended", "kept", to=self.clock, axis=0)
        graph.add("Less", self.clock, graph.constant(0.0), to=self.never)
        graph.add("Equal", self.clock, graph.constant(1.0), to="first")
        graph.add("Shape", "kept", to="rows_in")
        graph.add("Shape", "raw", to="raw_shape")
        graph.add("Gather", "raw_shape", graph.indices(0), to="rows", axis=0)
        graph.add("Sub", "rows_in", "rows", to="rows_cut")
        graph.add("Concat", "rows_cut", graph.indices(0, -1, 0), to=self.padding, axis=0)

    def _hold(self) -> None:
        self._filled("clean", "raw", self.accepted, len(self._model.inputs), to=self.sample)

    def _windows(self, lags: int) -> None:
        """Make each row's last samples, newest first, as if the first had always been there."""
        graph = self._graph
        graph.add("Slice", self.sample, *(graph.indices(at) for at in (0, 1, 0)), to="first_sample")
        graph.add("Expand", "first_sample", graph.indices(lags - 1, len(self._model.inputs)), to="always")
        graph.add("Concat", "always", self.sample, to="extended", axis=0)
        shifted = []
        for lag in range(lags):
            bounds = (lags - 1 - lag, -lag if lag else LAST, 0)
            shifted.append(graph.add("Slice", "extended", *(graph.indices(at) for at in bounds), to=f"lag_{lag}"))
        graph.add("Concat", *shifted, to=self.window, axis=1)

    def _filled(self, name: str, values: str, fresh: str, columns: int, to: str = "") -> str:
        """Return each column's last fresh value, shape ``(n, columns)``; the first row counts as fresh.

        The columns lie one after the other; the fresh values are drawn together, and counted off again.
        """
        graph = self._graph
        graph.add("Or", fresh, "first", to=name + "_fresh")
        for part in (name + "_fresh", values):
            graph.add("Transpose", part, to=f"{name}_{part}_across", perm=[1, 0])
            graph.add("Reshape", f"{name}_{part}_across", graph.indices(-1), to=f"{name}_{part}_flat")
        flat_fresh, flat = f"{name}_{name}_fresh_flat", f"{name}_{values}_flat"
        graph.cast(flat_fresh, name + "_number", TensorProto.INT64)
        graph.add("CumSum", name + "_number", graph.constant(0, np.int64), to=name + "_count")
        graph.add("Sub", name + "_count", graph.indices(1), to=name + "_index")
        graph.add("Compress", flat, flat_fresh, to=name + "_drawn", axis=0)
        graph.add("Gather", name + "_drawn", name + "_index", to=name + "_flat", axis=0)
        graph.add("Reshape", name + "_flat", graph.indices(columns, -1), to=name + "_columns")
        return graph.add("Transpose", name + "_columns", to=to or name + "_latest", perm=[1, 0])

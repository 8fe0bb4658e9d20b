"""The sequence graph: a whole recording in, newtons and flags of every sample out, from a fresh state."""

import numpy as np
import onnx
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs import sensor_offset as learning
from cylinder_friction.deployment.onnx_graphs.checks import Validity, check_validity, checked, follow_motion, unchanging
from cylinder_friction.deployment.onnx_graphs.description import OUTPUTS, described, input_text, outputs_of
from cylinder_friction.deployment.onnx_graphs.estimated import estimated, filtered, lags_of
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.history import history_rows
from cylinder_friction.deployment.onnx_graphs.position_load import with_load
from cylinder_friction.deployment.onnx_graphs.rows import CHANGED_AT, HAPPENED_AT, LONG_AGO, Rows
from cylinder_friction.realtime.history import History
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OffsetTracker

MEANING = "Friction of a hydraulic cylinder from a recording's raw samples, as if stepped through from a fresh start."
LAST = np.iinfo(np.int64).max
PADDING = "padding"  # Rows that come before the first valid sample, and the last one, cut off


def sequence_graph(model: StepModel) -> onnx.ModelProto:
    """Return the estimate of whole recordings as one graph, without loops but those of LSTM, history and offset."""
    graph = Graph()
    text = input_text(model).replace("raw sample", "raw samples")
    graph.takes("samples", TensorProto.DOUBLE, ["time", len(model.inputs)], text)
    validity = check_validity(graph, model, "samples")
    rows = SequenceRows(graph, model, validity)
    filtered(graph, model, rows)
    constant, unmodelled = unchanging(graph, model, rows), follow_motion(graph, model, rows)
    if model.offset is not None:
        learn_offset(graph, model, model.offset, rows, [constant, *unmodelled])
        learning.take_off(graph, model, model.offset)
    flags, regime = checked(graph, model, rows, constant, unmodelled)
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
        self.channels = with_load(graph, model, self.sample)
        self._windows(self.lags)

    def latest(self, what: str, values: str, fresh: str) -> str:
        graph = self._graph
        begun = [LONG_AGO, 0.0] if what == HAPPENED_AT else [LONG_AGO]
        begin = graph.constant([begun])
        if what == CHANGED_AT:  # as if the first sample had been there one step before it
            begun = [*[0.0] * len(self._model.pressures), 1.0]
            begin = graph.add("Sub", values, graph.constant([begun]), to=what + "_begin")
        graph.add("Where", fresh, values, begin, to=what + "_values")
        return self._filled(what, what + "_values", fresh, len(begun))

    def latched(self, what: str, over: str, fresh: str) -> str:
        graph = self._graph
        graph.cast(over, "over_number", TensorProto.DOUBLE)
        graph.add("CumSum", "over_number", graph.constant(0, np.int64), to="over_count")
        since = self._filled(what + "_over", "over_count", fresh, len(self._model.pressures) + 1)
        graph.add("Greater", "over_count", since, to="over_since")
        return graph.add("Or", over, "over_since", to="over_latched")

    def since(self, what: str, happens: str, counts: str) -> str:
        graph = self._graph
        graph.cast(counts, what + "_counts", TensorProto.DOUBLE)
        graph.add("CumSum", what + "_counts", graph.constant(0, np.int64), to=what + "_before", exclusive=1)
        return graph.add("Sub", what + "_before", self.latest(what, what + "_before", happens), to=what)

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
        graph.add("Slice", self.channels, *(graph.indices(at) for at in (0, 1, 0)), to="first_sample")
        graph.add("Expand", "first_sample", graph.indices(lags - 1, len(self._model.channels)), to="always")
        graph.add("Concat", "always", self.channels, to="extended", axis=0)
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


def learn_offset(graph: Graph, model: StepModel, tracker: OffsetTracker, rows: Rows, doubts: list[str]) -> None:
    """Make ``offset_taken_n``, ``offset_variance``, ``offset_known`` of each row, and the columns of both outputs.

    A row with any of ``doubts`` counts as invalid: its position has been constant for too long, whatever the force, and
    so does not slide, or its force is not modelled.
    """
    given = "the sensors' offset in friction before the first sample and its standard uncertainty [N]; zeros: unknown"
    graph.takes("offset", TensorProto.DOUBLE, [1, learning.GIVEN], given)
    certain = [graph.add("Not", doubt, to=doubt + "_not") for doubt in doubts]
    graph.add("Concat", rows.accepted, *certain, to="sound_each", axis=1)
    graph.cast("sound_each", "sound_each_number", TensorProto.DOUBLE)
    graph.add("ReduceMin", "sound_each_number", to="sound_number", axes=[1])
    ends, _ = learning.block_ends(graph, tracker, rows, graph.cast("sound_number", "sound", TensorProto.BOOL))
    _learn_from_blocks(graph, tracker, _blocks(graph, model, tracker, rows, ends))
    graph.cast(ends, "blocks_of_row", TensorProto.INT64)
    graph.add("CumSum", "blocks_of_row", graph.constant(0, np.int64), to="blocks")
    graph.add("Sub", "blocks", "blocks_of_row", to="blocks_before")
    graph.add("Sub", rows.clock, graph.constant(1.0), to="clock_before")
    taken = ("offset_taken_n", "offset_variance", "offset_known")
    _offset_after(graph, tracker, "blocks_before", "clock_before", taken)
    for name, source in (("blocks_padded", "blocks"), ("clock_padded", rows.clock)):
        graph.add("Pad", source, PADDING, to=name)
    after = ("offset_n_column", "stated_variance", "known_after")
    _offset_after(graph, tracker, "blocks_padded", "clock_padded", after)
    graph.add("Sqrt", "stated_variance", to="offset_uncertainty_n_column")


def _blocks(graph: Graph, model: StepModel, tracker: OffsetTracker, rows: Rows, ends: str) -> str:
    """Return ``EXPLAINED`` of blocks, whether each is its stroke's first, and its last clock, shape ``(blocks, 7)``."""
    graph.add("Squeeze", ends, graph.indices(1), to="ends_flat")
    graph.cast(learning.first_block(graph, tracker), "first_number", TensorProto.DOUBLE)
    graph.add("Concat", "first_number", rows.clock, to="first_and_clock", axis=1)
    graph.add("Compress", "first_and_clock", "ends_flat", to="first_and_clock_of_blocks", axis=0)
    lags = learning.block_taps(model, tracker).shape[2]
    clock = graph.add("Gather", "first_and_clock_of_blocks", graph.indices(1), to="clock_of_blocks", axis=1)
    graph.cast(clock, "rows_to_last", TensorProto.INT64)
    graph.add("Sub", "rows_to_last", graph.constant(np.arange(1, lags + 1)[None], np.int64), to="rows_of_blocks")
    graph.add("Max", "rows_of_blocks", graph.indices(0), to="samples_of_blocks")  # the first had always been there
    graph.add("Gather", rows.channels, "samples_of_blocks", to="every_window", axis=0)
    window = graph.add("Reshape", "every_window", graph.indices(-1, lags * len(model.channels)), to="windows_of_blocks")
    averages = learning.averaged(graph, model, tracker, window, lags, "averages")
    learning.explained(graph, tracker, averages, "explained")
    return graph.add("Concat", "explained", "first_and_clock_of_blocks", to="blocks_found", axis=1)


def _learn_from_blocks(graph: Graph, tracker: OffsetTracker, blocks: str) -> None:
    """Make ``after_blocks``, before all blocks and after each: offset [N], learned variance, whether known, clock.

    The first turn of the loop is one of zeros: of a block that is not like those of training, and changes nothing.
    """
    columns = {"block": len(learning.EXPLAINED), "is_first": 1, "clock_now": 1}
    body = Graph("block_")
    body.takes("learned_then", TensorProto.DOUBLE, [1, learning.LEARNED], "before")
    body.takes("clock_then", TensorProto.DOUBLE, [1, 1], "before")
    body.takes("block_row", TensorProto.DOUBLE, [sum(columns.values())], "a block")
    body.add("Unsqueeze", "block_row", body.indices(0), to="block_columns")
    body.split("block_columns", columns)
    body.add("Sub", "clock_now", "clock_then", to="steps_since")
    body.add("Mul", body.constant(learning.walk(tracker)), "steps_since", to="walk_since")
    body.add("Add", "learned_then", "walk_since", to="walked")
    first = body.cast("is_first", "is_first_of_stroke", TensorProto.BOOL)
    learning.learn(body, tracker, "block", first, "walked", "learned_now")
    brief = ("offset_then", "variance_then", "known_then")
    learning.shown(body, tracker, "learned_now", brief)
    body.add("Concat", *brief, "clock_now", to="learned_with_clock", axis=1)
    body.add("Squeeze", "learned_with_clock", body.indices(0), to="learned_row")
    body.gives("learned_now", TensorProto.DOUBLE, [1, learning.LEARNED], "after")
    body.gives("clock_now", TensorProto.DOUBLE, [1, 1], "after")
    body.gives("learned_row", TensorProto.DOUBLE, [4], "offset, learned variance, whether known, clock")
    graph.add("Concat", graph.constant(np.zeros((1, sum(columns.values())))), blocks, to="every_block", axis=0)
    learning.new_learned(graph, tracker, "offset", "learned_at_first")
    states = ["learned_at_first", graph.constant([[0.0]])]
    outputs = ["learned_at_last", "clock_at_last", "after_blocks"]
    graph.add_many("Scan", *states, "every_block", to=outputs, body=body.body("learn"), num_scan_inputs=1)


def _offset_after(graph: Graph, tracker: OffsetTracker, blocks: str, clock: str, to: tuple[str, str, str]) -> None:
    """Make offset [N], stated variance, and whether it is known, after so many blocks, at this clock."""
    offset, variance, known = to
    flat = graph.add("Squeeze", blocks, graph.indices(1), to=blocks + "_flat")
    graph.add("Gather", "after_blocks", flat, to=blocks + "_learned", axis=0)
    graph.split(blocks + "_learned", {offset: 1, variance + "_then": 1, known: 1, blocks + "_clock": 1})
    graph.add("Sub", clock, blocks + "_clock", to=blocks + "_since")
    graph.add(
        "Mul", blocks + "_since", graph.constant(learning.walk(tracker)[0, learning.VARIANCE]), to=blocks + "_walked"
    )
    graph.add("Add", variance + "_then", blocks + "_walked", to=variance + "_now")
    learning.stated(graph, tracker, variance + "_now", variance)

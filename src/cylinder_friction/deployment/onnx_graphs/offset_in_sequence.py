"""The sequence graph learns the offset of the sensors' zeros: in a loop over blocks, all else over all rows."""

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.rows import Rows
from cylinder_friction.deployment.onnx_graphs.sensor_offset import (
    EXPLAINED,
    GIVEN,
    KNOWN,
    LEARNED,
    VARIANCE,
    averaged,
    block_ends,
    block_taps,
    explained,
    first_block,
    learn,
    new_learned,
    stated,
    walk,
)
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OffsetTracker

PADDING = "padding"  # Rows that come before the first valid sample, and the last one, cut off


def learn_offset(graph: Graph, model: StepModel, tracker: OffsetTracker, rows: Rows, constant: str) -> None:
    """Make ``offset_taken_n``, ``offset_variance``, ``offset_known`` of each row, and the columns of both outputs.

    A row whose position has been constant for too long counts as invalid, whatever the force: it does not slide.
    """
    given = "the sensors' offset in friction before the first sample and its standard uncertainty [N]; zeros: unknown"
    graph.takes("offset", TensorProto.DOUBLE, [1, GIVEN], given)
    graph.add("Not", constant, to="changing_enough")
    graph.add("Concat", rows.accepted, "changing_enough", to="sound_each", axis=1)
    graph.cast("sound_each", "sound_each_number", TensorProto.DOUBLE)
    graph.add("ReduceMin", "sound_each_number", to="sound_number", axes=[1])
    ends, _ = block_ends(graph, tracker, rows, graph.cast("sound_number", "sound", TensorProto.BOOL))
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
    graph.cast(first_block(graph, tracker), "first_number", TensorProto.DOUBLE)
    graph.add("Concat", "first_number", rows.clock, to="first_and_clock", axis=1)
    graph.add("Compress", "first_and_clock", "ends_flat", to="first_and_clock_of_blocks", axis=0)
    lags = block_taps(model, tracker).shape[2]
    clock = graph.add("Gather", "first_and_clock_of_blocks", graph.indices(1), to="clock_of_blocks", axis=1)
    graph.cast(clock, "rows_to_last", TensorProto.INT64)
    graph.add("Sub", "rows_to_last", graph.constant(np.arange(1, lags + 1)[None], np.int64), to="rows_of_blocks")
    graph.add("Max", "rows_of_blocks", graph.indices(0), to="samples_of_blocks")  # the first had always been there
    graph.add("Gather", rows.sample, "samples_of_blocks", to="every_window", axis=0)
    window = graph.add("Reshape", "every_window", graph.indices(-1, lags * len(model.inputs)), to="windows_of_blocks")
    averages = averaged(graph, model, tracker, window, lags, "averages")
    explained(graph, tracker, averages, "explained")
    return graph.add("Concat", "explained", "first_and_clock_of_blocks", to="blocks_found", axis=1)


def _learn_from_blocks(graph: Graph, tracker: OffsetTracker, blocks: str) -> None:
    """Make ``after_blocks``, before all blocks and after each: offset [N], learned variance, whether known, clock.

    The first turn of the loop is one of zeros: of a block that is not like those of training, and changes nothing.
    """
    columns = {"block": len(EXPLAINED), "is_first": 1, "clock_now": 1}
    body = Graph("block_")
    body.takes("learned_then", TensorProto.DOUBLE, [1, LEARNED], "before")
    body.takes("clock_then", TensorProto.DOUBLE, [1, 1], "before")
    body.takes("block_row", TensorProto.DOUBLE, [sum(columns.values())], "a block")
    body.add("Unsqueeze", "block_row", body.indices(0), to="block_columns")
    body.split("block_columns", columns)
    body.add("Sub", "clock_now", "clock_then", to="steps_since")
    body.add("Mul", body.constant(walk(tracker)), "steps_since", to="walk_since")
    body.add("Add", "learned_then", "walk_since", to="walked")
    first = body.cast("is_first", "is_first_of_stroke", TensorProto.BOOL)
    learn(body, tracker, "block", first, "walked", "learned_now")
    body.add("Gather", "learned_now", body.indices(0, VARIANCE, KNOWN), to="learned_brief", axis=1)
    body.add("Concat", "learned_brief", "clock_now", to="learned_with_clock", axis=1)
    body.add("Squeeze", "learned_with_clock", body.indices(0), to="learned_row")
    body.gives("learned_now", TensorProto.DOUBLE, [1, LEARNED], "after")
    body.gives("clock_now", TensorProto.DOUBLE, [1, 1], "after")
    body.gives("learned_row", TensorProto.DOUBLE, [4], "offset, learned variance, whether known, clock")
    graph.add("Concat", graph.constant(np.zeros((1, sum(columns.values())))), blocks, to="every_block", axis=0)
    new_learned(graph, tracker, "offset", "learned_at_first")
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
    graph.add("Mul", blocks + "_since", graph.constant(walk(tracker)[0, VARIANCE]), to=blocks + "_walked")
    graph.add("Add", variance + "_then", blocks + "_walked", to=variance + "_now")
    stated(graph, tracker, variance + "_now", variance)

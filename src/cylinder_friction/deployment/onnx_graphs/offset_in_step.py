"""The step graph learns the offset of the sensors' zeros: at the end of a block, in a state that goes in and out."""

from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.rows import Rows
from cylinder_friction.deployment.onnx_graphs.sensor_offset import (
    GIVEN,
    KNOWN,
    LEARNED,
    VARIANCE,
    averaged,
    block_ends,
    explained,
    first_block,
    learn,
    new_learned,
    stated,
    walk,
)
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OffsetTracker

STATE = {
    "offset_given": GIVEN,
    "offset_taken_n": 1,
    "offset_variance": 1,
    "offset_known": 1,
    "offset_learned": LEARNED,
    "sliding_before": 3,
}
"""Lengths of the parts of the state ``offset``: what was given before the first sample; the offset [N] and its stated
variance that the next step takes; whether the piston has slid in both directions; what is learned; and for how many
steps it has slid outwards, inwards, and rested."""
SIZE = [1, sum(STATE.values())]
MEANING = (
    "what is known of the sensors' offset: offset_out of the step before; at a start zeros, or the offset in friction "
    "and its standard uncertainty [N], then zeros"
)


def begin_offset(graph: Graph, tracker: OffsetTracker) -> None:
    """Make the parts of ``STATE``; until the first valid sample they follow from what was given alone."""
    going, new = Graph("going_"), Graph("new_")
    going.gives(going.add("Identity", "offset", to="offset_as_was"), TensorProto.DOUBLE, SIZE, "state")
    given = new.add("Slice", "offset", *(new.indices(each) for each in (0, GIVEN, 1)), to="given")
    learned, variance = new_learned(new, tracker, given, "learned_at_first")
    # Before the first valid sample no time passes in which the offset could drift: less what ``learn_offset`` will add
    new.add("Sub", "running_number", new.constant([[1.0]]), to="steps_too_many")
    new.add("Mul", "steps_too_many", new.constant(walk(tracker)), to="walk_too_many")
    new.add("Add", learned, "walk_too_many", to="learned_before_first")
    variance = stated(new, tracker, variance, "stated_at_first")
    parts = [given, "given_n", variance, "given_number", "learned_before_first"]
    new.add("Concat", *parts, new.constant([[0.0, 0.0, 0.0]]), to="offset_at_first", axis=1)
    new.gives("offset_at_first", TensorProto.DOUBLE, SIZE, "state")
    branches = {"then_branch": going.body("going"), "else_branch": new.body("new")}
    graph.add("If", "ready", to="offset_before", **branches)
    graph.split("offset_before", STATE)


def learn_offset(graph: Graph, model: StepModel, tracker: OffsetTracker, rows: Rows) -> None:
    """Make ``offset_out``, ``offset_n`` and ``offset_uncertainty_n``: what the next step takes off."""
    ends, sliding = block_ends(graph, tracker, rows, graph.add("Not", "bad", to="sound"))
    walked = graph.add("Add", "offset_learned", graph.constant(walk(tracker)), to="offset_walked")
    ended, going = Graph("block_"), Graph("between_")
    averages = averaged(ended, model, tracker, rows.window, rows.lags, "averages")
    block = explained(ended, tracker, averages, "block")
    learn(ended, tracker, block, first_block(ended, tracker), walked, "learned_now")
    ended.gives("learned_now", TensorProto.DOUBLE, [1, LEARNED], "learned")
    going.gives(going.add("Identity", walked, to="learned_before"), TensorProto.DOUBLE, [1, LEARNED], "learned")
    branches = {"then_branch": ended.body("ended"), "else_branch": going.body("between")}
    graph.add("If", ends, to="learned", **branches)
    for place, name in ((0, "offset_n"), (VARIANCE, "learned_variance"), (KNOWN, "learned_known")):
        graph.add("Gather", "learned", graph.indices(place), to=name, axis=1)
    variance = stated(graph, tracker, "learned_variance", "stated_variance")
    graph.add("Sqrt", variance, to="offset_uncertainty_n")
    after = ["offset_given", "offset_n", variance, "learned_known", "learned", sliding]
    graph.add("Concat", *after, to="offset_out", axis=1)
    graph.takes("offset", TensorProto.DOUBLE, SIZE, MEANING)
    graph.gives("offset_out", TensorProto.DOUBLE, SIZE, "offset of the next step")

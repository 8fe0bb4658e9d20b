"""Features of the motion so far in ONNX: one step of ``realtime.history``, on a state that goes in and out."""

from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.realtime.history import TOLERANCE_M, History

NEVER_PUSHED_S = 1e30
STATE = ("dwell", "dwell_before", "moved_from", "moving", "centre", "push", "age")
"""Dwell so far and before this motion [s], position of the last reversal or start [m], time of motion [s]; centre of
the backlash [m], direction of the last push against it, and the age of that push [s]."""


def begin_history(graph: Graph, first_m: str) -> str:
    """Return the state before the first smoothed position, shape ``(1, 7)``, which itself is ``(1, 1)``."""
    graph.add("Concat", first_m, graph.constant([[0.0, NEVER_PUSHED_S]]), to="history_beginnings", axis=1)
    begun = [0 if name in ("moved_from", "centre") else 2 if name == "age" else 1 for name in STATE]
    return graph.add("Gather", "history_beginnings", graph.indices(*begun), to="history_begun", axis=1)


def history_step(graph: Graph, history: History, sample_time_s: float, smooth_m: str, state: str) -> tuple[str, str]:
    """Return features, shape ``(1, 6)``, and state, ``(1, 7)``, after the next smoothed position, ``(1, 1)``."""

    def number(value: float) -> str:
        return graph.constant([[value]])

    graph.split(state, dict.fromkeys(STATE, 1))
    half, step, zero = number(history.backlash_m), number(sample_time_s), number(0.0)
    edge = number(history.backlash_m + TOLERANCE_M)
    upper, lower = graph.add("Add", "centre", edge, to="edge_above"), graph.add("Sub", "centre", edge, to="edge_below")
    above, below = graph.add("Greater", smooth_m, upper, to="above"), graph.add("Less", smooth_m, lower, to="below")
    pushed = graph.add("Or", above, below, to="pushed")
    behind, ahead = graph.add("Sub", smooth_m, half, to="behind"), graph.add("Add", smooth_m, half, to="ahead")
    graph.add("Where", above, behind, graph.add("Where", below, ahead, "centre", to="centre_low"), to="centre_out")
    pushed_back = graph.add("Where", below, number(-1.0), "push", to="push_low")
    graph.add("Where", above, number(1.0), pushed_back, to="push_out")
    graph.add("Where", pushed, zero, graph.add("Add", "age", step, to="older"), to="age_out")
    same = graph.add("Equal", "push_out", "push", to="same_direction")
    resting = graph.add("Greater", "dwell", zero, to="rested")
    other = graph.add("Or", graph.add("Not", same, to="turned"), resting, to="turned_or_rested")
    starts = graph.add("And", pushed, other, to="starts")
    graph.add("Where", starts, "dwell", "dwell_before", to="dwell_before_out")
    graph.add("Where", starts, smooth_m, "moved_from", to="moved_from_out")
    began = graph.add("Where", starts, zero, "moving", to="moving_begun")
    moves = graph.add("Less", "age_out", number(history.moves_s), to="moves")
    graph.add("Where", moves, zero, graph.add("Add", "dwell", step, to="dwell_longer"), to="dwell_out")
    graph.add("Where", moves, graph.add("Add", began, step, to="moving_longer"), began, to="moving_out")
    graph.add("Abs", graph.add("Sub", smooth_m, "moved_from_out", to="moved"), to="travel")
    graph.add("Concat", "dwell_out", "dwell_before_out", to="dwells", axis=1)
    graph.add("Div", "dwells", number(history.dwell_s), to="dwell_ratios")
    graph.add("Log", graph.add("Add", "dwell_ratios", number(1.0), to="dwell_sums"), to="dwell_logarithms")
    graph.add("Concat", "travel", "travel", "moving_out", to="travels", axis=1)
    lengths = graph.constant([[-history.travel_short_m, -history.travel_long_m, -history.moving_s]])
    graph.add("Exp", graph.add("Div", "travels", lengths, to="decays"), to="remaining")
    graph.add("Sub", number(1.0), "remaining", to="saturations")
    graph.add("Concat", "push_out", "dwell_logarithms", "saturations", to="history_raw", axis=1)
    graph.add("Sub", "history_raw", graph.constant(history.mean[None]), to="history_centred")
    features = graph.add("Div", "history_centred", graph.constant(history.scale[None]), to="history_features")
    after = graph.add("Concat", *(f"{name}_out" for name in STATE), to="history_state_out", axis=1)
    return features, after


def history_rows(graph: Graph, history: History, sample_time_s: float, smooth_m: str) -> str:
    """Return the features of all smoothed positions, shape ``(n, 6)``, by a loop over their rows, ``(n, 1)``."""
    body = Graph("history_")
    body.takes("state", TensorProto.DOUBLE, [1, len(STATE)], "before")
    body.takes("row", TensorProto.DOUBLE, [1], "smoothed position")
    position = body.add("Unsqueeze", "row", body.indices(0), to="position")
    features, after = history_step(body, history, sample_time_s, position, "state")
    body.add("Squeeze", features, body.indices(0), to="features_row")
    body.gives(after, TensorProto.DOUBLE, [1, len(STATE)], "after")
    body.gives("features_row", TensorProto.DOUBLE, [len(history.mean)], "features")
    first = graph.add("Slice", smooth_m, *(graph.indices(at) for at in (0, 1, 0)), to="first_smooth_m")
    begun = begin_history(graph, first)
    outputs = ["history_state_last", "history_rows"]
    graph.add_many("Scan", begun, smooth_m, to=outputs, body=body.body("history"), num_scan_inputs=1)
    return "history_rows"

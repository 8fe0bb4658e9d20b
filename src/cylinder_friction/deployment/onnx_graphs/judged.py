"""Guard and bounds in ONNX: which flags a sample gets, and which regime of motion it is in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.rows import CHANGED_AT, HAPPENED_AT
from cylinder_friction.realtime.flags import Flag

if TYPE_CHECKING:
    from cylinder_friction.deployment.onnx_graphs.graph import Graph
    from cylinder_friction.deployment.onnx_graphs.rows import Rows
    from cylinder_friction.realtime.model import Bounds, Guard, StepModel

INVALID = (Flag.INVALID_PRESSURE_1, Flag.INVALID_PRESSURE_2, Flag.INVALID_POSITION)
REVERSAL = 3


@dataclass(frozen=True)
class Validity:
    """Which raw values are readings of a working sensor.

    Attributes:
        accepted: Per channel, shape ``(n, 3)``.
        unready_flags: Flags of a sample before the first sound one, as a number, shape ``(n, 1)``.
        sound: Whether all three channels are accepted, shape ``(n, 1)``.
    """

    accepted: str
    unready_flags: str
    sound: str


def judged_valid(graph: Graph, guard: Guard, raw: str) -> Validity:
    """Judges raw samples; NaN fails both comparisons."""
    _inside(graph, raw, "accepted", guard.accept_lower, guard.accept_upper)
    graph.cast("accepted", "accepted_number", TensorProto.DOUBLE)
    weights = np.array(INVALID, dtype=np.float64)
    graph.add("MatMul", "accepted_number", graph.constant(weights[:, None]), to="valid_bits")
    graph.add("Equal", "valid_bits", graph.constant([[weights.sum()]]), to="sound")
    graph.add("Sub", graph.constant([[Flag.NOT_READY + weights.sum()]]), "valid_bits", to="unready_flags")
    return Validity("accepted", "unready_flags", "sound")


def judged(graph: Graph, model: StepModel, rows: Rows) -> tuple[str, str]:
    """Return flags and regime as numbers, each shape ``(n, 1)``, of rows that are ``filtered``."""
    guard, bounds = model.guard, model.bounds
    frozen = _frozen(graph, guard, rows)
    _inside(graph, rows.sample, "trained", guard.trained_lower, guard.trained_upper)
    graph.add("Concat", "trained", frozen, rows.accepted, to="troubles", axis=1)
    graph.cast("troubles", "trouble_number", TensorProto.DOUBLE)
    outside, any_frozen, bad = np.eye(3)
    columns = np.stack([-outside] * 3 + [any_frozen + bad] * 3 + [-bad] * 3)
    graph.add("MatMul", "trouble_number", graph.constant(columns), to="trouble_counts")
    graph.add("Greater", "trouble_counts", graph.constant([[-3.0, 0.0, -3.0]]), to="outside_frozen_bad")
    graph.add("Gather", "outside_frozen_bad", graph.indices(2), to="bad", axis=1)
    graph.add("Concat", "bad", _new_direction(graph, bounds, rows), rows.never, to="happened", axis=1)
    last = rows.latest(HAPPENED_AT, rows.clock, "happened")
    graph.add("Sub", rows.clock, last, to="elapsed")
    spans = [[guard.recovery_samples + 1.0, bounds.reversal_samples, guard.warm_up_samples + 1.0]]
    graph.add("Less", "elapsed", graph.constant(spans), to="recent")
    return _flags_and_regime(graph, rows)


def _inside(graph: Graph, values: str, to: str, lower: tuple[float, ...], upper: tuple[float, ...]) -> str:
    greatest = np.finfo(np.float64).max  # infinity is no reading, however wide the range
    bounds = np.clip(np.array([[lower], [upper]]), -greatest, greatest)
    graph.add("GreaterOrEqual", values, graph.constant(bounds[0]), to=to + "_above")
    graph.add("LessOrEqual", values, graph.constant(bounds[1]), to=to + "_below")
    return graph.add("And", to + "_above", to + "_below", to=to)


def _frozen(graph: Graph, guard: Guard, rows: Rows) -> str:
    """A pressure constant over too much travel; a position constant too long under too much force."""
    graph.add("Equal", "changes", graph.constant(0.0), to="unchanged")
    graph.add("And", "unchanged", rows.accepted, to="still")
    graph.add("Not", "still", to="fresh")
    graph.add("Concat", "positions_m", rows.clock, to="place", axis=1)
    origin = rows.latest(CHANGED_AT, "place", "fresh")
    graph.add("Sub", "place", origin, to="travelled_since")
    graph.add("Abs", "travelled_since", to="travelled")
    limits = graph.constant([[guard.freeze_travel_m, guard.freeze_travel_m, float(guard.freeze_samples)]])
    graph.add("Greater", "travelled", limits, to="over")
    constant = rows.latched(CHANGED_AT, "over", "fresh")
    graph.add("Abs", "base_n", to="resistance_n")
    graph.add("Greater", "resistance_n", graph.constant(guard.freeze_force_n), to="strong")
    graph.add("Or", "strong", graph.constant([[True, True, False]], np.bool_), to="suspicious")
    return graph.add("And", constant, "suspicious", to="frozen")


def _new_direction(graph: Graph, bounds: Bounds, rows: Rows) -> str:
    """Return whether a direction begins that was not the last step's."""
    slow, fast = bounds.standstill_m_s, max(bounds.standstill_m_s, bounds.creep_m_s)
    graph.add("GreaterOrEqual", "speeds_m_s", graph.constant([[slow, slow, fast, fast]]), to="faster")
    graph.cast("faster", "faster_number", TensorProto.DOUBLE)
    graph.add("MatMul", "faster_number", graph.constant([[1.0], [-1.0], [0.0], [0.0]]), to="direction")
    graph.add("Sub", "direction", rows.direction_before("direction"), to="turn")
    graph.add("Mul", "direction", "turn", to="turn_ahead")
    graph.add("Greater", "turn_ahead", graph.constant([[0.0]]), to="new_direction")
    return "new_direction"


def _flags_and_regime(graph: Graph, rows: Rows) -> tuple[str, str]:
    """Weighs every bit for the flags, and for the regime: 0 standing, 1 creeping, 2 sliding, 3 or more reversing.

    A bad sample is recent as well, hence a difference: recovery is what is recent but not bad.
    """
    graph.add("Concat", "outside_frozen_bad", "recent", rows.accepted, "faster", to="bits", axis=1)
    graph.cast("bits", "bit_number", TensorProto.DOUBLE)
    troubles = [Flag.OUTSIDE, Flag.FROZEN, -Flag.RECOVERING.value]
    flags = [*troubles, Flag.RECOVERING, 0, Flag.WARMING, *(-flag.value for flag in INVALID), 0, 0, 0, 0]
    regime = [0, 0, 0, 0, REVERSAL, 0, 0, 0, 0, 1, 1, 1, 1]
    weights = graph.constant(np.array([flags, regime], dtype=np.float64).T)
    graph.add("Gemm", "bit_number", weights, graph.constant([[float(sum(INVALID)), 0.0]]), to="flags_and_regime")
    graph.split("flags_and_regime", {"flag_number": 1, "regime": 1})
    return "flag_number", "regime"

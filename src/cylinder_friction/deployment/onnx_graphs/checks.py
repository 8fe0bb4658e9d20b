"""Guard and bounds in ONNX: the flags of a sample, and its regime of motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.position_load import KNOWN, knows_all
from cylinder_friction.deployment.onnx_graphs.rows import CHANGED_AT, HAPPENED_AT, TURNED_AT, UNMODELLED, Rows
from cylinder_friction.realtime.bounds import REVERSAL
from cylinder_friction.realtime.flags import Flag, invalid_flag
from cylinder_friction.realtime.model import Bounds, StepModel
from cylinder_friction.realtime.unmodelled_force import force_limits


@dataclass(frozen=True)
class Validity:
    """Which raw values are readings of a working sensor."""

    accepted: str  # Per input, shape ``(n, inputs)``
    unready_flags: str  # Flags of a sample before the first valid one, as a number, shape ``(n, 1)``
    valid: str  # Whether all inputs are accepted, shape ``(n, 1)``


def check_validity(graph: Graph, model: StepModel, raw: str) -> Validity:
    """Check raw samples; NaN fails both comparisons."""
    _inside(graph, raw, "accepted", model.guard.accept_lower, model.guard.accept_upper)
    by_flag, flags = _by_flag(graph, model, "accepted", "raw")
    graph.cast(by_flag, "accepted_number", TensorProto.DOUBLE)
    graph.add("MatMul", "accepted_number", graph.constant(flags[:, None]), to="valid_bits")
    graph.add("Equal", "valid_bits", graph.constant([[flags.sum()]]), to="valid")
    graph.add("Sub", graph.constant([[Flag.NOT_READY + flags.sum()]]), "valid_bits", to="unready_flags")
    return Validity("accepted", "unready_flags", "valid")


def _by_flag(graph: Graph, model: StepModel, accepted: str, name: str) -> tuple[str, NDArray[np.float64]]:
    """Return which flags' inputs are all accepted, shape ``(n, flags)``, and the flags."""
    every = np.array([invalid_flag(column).value for column in model.inputs], dtype=np.float64)
    flags, place = np.unique(every, return_inverse=True)
    if len(flags) == len(every):
        return accepted, every
    members = (place[:, None] == np.arange(len(flags))).astype(np.float64)
    graph.cast(accepted, f"{name}_accepted_each", TensorProto.DOUBLE)
    graph.add("MatMul", f"{name}_accepted_each", graph.constant(members), to=f"{name}_accepted_count")
    count = graph.constant(members.sum(axis=0)[None])
    return graph.add("Equal", f"{name}_accepted_count", count, to=f"{name}_accepted_by_flag"), flags


def follow_motion(graph: Graph, model: StepModel, rows: Rows) -> list[str]:
    """Make what the regime of motion goes by; return in which rows a force is not modelled, or nothing.

    That is shape ``(n, 1)``; of a model that knows no range of the force balance it is nothing.
    """
    bounds, limits, channels = model.bounds, force_limits(model), len(model.channels)
    last = rows.latest(TURNED_AT, rows.clock, _new_direction(graph, bounds, rows))
    graph.add("Sub", rows.clock, last, to="since_turn")
    graph.add("Less", "since_turn", graph.constant([[float(bounds.reversal_samples)]]), to="reversing")
    if not limits.size:
        return []
    graph.add("MatMul", rows.channels, graph.constant(limits[:, :channels].T), to="force_and_pressure")
    graph.split("force_and_pressure", {"force_n": 1, "pressure_pa": 1})
    graph.add("Mul", "force_n", "direction", to="pushing_n")
    graph.add("Abs", "force_n", to="force_size_n")
    graph.add("Concat", "pushing_n", "pushing_n", "force_size_n", to="forces_n", axis=1)
    signs = np.array([[-1.0, 1.0, 1.0]])
    graph.add("Mul", "forces_n", graph.constant(signs), to="signed_n")
    graph.add("Mul", "pressure_pa", graph.constant(signs * limits[1:, channels:]), to="sloping_n")
    graph.add("Sub", "signed_n", "sloping_n", to="above_line_n")
    graph.add("Greater", "above_line_n", graph.constant(signs * limits[:1, channels:]), to="beyond_each")
    graph.cast("beyond_each", "beyond_number", TensorProto.DOUBLE)
    graph.split("beyond_number", {"off_each": 2, "too_large": 1})
    graph.add("ReduceMax", "off_each", to="off", axes=[1])
    graph.add("Not", "reversing", to="steady")
    for number in ("direction", "beyond_creep", "off"):
        graph.cast(number, number + "_holds", TensorProto.BOOL)
    graph.add("And", "beyond_creep_holds", "steady", to="travels")
    graph.cast(graph.add("Where", "travels", "off", "too_large", to="beyond_number_now"), "beyond", TensorProto.BOOL)
    graph.add("Or", "off_holds", "beyond", to="doubtful")
    graph.add("And", "direction_holds", "steady", to="moves_on")
    graph.add("And", "moves_on", graph.add("Not", "doubtful", to="doubtful_not"), to="refutes")
    since = rows.since(UNMODELLED, "beyond", "refutes")
    graph.add("Less", since, graph.constant([[float(model.guard.clear_samples)]]), to="not_refuted")
    graph.add("Less", "pressure_pa", graph.constant([[model.guard.least_pressure_pa]]), to="no_pressure")
    return [graph.add("Or", "not_refuted", "no_pressure", to="unmodelled_force")]


def checked(graph: Graph, model: StepModel, rows: Rows, constant: str, unmodelled: list[str]) -> tuple[str, str]:
    """Return flags and regime as numbers, each shape ``(n, 1)``, of rows that are ``filtered``.

    ``constant`` is from ``unchanging``, ``unmodelled`` from ``follow_motion``.
    """
    guard, inputs = model.guard, len(model.inputs)
    frozen = _frozen(graph, model, constant)
    _inside(graph, rows.sample, "trained", guard.trained_lower, guard.trained_upper)
    known = [] if knows_all(model) else [KNOWN]
    ranges = inputs + len(known)
    graph.add("Concat", "trained", *known, frozen, rows.accepted, to="troubles", axis=1)
    graph.cast("troubles", "trouble_number", TensorProto.DOUBLE)
    outside, any_frozen, bad = np.eye(3)
    columns = np.stack([-outside] * ranges + [any_frozen + bad] * (len(model.pressures) + 1) + [-bad] * inputs)
    graph.add("MatMul", "trouble_number", graph.constant(columns), to="trouble_counts")
    limits = graph.constant([[-float(ranges), 0.0, -float(inputs)]])
    graph.add("Greater", "trouble_counts", limits, to="outside_frozen_bad")
    graph.add("Gather", "outside_frozen_bad", graph.indices(2), to="bad", axis=1)
    graph.add("Concat", "bad", rows.never, to="happened", axis=1)
    last = rows.latest(HAPPENED_AT, rows.clock, "happened")
    graph.add("Sub", rows.clock, last, to="elapsed")
    spans = [[guard.recovery_samples + 1.0, guard.warm_up_samples + 1.0]]
    graph.add("Less", "elapsed", graph.constant(spans), to="recent")
    return _flags_and_regime(graph, model, rows, unmodelled)


def _inside(graph: Graph, values: str, to: str, lower: tuple[float, ...], upper: tuple[float, ...]) -> str:
    greatest = np.finfo(np.float64).max  # infinity is no reading, however wide the range
    bounds = np.clip(np.array([[lower], [upper]]), -greatest, greatest)
    graph.add("GreaterOrEqual", values, graph.constant(bounds[0]), to=to + "_above")
    graph.add("LessOrEqual", values, graph.constant(bounds[1]), to=to + "_below")
    return graph.add("And", to + "_above", to + "_below", to=to)


def unchanging(graph: Graph, model: StepModel, rows: Rows) -> str:
    """Return which pressure has been constant over too much travel, and whether the position has been for too long."""
    guard, pressures = model.guard, len(model.pressures)
    checked_inputs = (*model.pressures, model.position)
    accepted = rows.accepted
    if checked_inputs != tuple(range(len(model.inputs))):
        accepted = graph.add("Gather", accepted, graph.indices(*checked_inputs), to="accepted_checked", axis=1)
    graph.add("Equal", "changes", graph.constant(0.0), to="unchanged")
    graph.add("And", "unchanged", accepted, to="still")
    graph.add("Not", "still", to="fresh")
    graph.add("Concat", *(["positions_m"] if pressures else []), rows.clock, to="place", axis=1)
    origin = rows.latest(CHANGED_AT, "place", "fresh")
    graph.add("Sub", "place", origin, to="travelled_since")
    graph.add("Abs", "travelled_since", to="travelled")
    limits = graph.constant([[*[guard.freeze_travel_m] * pressures, float(guard.freeze_samples)]])
    graph.add("Greater", "travelled", limits, to="over")
    return rows.latched(CHANGED_AT, "over", "fresh")


def _frozen(graph: Graph, model: StepModel, constant: str) -> str:
    """Return which pressure was constant over too much travel, or position too long under too much force."""
    guard, pressures = model.guard, len(model.pressures)
    graph.add("Abs", "base_n", to="resistance_n")
    graph.add("Greater", "resistance_n", graph.constant(guard.freeze_force_n), to="strong")
    graph.add("Or", "strong", graph.constant([[*[True] * pressures, False]], np.bool_), to="suspicious")
    return graph.add("And", constant, "suspicious", to="frozen")


def _new_direction(graph: Graph, bounds: Bounds, rows: Rows) -> str:
    """Return whether a direction begins that was not the last step's."""
    slow, fast = bounds.standstill_m_s, max(bounds.standstill_m_s, bounds.creep_m_s)
    graph.add("GreaterOrEqual", "speeds_m_s", graph.constant([[slow, slow, fast, fast]]), to="faster")
    graph.cast("faster", "faster_number", TensorProto.DOUBLE)
    sums = graph.constant([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    graph.add("MatMul", "faster_number", sums, to="direction_and_fast")
    graph.split("direction_and_fast", {"direction": 1, "beyond_creep": 1})
    graph.add("Sub", "direction", rows.direction_before("direction"), to="turn")
    graph.add("Mul", "direction", "turn", to="turn_ahead")
    graph.add("Greater", "turn_ahead", graph.constant([[0.0]]), to="new_direction")
    return "new_direction"


def _flags_and_regime(graph: Graph, model: StepModel, rows: Rows, unmodelled: list[str]) -> tuple[str, str]:
    """Weigh every bit for the flags, and for the regime: 0 standing, 1 creeping, 2 sliding, 3 or more reversing.

    A bad sample is recent as well, hence a difference: recovery is what is recent but not bad.
    """
    accepted, invalid = _by_flag(graph, model, rows.accepted, "held")
    learns = [] if model.offset is None else [graph.cast("offset_known", "offset_is_known", TensorProto.BOOL)]
    parts = ["outside_frozen_bad", "recent", "reversing", accepted, "faster", *learns, *unmodelled]
    graph.add("Concat", *parts, to="bits", axis=1)
    graph.cast("bits", "bit_number", TensorProto.DOUBLE)
    troubles = [Flag.OUTSIDE, Flag.FROZEN, -Flag.RECOVERING.value]
    unknown = Flag.OFFSET_UNKNOWN * len(learns)
    flags = [*troubles, Flag.RECOVERING, Flag.WARMING, 0, *-invalid, 0, 0, 0, 0, *[-unknown] * len(learns)]
    flags += [Flag.UNMODELLED_FORCE] * len(unmodelled)
    regime = [0, 0, 0, 0, 0, REVERSAL, *0 * invalid, 1, 1, 1, 1, *[0] * len(learns + unmodelled)]
    weights = graph.constant(np.array([flags, regime], dtype=np.float64).T)
    graph.add("Gemm", "bit_number", weights, graph.constant([[invalid.sum() + unknown, 0.0]]), to="flags_and_regime")
    graph.split("flags_and_regime", {"flag_number": 1, "regime": 1})
    return "flag_number", "regime"

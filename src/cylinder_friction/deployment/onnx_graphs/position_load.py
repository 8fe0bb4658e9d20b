"""The load that positions decide in ONNX: ``realtime.position_load``, for one row or all."""

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.realtime.model import StepModel

KNOWN = "load_known"
"""Whether the load is known, shape ``(n, 1)``; made where it is unknown somewhere."""


def with_load(graph: Graph, model: StepModel, sample: str) -> str:
    """Return the channels, shape ``(n, channels)``, of samples that are valid or held, shape ``(n, inputs)``."""
    load = model.position_load
    if load is None:
        return sample
    at, parts = graph.constant([[0]], np.int64), list[str]()
    strides = np.cumprod([1, *load.load_n.shape[:0:-1]])[::-1]
    for number, axis in enumerate(load.axes):
        index = _place(graph, model.inputs.index(axis.column), number, *axis[1:], load.load_n.shape[number], sample)
        parts.append(f"load_part_{number}")
        moved = graph.add("Mul", index, graph.constant(strides[number], np.int64), to=f"load_moved_{number}")
        at = graph.add("Add", at, moved, to=f"load_begin_{number}")
    newtons = _between(graph, "load_n", load.load_n.ravel(), at, strides, parts)
    if load.known is not None and not load.known.all():
        unknown = _between(graph, "load_unknown", (~load.known).ravel().astype(np.float64), at, strides, parts)
        graph.add("LessOrEqual", unknown, graph.constant(0.5), to=KNOWN)
    return graph.add("Concat", sample, newtons, to="channels", axis=1)


def knows_all(model: StepModel) -> bool:
    """Return whether a model's load, if it has one, is known in its whole table."""
    return model.position_load is None or model.position_load.known is None or bool(model.position_load.known.all())


def _place(graph: Graph, column: int, number: int, first_m: float, last_m: float, places: int, sample: str) -> str:
    """Return the place below a position along an axis, a whole number; makes the part of the way to the next."""
    position = graph.add("Gather", sample, graph.indices(column), to=f"load_position_{number}", axis=1)
    along = graph.add("Sub", position, graph.constant(first_m), to=f"load_along_{number}")
    per_metre = graph.constant((places - 1) / (last_m - first_m))
    place = graph.add("Mul", along, per_metre, to=f"load_place_{number}")
    place = graph.add("Max", place, graph.constant(0.0), to=f"load_place_from_first_{number}")
    place = graph.add("Min", place, graph.constant(places - 1.0), to=f"load_place_within_{number}")
    below = graph.add("Min", place, graph.constant(places - 2.0), to=f"load_place_below_{number}")
    index = graph.cast(below, f"load_index_{number}", TensorProto.INT64)  # towards zero
    whole = graph.cast(index, f"load_at_{number}", TensorProto.DOUBLE)
    graph.add("Sub", place, whole, to=f"load_part_{number}")
    return index


def _between(graph: Graph, to: str, table: np.ndarray, at: str, strides: np.ndarray, parts: list[str]) -> str:
    """Return the value between the places of a flat table around ``at``, axis by axis, the last one first."""
    if not parts:
        return graph.add("Gather", graph.constant(table), at, to=to, axis=0)
    next_at = graph.add("Add", at, graph.constant(strides[0], np.int64), to=f"{to}_at_next")
    below = _between(graph, f"{to}_below", table, at, strides[1:], parts[1:])
    above = _between(graph, f"{to}_above", table, next_at, strides[1:], parts[1:])
    rise = graph.add("Sub", above, below, to=f"{to}_rise")
    more = graph.add("Mul", parts[0], rise, to=f"{to}_more")
    return graph.add("Add", below, more, to=to)

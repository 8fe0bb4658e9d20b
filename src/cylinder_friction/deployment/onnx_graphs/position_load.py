"""The load that position decides in ONNX: ``realtime.position_load``, for one row or all."""

import numpy as np
from onnx import TensorProto

from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.realtime.model import StepModel


def with_load(graph: Graph, model: StepModel, sample: str) -> str:
    """Return the channels, shape ``(n, channels)``, of samples that are valid or held, shape ``(n, inputs)``."""
    if model.position_load is None:
        return sample
    load_n, (first_m, per_metre) = model.position_load.load_n, model.position_load.packed()[:2]
    position = graph.add("Gather", sample, graph.indices(model.position), to="load_position_m", axis=1)
    along = graph.add("Sub", position, graph.constant(first_m), to="load_along_m")
    place = graph.add("Mul", along, graph.constant(per_metre), to="load_place")
    place = graph.add("Max", place, graph.constant(0.0), to="load_place_from_first")
    place = graph.add("Min", place, graph.constant(len(load_n) - 1.0), to="load_place_within")
    graph.add("Min", place, graph.constant(len(load_n) - 2.0), to="load_place_below")
    graph.cast("load_place_below", "load_index", TensorProto.INT64)  # towards zero
    index = graph.cast("load_index", "load_at", TensorProto.DOUBLE)
    below = graph.add("Gather", graph.constant(load_n[:-1]), "load_index", to="load_below_n", axis=0)
    rise = graph.constant(np.diff(load_n))
    step = graph.add("Gather", rise, "load_index", to="load_step_n", axis=0)
    part = graph.add("Sub", place, index, to="load_part")
    more = graph.add("Mul", part, step, to="load_more_n")
    load = graph.add("Add", below, more, to="load_n")
    return graph.add("Concat", sample, load, to="channels", axis=1)

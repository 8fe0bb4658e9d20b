"""Filters, history, network, forest and their sum in ONNX: from a window of samples to newtons with bounds."""

from typing import Any

import numpy as np
from onnx import TensorProto, helper

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.rows import Rows
from cylinder_friction.estimators.onnx_files import forest_to_onnx
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.lstm import TINY, LstmWeights
from cylinder_friction.realtime.model import StepModel

NO_SPREAD_N = 1e20  # Stands for a spread of 0: beside so large a one no offset moves the bounds


def lags_of(model: StepModel) -> int:
    """Return how many samples the longest filter of a step sees; at least two, for the step before to be among them."""
    return max(2, model.feature_taps.shape[2], model.base_taps.shape[1], model.velocity_taps.shape[1])


def filtered(graph: Graph, model: StepModel, rows: Rows) -> None:
    """Make everything that is linear in the window, by one product.

    ``raw_features``, shape ``(n, features)``; ``base_n``, ``(n, 1)``; ``speeds_m_s``: velocity there and back, twice,
    ``(n, 4)``; ``changes``: of each pressure and of the position since the step before; ``positions_m``: one for each
    pressure. The last two have taps of 1 and -1 only, and come out exact. Where the sensors' offset is learned, it is
    still in the first two, which are one tensor, ``measured``; ``strokes_m_s`` is the velocity there and back again.
    """
    lags, channels = rows.lags, len(model.channels)
    one = np.eye(channels)
    changes = [np.stack([one[place], -one[place]], axis=1) for place in (*model.pressures, model.position)]
    positions = [one[model.position][:, None]] * len(model.pressures)
    speeds = [sign * model.velocity_taps for sign in (1.0, -1.0, 1.0, -1.0)]
    strokes = [] if model.offset is None else speeds[:2]
    bank = [*model.feature_taps, model.base_taps, *speeds, *strokes, *changes, *positions]
    taps = np.stack([np.pad(each, ((0, 0), (0, lags - each.shape[1]))) for each in bank])
    newest_first = taps.transpose(2, 1, 0).reshape(channels * lags, len(bank))
    graph.add("MatMul", rows.window, graph.constant(newest_first), to="filtered")
    features = len(model.feature_taps)
    widths = {"raw_features": features, "base_n": 1} if model.offset is None else {"measured": features + 1}
    widths |= {"speeds_m_s": 4, "strokes_m_s": len(strokes), "changes": len(changes), "positions_m": len(positions)}
    graph.split("filtered", {name: width for name, width in widths.items() if width})


def estimated(graph: Graph, model: StepModel, rows: Rows, regime: str) -> str:
    """Return friction, lower and upper bound [N], shape ``(n, 3)``, of rows that are ``filtered`` and ``checked``."""
    parts = []
    if model.network is not None or model.forest is not None:
        _features(graph, model, rows)
    if model.network is not None:
        _network(graph, model.network, rows)
        if model.head_counts or model.forest_sees == "hidden_head_features":
            head = graph.constant(model.network.head[:, None], np.float32)
            bias = graph.constant([model.network.head_bias], np.float32)
            graph.add("Gemm", "hidden", head, bias, to="head")
        if model.head_counts:
            parts.append("head")
    if model.forest is not None:
        _forest(graph, model)
        parts.append("forest")
    base = _base_with_bounds(graph, model, regime)
    if not parts:
        return base
    outputs = parts[0] if len(parts) == 1 else graph.add("Concat", *parts, to="learnt_single", axis=1)
    graph.cast(outputs, "learnt", TensorProto.DOUBLE)
    scale = graph.constant(np.full((len(parts), 3), model.target_scale_n))
    return graph.add("Gemm", "learnt", scale, base, to="estimate_with_bounds_n")


def _features(graph: Graph, model: StepModel, rows: Rows) -> None:
    """Make ``features``, float32: ``(y / (a |y| + b) - mean) / scale``, the scale taken into ``a`` and ``b``.

    Those of the history follow.
    """
    limits, scale = model.feature_limits, model.feature_scale
    limited = limits > 0.0
    divisor = graph.constant([np.where(limited, limits, 1.0) * scale])
    if limited.any():
        graph.add("Abs", "raw_features", to="feature_sizes")
        graph.add("Mul", "feature_sizes", graph.constant([np.where(limited, scale, 0.0)]), to="limited_sizes")
        divisor = graph.add("Add", "limited_sizes", divisor, to="feature_divisors")
    graph.add("Div", "raw_features", divisor, to="soft_features")
    graph.add("Sub", "soft_features", graph.constant([model.feature_mean / scale]), to="scaled_features")
    features = "scaled_features"
    if model.history is not None:
        place = graph.indices(model.history.position_feature)
        smooth_m = graph.add("Gather", "raw_features", place, to="smooth_m", axis=1)
        history = rows.advance_history(model.history, smooth_m, model.sample_time_s)
        features = graph.add("Concat", features, history, to="every_feature", axis=1)
    graph.cast(features, "features", TensorProto.FLOAT)


def _network(graph: Graph, weights: LstmWeights, rows: Rows) -> None:
    """Make ``hidden``, shape ``(n, nodes)``; in the step graph also ``network_state``, from ``network``."""
    nodes, layers = weights.nodes, weights.layers
    states = [f"{what}_in_{layer}" for layer in range(layers) for what in ("hidden", "cell")]
    if rows.single:
        graph.split("network", dict.fromkeys(states, 1), axis=0)
    source = graph.add("Unsqueeze", "features", graph.indices(1), to="features_in_time")
    after: list[str] = []
    for layer in range(layers):
        inputs = weights.inputs if layer == 0 else nodes
        bias = np.concatenate([weights.bias[layer], np.zeros_like(weights.bias[layer])])
        every, hidden, cell = f"every_hidden_{layer}", f"hidden_{layer}", f"cell_{layer}"
        graph.add_many(
            "LSTM",
            source,
            graph.constant(weights.input[layer, :inputs].T[None], np.float32),
            graph.constant(weights.recurrent[layer].T[None], np.float32),
            graph.constant(bias[None], np.float32),
            *(["", *states[2 * layer : 2 * layer + 2]] if rows.single else []),
            to=["", hidden, cell] if rows.single else [every],
            hidden_size=nodes,
        )
        after += [hidden, cell]
        source = hidden if rows.single else graph.add("Squeeze", every, graph.indices(1), to=f"hidden_rows_{layer}")
    graph.add("Squeeze", source, graph.indices(0 if rows.single else 1), to="hidden")
    if rows.single:
        graph.add("Concat", *after, to="network_full", axis=0)
        graph.add("Shrink", "network_full", to="network_state", lambd=float(TINY))


def _forest(graph: Graph, model: StepModel) -> None:
    seen = {"hidden": ["hidden"], "hidden_head_features": ["hidden", "head", "features"], "features": ["features"]}
    inputs = seen[model.forest_sees]
    row = inputs[0] if len(inputs) == 1 else graph.add("Concat", *inputs, to="forest_row", axis=1)
    assert model.forest is not None
    graph.add("TreeEnsembleRegressor", row, to="forest", **tree_attributes(model.forest))


def tree_attributes(forest: Forest) -> dict[str, Any]:
    """Return the attributes of the ``TreeEnsembleRegressor`` that a forest is stored as."""
    node = forest_to_onnx(forest).graph.node[0]
    return {attribute.name: helper.get_attribute_value(attribute) for attribute in node.attribute}


def _base_with_bounds(graph: Graph, model: StepModel, regime: str) -> str:
    """Return what is corrected with its bounds by regime, shape ``(n, 3)``: friction, lower and upper [N]."""
    bounds, mean_n = model.bounds, model.target_mean_n
    regime = graph.cast(regime, "regime_index", TensorProto.INT64)
    spread_n, to = np.array(bounds.spread_n), "base_with_bounds_n"
    distances = np.stack([np.zeros(4), np.array(bounds.lower_n), np.array(bounds.upper_n)], axis=1)
    if model.offset is None or not spread_n.any():
        return graph.add("Add", "base_n", _by_regime(graph, distances + mean_n, regime, "offsets_n"), to=to)
    spread_n = np.where(spread_n > 0.0, spread_n, NO_SPREAD_N)[:, None]
    spread_square = _by_regime(graph, spread_n**2, regime, "spread_square")
    graph.add("Add", spread_square, "offset_variance", to="deviation_square")
    graph.add("Sqrt", "deviation_square", to="deviation_n")
    graph.add("Mul", _by_regime(graph, distances / spread_n, regime, "distances"), "deviation_n", to="distances_n")
    return graph.add("Sum", "base_n", "distances_n", graph.constant([[mean_n]]), to=to)


def _by_regime(graph: Graph, table: Array, regime: str, to: str) -> str:
    """Return the row of a table of four that a regime has, shape ``(n, columns)``."""
    reversing = np.repeat(table[3:], 3, axis=0)  # whatever the velocity
    return graph.add("GatherND", graph.constant(np.vstack([table[:3], reversing])), regime, to=to)

"""Networks and forests to ONNX and back. They are stored in no other form.

The network's graph takes (all float32) ``features`` (time, batch, features), ``hidden_in`` and ``cell_in`` (layers,
batch, nodes); it gives ``hidden`` (time, batch, nodes), the last layer's hidden states; ``head`` (time, batch, 1), the
linear head's output; ``hidden_out`` and ``cell_out``, the state to carry on. Time 1 makes it a step, any time a
sequence. The forest's graph takes ``features`` (rows, features) and gives ``output`` (rows, 1).
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from cylinder_friction.estimators.saved_folder import SavedModelError, read_plain_file
from cylinder_friction.realtime.checking import check_children, check_forest, check_network
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.lstm import LstmWeights

Single = NDArray[np.float32]
Part = TypeVar("Part", LstmWeights, Forest)

OPSET = 17
OPSETS = {"": OPSET, "ai.onnx.ml": 3}
NEUTRAL: dict[str, set[Any]] = {
    "post_transform": {b"NONE"},
    "nodes_hitrates": {1.0},
    "nodes_missing_value_": {0},
}
"""Attributes of a forest, by the beginning of their names, that have no effect with these values."""
IR_VERSION = 8  # IR version of ONNX 1.12 (2022), the first with these operator sets


def write_onnx(model: onnx.ModelProto, path: Path) -> None:
    """Write a graph; equal graphs give equal bytes."""
    path.write_bytes(model.SerializeToString(deterministic=True))


def write_network(weights: LstmWeights, path: Path) -> None:
    write_onnx(network_to_onnx(weights), path)


def read_network(path: Path) -> LstmWeights:
    """Read the weights that ``write_network`` wrote; raises ``SavedModelError`` if the file holds anything else."""
    return _read(path, network_from_onnx, network_to_onnx)


def write_forest(forest: Forest, path: Path) -> None:
    write_onnx(forest_to_onnx(forest), path)


def read_forest(path: Path) -> Forest:
    """Read the forest that ``write_forest`` wrote; raises ``SavedModelError`` if the file holds anything else."""
    return _read(path, forest_from_onnx, forest_to_onnx)


def _read(path: Path, parse: Callable[[onnx.ModelProto], Part], build: Callable[[Part], onnx.ModelProto]) -> Part:
    """Read a graph, and check that writing the result gives the same operators, nodes and attributes."""
    content = read_plain_file(path)
    try:
        model = onnx.load_model_from_string(content)
        part = parse(model)
        same = _without_neutral(build(part)) == _without_neutral(model)
    except Exception as error:  # protobuf and ONNX raise their own classes for each kind of damage
        raise SavedModelError(f"{path}: is no graph that `save` wrote ({error}); save the model again") from None
    if not same:
        raise SavedModelError(
            f"{path}: is another graph than `save` writes of its numbers; expected its operators and attributes alone"
        )
    return part


def _without_neutral(model: onnx.ModelProto) -> list[Any]:
    """List a graph's nodes without the neutral ones that scikit-learn's converter wrote in earlier versions."""
    nodes = []
    for node in model.graph.node:
        attributes = {each.name: helper.get_attribute_value(each) for each in node.attribute}
        kept = {name: value for name, value in attributes.items() if not _is_neutral(name, value)}
        if (node.op_type, kept) != ("Cast", {"to": TensorProto.FLOAT}):
            nodes.append((node.op_type, node.domain, kept, list(node.input)))
    return [nodes, sorted(model.graph.initializer, key=lambda each: each.name)]


def _is_neutral(name: str, value: Any) -> bool:
    return any(name.startswith(start) and set(np.ravel(value)) <= values for start, values in NEUTRAL.items())


def network_to_onnx(weights: LstmWeights) -> onnx.ModelProto:
    """Build and check the graph of a stack of LSTM layers with a linear head."""
    nodes: list[onnx.NodeProto] = []
    constants = [
        _tensor("head_weight", weights.head[:, None]),
        _tensor("head_bias", np.array([weights.head_bias], dtype=np.float32)),
        numpy_helper.from_array(np.array([1], dtype=np.int64), "direction_axis"),
    ]
    source = "features"
    for layer in range(weights.layers):
        inputs = weights.inputs if layer == 0 else weights.nodes
        constants += [
            _tensor(f"layer{layer}_W", weights.input[layer, :inputs].T[None]),
            _tensor(f"layer{layer}_R", weights.recurrent[layer].T[None]),
            _tensor(f"layer{layer}_B", np.concatenate([weights.bias[layer], np.zeros_like(weights.bias[layer])])[None]),
            numpy_helper.from_array(np.array([layer], dtype=np.int64), f"layer{layer}_index"),
        ]
        nodes += _layer_nodes(layer, source, weights.nodes)
        source = f"layer{layer}_hidden"
    nodes += [
        helper.make_node("Identity", [source], ["hidden"]),
        helper.make_node("MatMul", [source, "head_weight"], ["head_product"]),
        helper.make_node("Add", ["head_product", "head_bias"], ["head"]),
        _concat("hidden_out", [f"layer{layer}_hidden_out" for layer in range(weights.layers)]),
        _concat("cell_out", [f"layer{layer}_cell_out" for layer in range(weights.layers)]),
    ]
    state: list[int | str] = [weights.layers, "batch", weights.nodes]
    graph = helper.make_graph(
        nodes,
        "network",
        [
            _value("features", ["time", "batch", weights.inputs]),
            _value("hidden_in", state),
            _value("cell_in", state),
        ],
        [
            _value("hidden", ["time", "batch", weights.nodes]),
            _value("head", ["time", "batch", 1]),
            _value("hidden_out", state),
            _value("cell_out", state),
        ],
        initializer=constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


def network_from_onnx(model: onnx.ModelProto) -> LstmWeights:
    """Read the weights from a graph of ``network_to_onnx``; raises ``ValueError`` if their shapes do not fit."""
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    layers = sum(1 for name in stored if name.endswith("_R"))
    gates = 4 * stored["layer0_R"].shape[2]
    weights = LstmWeights.of(
        [stored[f"layer{layer}_W"][0].T for layer in range(layers)],
        [stored[f"layer{layer}_R"][0].T for layer in range(layers)],
        [stored[f"layer{layer}_B"][0, :gates] for layer in range(layers)],
        stored["head_weight"][:, 0],
        float(stored["head_bias"][0]),
    )
    check_network(weights)
    return weights


def forest_to_onnx(forest: Forest) -> onnx.ModelProto:
    """Build and check the graph of a forest: one ``TreeEnsembleRegressor``."""
    leaf = forest.feature < 0
    leaves = np.flatnonzero(leaf)
    tree = np.searchsorted(forest.roots, np.arange(len(leaf)), side="right") - 1
    first = forest.roots[tree]
    columns: dict[str, Any] = {
        "nodes_treeids": tree,
        "nodes_nodeids": np.arange(len(leaf)) - first,
        "nodes_featureids": np.where(leaf, 0, forest.feature),
        "nodes_values": np.where(leaf, np.float32(0.0), forest.threshold),
        "nodes_truenodeids": np.where(leaf, 0, forest.left - first),
        "nodes_falsenodeids": np.where(leaf, 0, forest.right - first),
        "target_treeids": tree[leaves],
        "target_nodeids": (np.arange(len(leaf)) - first)[leaves],
        "target_ids": np.zeros(len(leaves), dtype=np.int64),
        "target_weights": forest.value[leaves],
    }
    node = helper.make_node(
        "TreeEnsembleRegressor",
        ["features"],
        ["output"],
        domain="ai.onnx.ml",
        nodes_modes=["LEAF" if end else "BRANCH_LEQ" for end in leaf],
        n_targets=1,
        **{name: column.tolist() for name, column in columns.items()},
    )
    graph = helper.make_graph(
        [node], "forest", [_value("features", ["rows", forest.inputs])], [_value("output", ["rows", 1])]
    )
    opsets = [helper.make_opsetid(*each) for each in OPSETS.items()]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


def forest_from_onnx(model: onnx.ModelProto) -> Forest:
    """Read the forest from a graph of ``forest_to_onnx``; raises ``ValueError`` if a tree does not end."""
    node = model.graph.node[0]
    attributes = {attribute.name: helper.get_attribute_value(attribute) for attribute in node.attribute}
    trees, roots = np.unique(attributes["nodes_treeids"], return_index=True)
    base = roots[np.searchsorted(trees, attributes["nodes_treeids"])]
    leaf = np.array([mode == b"LEAF" for mode in attributes["nodes_modes"]])
    value = np.zeros(len(leaf), dtype=np.float32)
    value[np.flatnonzero(leaf)] = attributes["target_weights"]
    left = base + np.array(attributes["nodes_truenodeids"])
    right = base + np.array(attributes["nodes_falsenodeids"])
    check_children(~leaf, left, right, roots)
    forest = Forest.of(
        feature=np.where(leaf, -1, attributes["nodes_featureids"]),
        threshold=np.array(attributes["nodes_values"], dtype=np.float32),
        left=left,
        right=right,
        value=value,
        roots=roots,
        inputs=int(model.graph.input[0].type.tensor_type.shape.dim[1].dim_value),
    )
    check_forest(forest)
    return forest


def _layer_nodes(layer: int, source: str, width: int) -> list[onnx.NodeProto]:
    own = f"layer{layer}_"
    return [
        helper.make_node("Gather", ["hidden_in", own + "index"], [own + "hidden_in"], axis=0),
        helper.make_node("Gather", ["cell_in", own + "index"], [own + "cell_in"], axis=0),
        helper.make_node(
            "LSTM",
            [source, own + "W", own + "R", own + "B", "", own + "hidden_in", own + "cell_in"],
            [own + "all", own + "hidden_out", own + "cell_out"],
            hidden_size=width,
        ),
        helper.make_node("Squeeze", [own + "all", "direction_axis"], [own + "hidden"]),
    ]


def _concat(output: str, parts: list[str]) -> onnx.NodeProto:
    return helper.make_node("Concat", parts, [output], axis=0)


def _tensor(name: str, values: Single) -> onnx.TensorProto:
    return numpy_helper.from_array(np.ascontiguousarray(values, dtype=np.float32), name)


def _value(name: str, shape: list[Any]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)

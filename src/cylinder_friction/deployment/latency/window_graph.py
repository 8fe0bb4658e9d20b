"""Network and forest over a window as one ONNX graph, as converters leave them: nothing fused, no state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

if TYPE_CHECKING:
    from cylinder_friction.realtime.forest import Forest
    from cylinder_friction.realtime.lstm import LstmWeights
    from cylinder_friction.realtime.model import StepModel

OPSETS = (("", 17), ("ai.onnx.ml", 3))
IR_VERSION = 8


def window_session(model: StepModel) -> onnxruntime.InferenceSession:
    """Return a session on ``window_graph``, on one thread that does not spin."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(
        window_graph(model).SerializeToString(), options, providers=["CPUExecutionProvider"]
    )


def window_graph(model: StepModel) -> onnx.ModelProto:
    """Return the graph: ``window``, shape ``(1, time, features)``, to ``correction``, ``(1, 1)``, in target scales."""
    assert model.network is not None
    nodes, constants = _network_nodes(model.network)
    parts = ["head"] if model.head_counts else []
    if model.forest is not None:
        seen = "last_hidden"
        if model.forest_sees == "hidden_head_features":
            nodes.append(helper.make_node("Gather", ["window", "last"], ["last_features"], axis=1))
            nodes.append(helper.make_node("Concat", ["last_hidden", "head", "last_features"], ["seen"], axis=1))
            seen = "seen"
        nodes.append(_forest_node(model.forest, seen))
        parts.append("forest")
    nodes.append(helper.make_node("Sum", parts, ["correction"]))
    graph = helper.make_graph(
        nodes,
        "window",
        [helper.make_tensor_value_info("window", TensorProto.FLOAT, [1, "time", model.network.inputs])],
        [helper.make_tensor_value_info("correction", TensorProto.FLOAT, [1, 1])],
        initializer=[numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    opsets = [helper.make_opsetid(*opset) for opset in OPSETS]
    result = helper.make_model(graph, opset_imports=opsets, ir_version=IR_VERSION)
    onnx.checker.check_model(result)
    return result


def _network_nodes(weights: LstmWeights) -> tuple[list[onnx.NodeProto], dict[str, Any]]:
    nodes = [helper.make_node("Transpose", ["window"], ["sequence_0"], perm=[1, 0, 2])]
    constants: dict[str, Any] = {
        "last": np.array(-1, dtype=np.int64),
        "direction": np.array([1], dtype=np.int64),
        "head_weight": weights.head[:, None],
        "head_bias": np.array([weights.head_bias], dtype=np.float32),
    }
    for layer in range(weights.layers):
        inputs = weights.inputs if layer == 0 else weights.nodes
        bias = weights.bias[layer]
        constants[f"W_{layer}"] = weights.input[layer, :inputs].T[None].copy()
        constants[f"R_{layer}"] = weights.recurrent[layer].T[None].copy()
        constants[f"B_{layer}"] = np.concatenate([bias, np.zeros_like(bias)])[None]
        sources = [f"sequence_{layer}", f"W_{layer}", f"R_{layer}", f"B_{layer}"]
        nodes.append(helper.make_node("LSTM", sources, [f"all_{layer}"], hidden_size=weights.nodes))
        nodes.append(helper.make_node("Squeeze", [f"all_{layer}", "direction"], [f"sequence_{layer + 1}"]))
    nodes.append(helper.make_node("Gather", [f"sequence_{weights.layers}", "last"], ["last_hidden"], axis=0))
    nodes.append(helper.make_node("Gemm", ["last_hidden", "head_weight", "head_bias"], ["head"]))
    return nodes, constants


def _forest_node(forest: Forest, source: str) -> onnx.NodeProto:
    leaf = forest.feature < 0
    tree = np.searchsorted(forest.roots, np.arange(len(leaf)), side="right") - 1
    own = np.arange(len(leaf)) - forest.roots[tree]
    leaves = np.flatnonzero(leaf)
    return helper.make_node(
        "TreeEnsembleRegressor",
        [source],
        ["forest"],
        domain="ai.onnx.ml",
        n_targets=1,
        nodes_treeids=tree.tolist(),
        nodes_nodeids=own.tolist(),
        nodes_modes=np.where(leaf, "LEAF", "BRANCH_LEQ").tolist(),
        nodes_featureids=np.where(leaf, 0, forest.feature).tolist(),
        nodes_values=np.where(leaf, 0.0, forest.threshold).tolist(),
        nodes_truenodeids=np.where(leaf, 0, forest.left - forest.roots[tree]).tolist(),
        nodes_falsenodeids=np.where(leaf, 0, forest.right - forest.roots[tree]).tolist(),
        target_treeids=tree[leaves].tolist(),
        target_nodeids=own[leaves].tolist(),
        target_ids=[0] * len(leaves),
        target_weights=forest.value[leaves].tolist(),
    )

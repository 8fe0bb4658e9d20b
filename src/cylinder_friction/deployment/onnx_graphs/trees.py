"""A stored forest as attributes of ONNX's tree ensemble."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from cylinder_friction.realtime.forest import Forest


def forest_attributes(forest: Forest) -> dict[str, Any]:
    """Return the attributes of a ``TreeEnsembleRegressor`` (ai.onnx.ml 3) that runs ``forest``, every tree summed."""
    order = np.sort(forest.roots)
    count = len(forest.feature)
    tree = np.searchsorted(order, np.arange(count), side="right") - 1
    node = np.arange(count) - order[tree]
    leaf = forest.feature < 0
    return {
        "n_targets": 1,
        "aggregate_function": "SUM",
        "post_transform": "NONE",
        "nodes_treeids": tree.tolist(),
        "nodes_nodeids": node.tolist(),
        "nodes_featureids": np.where(leaf, 0, forest.feature).tolist(),
        "nodes_modes": np.where(leaf, "LEAF", "BRANCH_LEQ").tolist(),
        "nodes_values": np.where(leaf, np.float32(0.0), forest.threshold).tolist(),
        "nodes_truenodeids": np.where(leaf, 0, forest.left - order[tree]).tolist(),
        "nodes_falsenodeids": np.where(leaf, 0, forest.right - order[tree]).tolist(),
        "target_treeids": tree[leaf].tolist(),
        "target_nodeids": node[leaf].tolist(),
        "target_ids": [0] * int(leaf.sum()),
        "target_weights": forest.value[leaf].tolist(),
    }

"""A random forest as plain arrays: fitted by scikit-learn, stored as ONNX, run here one row after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np
import onnx
from skl2onnx import convert_sklearn
from skl2onnx.common.data_types import FloatTensorType
from sklearn.ensemble import RandomForestRegressor

if TYPE_CHECKING:
    from numpy.typing import NDArray

OPSETS = {"": 17, "ai.onnx.ml": 3}


@dataclass(frozen=True)
class Forest:
    """A forest of binary regression trees; a row goes left where ``feature <= threshold``.

    Attributes:
        feature: Feature that each node asks for, shape ``(nodes,)``; -1 in a leaf.
        threshold: Shape ``(nodes,)``, single precision, as ONNX Runtime compares.
        left: Index of the node where the answer is yes, shape ``(nodes,)``.
        right: Index of the node where it is no, shape ``(nodes,)``.
        value: What a leaf adds, already divided by the number of trees, shape ``(nodes,)``.
        roots: Index of each tree's first node, shape ``(trees,)``.
        depth: Longest way from a root to a leaf.
        inputs: Number of features.
    """

    feature: NDArray[np.int64]
    threshold: NDArray[np.float32]
    left: NDArray[np.int64]
    right: NDArray[np.int64]
    value: NDArray[np.float32]
    roots: NDArray[np.int64]
    depth: int
    inputs: int

    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the forest's output, shape ``(n,)``, for features of shape ``(n, inputs)``, float32."""
        return _predict(
            self.feature,
            self.threshold,
            self.left,
            self.right,
            self.value,
            self.roots,
            np.ascontiguousarray(features, dtype=np.float32),
        )

    def comparisons(self) -> int:
        """Return the comparisons of one row at worst."""
        return len(self.roots) * self.depth


@numba.njit(cache=True)
def _predict(
    feature: NDArray[np.int64],
    threshold: NDArray[np.float32],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    value: NDArray[np.float32],
    roots: NDArray[np.int64],
    rows: NDArray[np.float32],
) -> NDArray[np.float64]:
    result = np.zeros(rows.shape[0])
    for root in roots:  # tree after tree, since one fits a processor's nearest memory and all of them do not
        for row in range(rows.shape[0]):
            node = root
            while feature[node] >= 0:
                node = left[node] if rows[row, feature[node]] <= threshold[node] else right[node]
            result[row] += value[node]
    return result


def fit_forest(
    features: NDArray[np.float32], target: NDArray[np.float64], trees: int, depth: int, leaf: int, seed: int
) -> onnx.ModelProto:
    """Fit a random forest (Breiman 2001) and returns it as ONNX, the one form it is stored and run in.

    Args:
        features: Shape ``(n, k)``, float32, as at run time.
        target: Shape ``(n,)``.
        trees: Number of trees.
        depth: Greatest depth of a tree.
        leaf: Fewest rows in a leaf.
        seed: Of the bootstrap and of the features tried at each split (a third of them).
    """
    forest = RandomForestRegressor(
        n_estimators=trees, max_depth=depth, min_samples_leaf=leaf, max_features=1 / 3, random_state=seed, n_jobs=2
    ).fit(features, target)
    model = convert_sklearn(
        forest,
        name="forest",
        initial_types=[("features", FloatTensorType([None, features.shape[1]]))],
        final_types=[("output", FloatTensorType([None, 1]))],
        target_opset=OPSETS,
    )
    model.producer_version = ""
    in_order = sorted(model.opset_import, key=lambda entry: entry.domain)  # a set's order differs from run to run
    del model.opset_import[:]
    model.opset_import.extend(in_order)
    return model


def forest_from_onnx(model: onnx.ModelProto) -> Forest:
    """Return the arrays inside a ``TreeEnsembleRegressor``."""
    node = next(node for node in model.graph.node if node.op_type == "TreeEnsembleRegressor")
    attributes = {attribute.name: onnx.helper.get_attribute_value(attribute) for attribute in node.attribute}
    trees = np.array(attributes["nodes_treeids"])
    ids = np.array(attributes["nodes_nodeids"])
    first = {int(tree): int(np.flatnonzero(trees == tree)[0]) for tree in np.unique(trees)}
    base = np.array([first[int(tree)] for tree in trees])
    leaf = np.array([mode == b"LEAF" for mode in attributes["nodes_modes"]])
    value = np.zeros(len(ids), dtype=np.float32)
    where = [
        first[tree] + node_id
        for tree, node_id in zip(attributes["target_treeids"], attributes["target_nodeids"], strict=True)
    ]
    value[where] = np.array(attributes["target_weights"], dtype=np.float32)
    if attributes.get("aggregate_function", b"SUM") == b"AVERAGE":
        value /= np.float32(len(first))
    left = base + np.array(attributes["nodes_truenodeids"])
    right = base + np.array(attributes["nodes_falsenodeids"])
    roots = np.array(sorted(first.values()))
    inputs = model.graph.input[0].type.tensor_type.shape.dim[1].dim_value
    return Forest(
        np.where(leaf, -1, np.array(attributes["nodes_featureids"])).astype(np.int64),
        np.array(attributes["nodes_values"], dtype=np.float32),
        left.astype(np.int64),
        right.astype(np.int64),
        value,
        roots.astype(np.int64),
        _depth(roots, left, right, leaf),
        int(inputs),
    )


def _depth(roots: NDArray[np.int64], left: NDArray[np.int64], right: NDArray[np.int64], leaf: NDArray[np.bool_]) -> int:
    depth, level = 0, roots
    while True:
        inner = level[~leaf[level]]
        if len(inner) == 0:
            return depth
        level = np.concatenate([left[inner], right[inner]])
        depth += 1

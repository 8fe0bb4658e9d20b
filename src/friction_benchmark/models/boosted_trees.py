"""Gradient-boosted trees: fitted by scikit-learn on histograms, stored as ONNX, run as a ``Forest``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import onnx
from onnx import TensorProto, helper
from sklearn.ensemble import HistGradientBoostingRegressor
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # comes with scikit-learn

from cylinder_friction.realtime.forest import OPSETS

if TYPE_CHECKING:
    from numpy.typing import NDArray

IR_VERSION = 8


@dataclass(frozen=True)
class BoostingPlan:
    """How boosting goes.

    Attributes:
        trees: Rounds of boosting, one tree each.
        learning_rate: Share of each tree that is added.
        leaves: Greatest number of leaves of a tree.
        least_rows: Fewest rows in a leaf.
        penalty: L2 penalty of the leaf values.
        loss: ``absolute_error`` or ``squared_error``.
        rows: Rows drawn from all usable ones, at most.

    Raises:
        ValueError: A number is out of its range.
    """

    trees: int = 200
    learning_rate: float = 0.1
    leaves: int = 31
    least_rows: int = 40
    penalty: float = 1.0
    loss: Literal["absolute_error", "squared_error"] = "absolute_error"
    rows: int = 120_000

    def __post_init__(self) -> None:
        if min(self.trees, self.least_rows, self.rows) < 1 or self.leaves < 2:
            raise ValueError(f"BoostingPlan: expected at least one tree and row, and two leaves, but got {self}")
        if not 0.0 < self.learning_rate <= 1.0 or self.penalty < 0.0:
            raise ValueError(f"BoostingPlan: expected learning_rate in (0, 1] and penalty >= 0, but got {self}")
        if self.loss not in ("absolute_error", "squared_error"):
            raise ValueError(f"BoostingPlan: expected loss 'absolute_error' or 'squared_error', but got {self.loss!r}")


def fit_boosted_trees(
    features: NDArray[np.float32], target: NDArray[np.float64], plan: BoostingPlan, seed: int
) -> onnx.ModelProto:
    """Fit histogram gradient boosting and returns it as ONNX, the one form it is stored and run in.

    One thread sums the histograms, so that the same rows give the same trees on any machine.

    Args:
        features: Shape ``(n, k)``, float32, as at run time.
        target: Shape ``(n,)``.
        plan: How boosting goes; more rows than it allows are thinned out at random.
        seed: Of the rows drawn and of the histograms' edges.

    Source: Friedman 2001; on histograms as LightGBM (Ke et al. 2017).
    """
    count = min(plan.rows, len(features))
    chosen = np.sort(np.random.default_rng(seed).choice(len(features), count, replace=False))
    with threadpool_limits(1, user_api="openmp"):
        model = HistGradientBoostingRegressor(
            loss=plan.loss,
            learning_rate=plan.learning_rate,
            max_iter=plan.trees,
            max_leaf_nodes=plan.leaves,
            min_samples_leaf=min(plan.least_rows, max(1, count // 4)),
            l2_regularization=plan.penalty,
            early_stopping=False,
            random_state=seed,
        ).fit(features[chosen], target[chosen])
    return trees_to_onnx(model, features.shape[1])


def trees_to_onnx(model: HistGradientBoostingRegressor, inputs: int) -> onnx.ModelProto:
    """Return a fitted model as a ``TreeEnsembleRegressor`` that takes every row the way scikit-learn does.

    scikit-learn compares with thresholds in double precision, ONNX in single. Features are single precision on both
    sides, so the greatest single-precision number that is not above a threshold parts them alike. Leaf values are
    rounded to single precision. The first tree is one leaf, the value that boosting begins from.
    """
    table: dict[str, list[Any]] = {
        name: [] for name in ("treeids", "nodeids", "featureids", "modes", "values", "truenodeids", "falsenodeids")
    }
    weights: dict[str, list[Any]] = {"treeids": [], "nodeids": [], "weights": []}
    start = np.zeros(1, dtype=[("is_leaf", bool), ("value", float), ("feature_idx", int), ("num_threshold", float),
                               ("left", int), ("right", int)])  # fmt: skip
    start["is_leaf"], start["value"] = True, float(np.ravel(model._baseline_prediction)[0])
    for tree, nodes in enumerate([start, *(stage[0].nodes for stage in model._predictors)]):
        leaf = nodes["is_leaf"].astype(bool)
        count = len(nodes)
        table["treeids"] += [tree] * count
        table["nodeids"] += range(count)
        table["featureids"] += np.where(leaf, 0, nodes["feature_idx"]).tolist()
        table["modes"] += ["LEAF" if end else "BRANCH_LEQ" for end in leaf]
        table["values"] += np.where(leaf, 0.0, _rounded_down(nodes["num_threshold"])).tolist()
        table["truenodeids"] += np.where(leaf, 0, nodes["left"]).tolist()
        table["falsenodeids"] += np.where(leaf, 0, nodes["right"]).tolist()
        weights["treeids"] += [tree] * int(leaf.sum())
        weights["nodeids"] += np.flatnonzero(leaf).tolist()
        weights["weights"] += nodes["value"][leaf].astype(np.float32).tolist()
    attributes: dict[str, Any] = {f"nodes_{name}": values for name, values in table.items()}
    attributes |= {f"target_{name}": values for name, values in weights.items()}
    attributes |= {"target_ids": [0] * len(weights["weights"]), "n_targets": 1}
    attributes |= {"aggregate_function": "SUM", "post_transform": "NONE"}
    node = helper.make_node(
        "TreeEnsembleRegressor", ["features"], ["output"], name="trees", domain="ai.onnx.ml", **attributes
    )
    graph = helper.make_graph(
        [node],
        "boosted_trees",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, [None, inputs])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, [None, 1])],
    )
    opsets = [helper.make_opsetid(domain, version) for domain, version in sorted(OPSETS.items())]
    made = helper.make_model(graph, opset_imports=opsets, ir_version=IR_VERSION)
    onnx.checker.check_model(made)
    return made


def _rounded_down(thresholds: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the greatest single-precision numbers that are not above given ones."""
    with np.errstate(over="ignore"):
        single = thresholds.astype(np.float32)
    above = single.astype(np.float64) > thresholds
    single[above] = np.nextafter(single[above], np.float32(-np.inf))
    return single

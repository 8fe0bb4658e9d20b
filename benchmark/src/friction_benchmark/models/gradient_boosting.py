"""Histogram gradient boosting on features of the present, of some samples ago, and of slow averages.

Fitted by scikit-learn, stored as ONNX, run as a ``Forest``.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from threadpoolctl import threadpool_limits  # comes with scikit-learn

from cylinder_friction.estimators.forest import rounded_down
from cylinder_friction.estimators.onnx_files import read_forest, write_forest
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.lagged import Past, PastMemory
from friction_benchmark.models.learned import LearnedEstimator

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData

TREES_FILE = "trees.onnx"
PAST = Past(lags=(6, 20, 60), averages=(100.0, 1000.0))
"""30, 100 and 300 ms ago; averages over 0.5 and 5 s, which show the contribution of sensor zeros or of a load."""


@dataclass(frozen=True)
class BoostingPlan:
    """Settings of the boosting.

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


class GradientBoostingEstimator(LearnedEstimator):
    """Gradient-boosted trees (Friedman 2001; Ke et al. 2017) that correct the force balance, or give all of friction.

    Trees hold no state and cannot leave the range of their training targets; the past enters as features.
    """

    kind: ClassVar[str] = "gradient_boosting"

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        plan: BoostingPlan | None = None,
        past: Past = PAST,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, inputs, seed)
        self.plan, self.past = plan or BoostingPlan(), past
        self._trees: Forest | None = None

    def learn(self, train: Sequence[SequenceData]) -> None:
        rows = [self.past.advance(self.past.new_memory(), each.features)[each.usable] for each in train]
        target = np.concatenate([each.target[each.usable] for each in train]).astype(np.float64)
        self._trees = fit_boosted_trees(np.concatenate(rows), target, self.plan, self.seed)

    def new_memory(self) -> PastMemory:
        return self.past.new_memory()

    def predict(self, memory: PastMemory, features: NDArray[np.float32]) -> NDArray[Any]:
        assert self._trees is not None
        return self._trees.predict(self.past.advance(memory, features))

    def model_multiply_adds(self) -> int:
        """Return the comparisons on the longest path through every tree, and the averages."""
        assert self._trees is not None
        assert self.features is not None
        return self._trees.comparisons() + self.past.multiply_adds(len(self.features.names))

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self._trees is not None
        write_forest(self._trees, folder / TREES_FILE)
        return {"trees": TREES_FILE, "plan": asdict(self.plan), "past": asdict(self.past), "seed": self.seed}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        plan, past = BoostingPlan(**content["plan"]), Past(**content["past"])
        estimator = cls(cylinder, inputs, plan, past, content["seed"])
        estimator._read_trees(folder, content)
        return estimator

    def _read_trees(self, folder: Path, content: dict[str, Any]) -> None:
        self._trees = read_forest(folder / content["trees"])


def fit_boosted_trees(
    features: NDArray[np.float32], target: NDArray[np.float64], plan: BoostingPlan, seed: int
) -> Forest:
    """Fit histogram gradient boosting and return its trees as plain arrays.

    One thread sums the histograms, so that the same rows give the same trees on any machine.

    Args:
        features: Shape ``(n, k)``, float32, as at run time.
        target: Shape ``(n,)``.
        plan: Settings; more rows than it allows are thinned out at random.
        seed: Seeds the drawing of rows and the histograms' edges.

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
    return trees_of(model, features.shape[1])


def trees_of(model: HistGradientBoostingRegressor, inputs: int) -> Forest:
    """Return a fitted model as a forest in which every row takes the path that it takes in scikit-learn.

    Leaf values are rounded to single precision. The first tree is one leaf, the value that boosting begins from.
    """
    trees = [stage[0].nodes for stage in model._predictors]
    starts = 1 + np.cumsum([0, *(len(nodes) for nodes in trees[:-1])])
    nodes = np.concatenate(trees)
    first = np.repeat(starts, [len(tree) for tree in trees])
    leaf = nodes["is_leaf"].astype(bool)
    begins = float(np.ravel(model._baseline_prediction)[0])
    return Forest.of(
        feature=np.concatenate([[-1], np.where(leaf, -1, nodes["feature_idx"])]),
        threshold=np.concatenate([[0.0], np.where(leaf, 0.0, rounded_down(nodes["num_threshold"]))]),
        left=np.concatenate([[0], first + nodes["left"]]),
        right=np.concatenate([[0], first + nodes["right"]]),
        value=np.concatenate([[begins], np.where(leaf, nodes["value"], 0.0)]),
        roots=np.concatenate([[0], starts]),
        inputs=inputs,
    )

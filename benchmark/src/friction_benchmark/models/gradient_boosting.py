"""Histogram gradient boosting on features of the present, of some samples ago, and of slow averages."""

from collections.abc import Sequence

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from threadpoolctl import threadpool_limits  # comes with scikit-learn

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.training_plan import SequenceData
from friction_benchmark.models.base import FeatureModel, Single
from friction_benchmark.models.lagged import Past
from friction_benchmark.registry import BuildConfiguration, Float, OneOf, RegisteredModel, Space

PAST = Past(lags=(6, 20, 60), averages=(100.0, 1000.0))
"""30, 100 and 300 ms ago; averages over 0.5 and 5 s, which show the contribution of sensor zeros or of a load."""
LEAST_ROWS, PENALTY = 40, 1.0  # Fewest rows in a leaf, and the L2 penalty of its value


class GradientBoosting(FeatureModel):
    """Gradient-boosted trees (Friedman 2001; Ke et al. 2017) that correct the force balance, or give all of friction.

    Trees hold no state and cannot leave the range of their training targets; the past enters as features. Effort cuts
    trees, and the rows drawn from all usable ones.
    """

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build)
        self.rows = build.share(160_000, 2000)
        self.trees = HistGradientBoostingRegressor(
            loss=build.hyperparameters["loss"],
            learning_rate=build.number("learning_rate"),
            max_iter=build.share(400, 5),
            max_leaf_nodes=build.whole("leaves"),
            min_samples_leaf=LEAST_ROWS,
            l2_regularization=PENALTY,
            early_stopping=False,
            random_state=build.seed,
        )

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Fit the trees; one thread sums the histograms, so that equal rows give equal trees on any machine."""
        rows = np.concatenate([PAST.of(each.features)[each.usable] for each in train])
        target = np.concatenate([each.target[each.usable] for each in train]).astype(np.float64)
        count = min(self.rows, len(rows))
        chosen = np.sort(np.random.default_rng(self.seed).choice(len(rows), count, replace=False))
        with threadpool_limits(1, user_api="openmp"):
            self.trees.fit(rows[chosen], target[chosen])

    def predict(self, features: Single) -> Array:
        with threadpool_limits(1, user_api="openmp"):
            return np.asarray(self.trees.predict(PAST.of(features)))

    def model_multiply_adds(self) -> int:
        """Return the comparisons on the longest path through every tree, and the averages."""
        longest = sum(int(tree.nodes["depth"].max()) for stage in self.trees._predictors for tree in stage)
        return longest + PAST.multiply_adds(len(self.features.names))


SPACE: Space = {
    "learning_rate": (Float(0.04, 0.25, log=True), 0.1),
    "leaves": (OneOf((15, 31, 63)), 31),
    "loss": (OneOf(("absolute_error", "squared_error")), "absolute_error"),
}
MODELS = (
    RegisteredModel(
        name="gradient_boosting",
        title="Histogram gradient boosting",
        family="modern",
        source="Friedman 2001; Ke et al. 2017",
        build=GradientBoosting,
        space=SPACE,
        chosen="Features of now, 30, 100 and 300 ms ago, and averages over 0.5 and 5 s.",
    ),
)

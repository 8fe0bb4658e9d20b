"""The random forest: fitted by scikit-learn; on the paper's filtered signals also an estimator of its own."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.front_end import FrontEnd, fit_front_end
from cylinder_friction.estimators.linear import labelled_rows
from cylinder_friction.estimators.onnx_files import read_forest, write_forest
from cylinder_friction.extras import explained
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

FOREST_FILE = "forest.onnx"


@dataclass(frozen=True)
class ForestPlan:
    """Size of a forest: trees and their greatest depth (the paper's Table I), rows of each tree, fewest rows in a leaf.

    The default search on the rig's campaign found the defaults of trees and depth.
    """

    trees: int = 22
    depth: int = 6
    rows: int = 15_000
    leaf: int = 10


class ForestEstimator(FrictionEstimator):
    """A random forest on filtered P1, P2 and velocity of the present sample.

    Args:
        cylinder: Its areas; needed for ``fit`` alone.
        plan: Trees, depth, rows and leaf.
        seed: Seeds the rows of each tree and the features tried at each split.
        inputs: Columns of a sample; both raw pressures and the position must be among them.
    """

    kind: ClassVar[str] = "random_forest"
    files = (FOREST_FILE,)
    shown: ClassVar[tuple[str, ...]] = ("plan",)

    def __init__(
        self,
        cylinder: Cylinder | None = None,
        plan: ForestPlan | None = None,
        seed: int = 0,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
    ) -> None:
        super().__init__(inputs)
        self.cylinder, self.plan, self.seed = cylinder, plan or ForestPlan(), seed

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from the usable rows."""
        if self.cylinder is None:
            raise ValueError("a forest needs a cylinder to be fitted; got a loaded one without")
        recordings = self._begin_fit(recordings)
        front_end = fit_front_end("paper", self.cylinder, recordings, self.channels)
        labels, masks = labelled_rows(recordings)
        rows = [
            front_end.run(recording.samples(self.channels))[0][mask]
            for recording, mask in zip(recordings, masks, strict=True)
        ]
        self._set(front_end, fit_forest(np.concatenate(rows), labels, self.plan, self.seed))
        return self

    def _set(self, front_end: FrontEnd, forest: Forest) -> None:
        self.front_end, self.forest = front_end, forest

    def multiply_adds(self) -> int:
        return self.front_end.multiply_adds() + self.forest.comparisons()

    def step_model(self) -> StepModel:
        """Return what one real-time step needs; see ``FrictionEstimator.step_model``."""
        self._refuse_unfitted()
        return self._step_model(**self.front_end.step_fields(), forest=self.forest, forest_sees="features")

    def _write(self, folder: Path) -> dict[str, Any]:
        write_forest(self.forest, folder / FOREST_FILE)
        return {"front_end": self.front_end.to_dict(), "forest": FOREST_FILE}

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        estimator = cls()
        estimator._set(FrontEnd.from_dict(parameters["front_end"]), read_forest(folder / FOREST_FILE))
        return estimator


def fit_forest(features: NDArray[np.float32], target: NDArray[np.float64], plan: ForestPlan, seed: int) -> Forest:
    """Fit a random forest (Breiman 2001), each tree on randomly drawn rows, and convert it to plain arrays.

    scikit-learn compares with thresholds in double precision, every runtime in single. Features are single
    precision on both sides, so the greatest single-precision number that is not above a threshold separates them alike.

    Args:
        features: Shape ``(n, k)``, float32, as at run time.
        target: Shape ``(n,)``.
        plan: Trees, depth, leaf and the rows each tree draws; no more than there are.
        seed: Seeds those rows and the features tried at each split (a third of them).
    """
    with explained():  # scikit-learn: only training needs it
        from sklearn.ensemble import RandomForestRegressor

    fitted = RandomForestRegressor(
        n_estimators=plan.trees,
        max_depth=plan.depth,
        min_samples_leaf=plan.leaf,
        max_features=1 / 3,
        max_samples=min(plan.rows, len(features)),
        random_state=seed,
        n_jobs=2,
    ).fit(features, target)
    trees = [each.tree_ for each in fitted.estimators_]
    starts = np.cumsum([0, *(tree.node_count for tree in trees[:-1])])
    leaf = np.concatenate([tree.children_left < 0 for tree in trees])
    return Forest.of(
        feature=np.where(leaf, -1, np.concatenate([tree.feature for tree in trees])),
        threshold=np.where(leaf, 0.0, rounded_down(np.concatenate([tree.threshold for tree in trees]))),
        left=np.concatenate([start + tree.children_left for start, tree in zip(starts, trees, strict=True)]),
        right=np.concatenate([start + tree.children_right for start, tree in zip(starts, trees, strict=True)]),
        value=np.where(leaf, np.concatenate([tree.value[:, 0, 0] for tree in trees]) / len(trees), 0.0),
        roots=starts,
        inputs=features.shape[1],
    )


def rounded_down(thresholds: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round numbers down to single precision."""
    with np.errstate(over="ignore"):
        single = thresholds.astype(np.float32)
    above = single.astype(np.float64) > thresholds
    single[above] = np.nextafter(single[above], np.float32(-np.inf))
    return single

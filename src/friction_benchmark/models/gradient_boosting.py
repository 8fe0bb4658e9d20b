"""Histogram gradient boosting on the features of the present, of some samples ago, and of slow averages."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import onnx

from cylinder_friction.realtime.forest import Forest, forest_from_onnx
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.boosted_trees import BoostingPlan, fit_boosted_trees
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
"""30, 100 and 300 ms ago; averages over 0.5 and 5 s, which show what the sensors' zeros or a load add."""


class GradientBoostingEstimator(LearnedEstimator):
    """Gradient-boosted trees (Friedman 2001; Ke et al. 2017) that correct the force balance, or give all of friction.

    Trees hold no state and cannot leave the range of their training targets; the past reaches them as features.

    Args:
        cylinder: Its areas.
        inputs: Columns that it sees.
        plan: Trees, leaves, rows.
        past: Which earlier features it is given.
        seed: Of the rows drawn.
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
        self._model: onnx.ModelProto | None = None
        self._trees: Forest | None = None

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Learn from ``plan.rows`` usable rows."""
        rows = [self.past.advance(self.past.new_memory(), each.features)[each.usable] for each in train]
        target = np.concatenate([each.target[each.usable] for each in train]).astype(np.float64)
        self._set_model(fit_boosted_trees(np.concatenate(rows), target, self.plan, self.seed))

    def new_memory(self) -> PastMemory:
        return self.past.new_memory()

    def predict(self, memory: PastMemory, features: NDArray[np.float32]) -> NDArray[Any]:
        assert self._trees is not None
        return self._trees.predict(self.past.advance(memory, features))

    def model_multiply_adds(self) -> int:
        """Return the comparisons on the longest way through every tree, and the averages."""
        assert self._trees is not None
        assert self.features is not None
        return self._trees.comparisons() + self.past.multiply_adds(len(self.features.names))

    def _set_model(self, model: onnx.ModelProto) -> None:
        self._model, self._trees = model, forest_from_onnx(model)

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self._model is not None
        (folder / TREES_FILE).write_bytes(self._model.SerializeToString(deterministic=True))
        return {"trees": TREES_FILE, "plan": asdict(self.plan), "past": self.past.to_dict(), "seed": self.seed}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        past = Past.from_dict(content["past"])
        estimator = cls(cylinder, inputs, BoostingPlan(**content["plan"]), past, content["seed"])
        estimator._read_trees(folder, content)
        return estimator

    def _read_trees(self, folder: Path, content: dict[str, Any]) -> None:
        self._set_model(onnx.load(folder / content["trees"]))

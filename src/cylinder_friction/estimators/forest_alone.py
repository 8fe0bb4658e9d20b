"""The random forest without a network: the paper's second half on the paper's filtered signals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import onnx

from cylinder_friction.estimators.front_end import FrontEnd, FrontEndBlock, FrontEndState, fit_front_end
from cylinder_friction.realtime.estimator import RealTimeEstimator
from cylinder_friction.realtime.forest import fit_forest, forest_from_onnx

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import Array
    from cylinder_friction.estimators.hybrid import ForestPlan
    from cylinder_friction.recordings.recording import Recording

FOREST_FILE = "forest.onnx"


class ForestEstimator(RealTimeEstimator):
    """A random forest on filtered P1, P2 and velocity of the present sample.

    Args:
        cylinder: Its areas.
        plan: Trees, depth, rows and leaf.
        seed: Of rows and bootstrap.
    """

    kind: ClassVar[str] = "random_forest"

    def __init__(self, cylinder: Cylinder | None = None, plan: ForestPlan | None = None, seed: int = 0) -> None:
        super().__init__()
        self.cylinder, self.plan, self.seed = cylinder, plan, seed

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from ``plan.rows`` usable rows."""
        if self.cylinder is None or self.plan is None:
            raise ValueError("a forest needs cylinder and plan to be fitted; got a loaded one without")
        self._begin_fit(recordings)
        front_end = fit_front_end("paper", self.cylinder, recordings)
        block = FrontEndBlock(front_end)
        masks = [recording.usable() for recording in recordings]
        rows = np.concatenate(
            [
                block.advance(block.new_state(), recording.samples())[0][mask]
                for recording, mask in zip(recordings, masks, strict=True)
            ]
        )
        labels = np.concatenate(
            [recording.column("friction_n")[mask] for recording, mask in zip(recordings, masks, strict=True)]
        )
        count = min(self.plan.rows, len(rows))
        chosen = np.sort(np.random.default_rng(self.seed).choice(len(rows), count, replace=False))
        model = fit_forest(rows[chosen], labels[chosen], self.plan.trees, self.plan.depth, self.plan.leaf, self.seed)
        self._set(front_end, model)
        return self

    def _set(self, front_end: FrontEnd, model: onnx.ModelProto) -> None:
        self.front_end_block = FrontEndBlock(front_end)
        self._model = model
        self.forest = forest_from_onnx(model)

    def new_state(self) -> FrontEndState:
        return self.front_end_block.new_state()

    def advance(self, state: FrontEndState, samples: Array) -> Array:
        features, _ = self.front_end_block.advance(state, samples)
        return self.forest.predict(features)

    def multiply_adds(self) -> int:
        return self.front_end_block.multiply_adds() + self.forest.comparisons()

    def _write(self, folder: Path) -> dict[str, Any]:
        (folder / FOREST_FILE).write_bytes(self._model.SerializeToString(deterministic=True))
        return {"front_end": self.front_end_block.front_end.to_dict(), "forest": FOREST_FILE}

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        estimator = cls()
        estimator._set(FrontEnd.from_dict(parameters["front_end"]), onnx.load(folder / parameters["forest"]))
        return estimator

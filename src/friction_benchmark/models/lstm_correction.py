"""The LSTM over any sensors' features, alone or with a forest on its state that learns what it leaves: the hybrid.

The default hybrid (``hybrid.py``) sees both pressures and the position. This one sees what a task allows, steps at its
own stride, and shares with it the LSTM, the forest, and how both are stored.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import onnx

from cylinder_friction.estimators.hybrid import FOREST_FILE, ForestPlan
from cylinder_friction.estimators.onnx_files import network_from_onnx, network_to_onnx
from cylinder_friction.estimators.training_plan import Architecture
from cylinder_friction.realtime.forest import Forest, fit_forest, forest_from_onnx
from cylinder_friction.realtime.lstm import Lstm
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.sequence_estimator import HeldMemory, SequenceEstimator, SequencePlan

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import torch
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData

    Single = NDArray[np.float32]


class SteppedLstm(Lstm):
    """An ``Lstm`` that tells its width and cost."""

    @property
    def width(self) -> int:
        return self.weights.nodes

    def multiply_adds(self) -> int:
        return self.weights.multiply_adds()


class LstmEstimator(SequenceEstimator):
    """An LSTM that corrects the force balance, or gives all of friction where there are no pressures
    (Hochreiter and Schmidhuber 1997). ``architecture`` is an ``Architecture``."""

    kind: ClassVar[str] = "lstm"
    architecture_type: ClassVar[type] = Architecture

    def make_network(self, inputs: int) -> torch.nn.Module:
        from cylinder_friction.estimators.network_training import FrictionNetwork  # PyTorch: training alone waits

        return FrictionNetwork(self.architecture, inputs)

    def to_onnx(self, network: Any) -> onnx.ModelProto:
        from cylinder_friction.estimators.network_training import weights_of

        return network_to_onnx(weights_of(network))

    def from_onnx(self, model: onnx.ModelProto) -> SteppedLstm:
        return SteppedLstm(network_from_onnx(model))


class LstmForestEstimator(LstmEstimator):
    """The hybrid for any sensors: the LSTM, and a forest on its state, its output and the features of every sample.

    Args:
        cylinder: Its areas.
        architecture: Of the LSTM.
        plan: Of its training, and its stride.
        forest_plan: Of the forest.
        inputs: Columns that it sees.
        seed: Of everything random.
    """

    kind: ClassVar[str] = "lstm_forest"

    def __init__(
        self,
        cylinder: Cylinder,
        architecture: Architecture,
        plan: SequencePlan,
        forest_plan: ForestPlan,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, architecture, plan, inputs, seed)
        self.forest_plan = forest_plan
        self._forest_model: onnx.ModelProto | None = None
        self._forest: Forest | None = None

    def learn(self, train: Sequence[SequenceData]) -> None:
        super().learn(train)
        inputs, left = [], []
        for sequence in train:
            hidden, head = self.hold(self.new_memory(), sequence.features)
            mask = sequence.usable
            inputs.append(np.concatenate([hidden, head[:, None], sequence.features], axis=1)[mask])
            left.append((sequence.target - head)[mask])
        rows, target = np.concatenate(inputs), np.concatenate(left).astype(np.float64)
        plan = self.forest_plan
        chosen = np.random.default_rng(self.seed).choice(len(rows), min(plan.rows, len(rows)), replace=False)
        chosen.sort()
        model = fit_forest(rows[chosen], target[chosen], plan.trees, plan.depth, plan.leaf, self.seed)
        self._set_forest(model)

    def predict(self, memory: HeldMemory, features: Single) -> NDArray[Any]:
        assert self._forest is not None
        hidden, head = self.hold(memory, features)
        return head + self._forest.predict(np.concatenate([hidden, head[:, None], features], axis=1))

    def model_multiply_adds(self) -> int:
        assert self._forest is not None
        return super().model_multiply_adds() + self._forest.comparisons()

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self._forest_model is not None
        (folder / FOREST_FILE).write_bytes(self._forest_model.SerializeToString(deterministic=True))
        return {**super().write_model(folder), "forest": asdict(self.forest_plan)}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        architecture, plan = Architecture(**content["architecture"]), SequencePlan(**content["plan"])
        estimator = cls(cylinder, architecture, plan, ForestPlan(**content["forest"]), inputs, content["seed"])
        estimator._load_network(folder)
        estimator._set_forest(onnx.load(folder / FOREST_FILE))
        return estimator

    def _set_forest(self, model: onnx.ModelProto) -> None:
        self._forest_model, self._forest = model, forest_from_onnx(model)

"""The hybrid of LSTM and random forest, in two designs.

``paper``: an LSTM over both pressures and velocity, filtered as published; its last hidden state goes into a random
forest, whose output is the estimate. ``force_balance``: the causal force balance first, an LSTM that corrects it,
and a forest that corrects what the LSTM leaves. Without its forest, either is the LSTM alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import onnx

from cylinder_friction.estimators.early_stopping import held_out_for_stopping
from cylinder_friction.estimators.front_end import Design, FrontEnd, FrontEndBlock, FrontEndState, fit_front_end
from cylinder_friction.estimators.onnx_files import network_from_onnx, network_to_onnx
from cylinder_friction.estimators.training_plan import (
    Architecture,
    EpochReport,
    LearningCurve,
    SequenceData,
    TrainingPlan,
)
from cylinder_friction.realtime.estimator import RealTimeEstimator
from cylinder_friction.realtime.forest import Forest, fit_forest, forest_from_onnx
from cylinder_friction.realtime.guard import largest_friction_n
from cylinder_friction.realtime.lstm import Lstm, LstmState

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import Array
    from cylinder_friction.estimators.checkpoint import Checkpoint
    from cylinder_friction.recordings.recording import Recording

NETWORK_FILE = "network.onnx"
FOREST_FILE = "forest.onnx"


@dataclass(frozen=True)
class ForestPlan:
    """The forest: trees and their greatest depth (the paper's Table I), rows it is fitted on, fewest rows in a leaf."""

    trees: int
    depth: int
    rows: int
    leaf: int


@dataclass(frozen=True)
class HybridParts:
    """A trained hybrid: everything that a step needs.

    Attributes:
        design: Which of the two.
        front_end: Filters and scaling.
        network: The LSTM as ONNX.
        forest: The forest as ONNX; None for the LSTM alone.
        target_mean_n: What the network's output 0 stands for [N].
        target_scale_n: What its output 1 adds to that [N].
    """

    design: Design
    front_end: FrontEnd
    network: onnx.ModelProto
    forest: onnx.ModelProto | None
    target_mean_n: float
    target_scale_n: float


@dataclass
class HybridState:
    """State of the front end and of the LSTM; the forest has none."""

    front_end: FrontEndState
    network: LstmState


class HybridEstimator(RealTimeEstimator):
    """LSTM + random forest on causally filtered samples.

    Args:
        cylinder: Its areas.
        design: ``force_balance`` (the default of the project) or ``paper``.
        architecture: Of the LSTM.
        plan: Of its training.
        forest_plan: Of the forest; None for the LSTM alone.
        seed: Of weights, dropout, order and bootstrap.
        device: ``cpu`` or ``cuda``, for training.
    """

    kind: ClassVar[str] = "hybrid"

    def __init__(
        self,
        cylinder: Cylinder | None = None,
        design: Design = "force_balance",
        architecture: Architecture | None = None,
        plan: TrainingPlan | None = None,
        forest_plan: ForestPlan | None = None,
        seed: int = 0,
        device: str = "cpu",
    ) -> None:
        super().__init__()
        self.cylinder, self.design, self.architecture, self.plan = cylinder, design, architecture, plan
        self.forest_plan, self.seed, self.device = forest_plan, seed, device
        self.learning_curve = LearningCurve()
        self.parts: HybridParts | None = None

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from all but the sessions that early stopping listens to: see ``held_out_for_stopping``."""
        return self.fit_with_validation(*held_out_for_stopping(recordings))

    def fit_with_validation(
        self,
        train: Sequence[Recording],
        validation: Sequence[Recording],
        checkpoint: Checkpoint | None = None,
        report: EpochReport | None = None,
    ) -> Self:
        """Learn front end, network and forest from ``train``; ``validation`` only stops the network's training.

        Args:
            train: Labelled recordings.
            validation: Labelled recordings of other sessions.
            checkpoint: Where training stands, kept after each epoch.
            report: Called after each epoch with its number and both mean absolute errors [N].
        """
        if self.cylinder is None or self.architecture is None or self.plan is None:
            raise ValueError("a hybrid needs cylinder, architecture and plan to be fitted; got a loaded one without")
        from cylinder_friction.estimators.network_training import train_network  # PyTorch: training alone waits for it

        self._begin_fit(train)
        front_end = fit_front_end(self.design, self.cylinder, train)
        mean_n, scale_n = _target_scaling(front_end, train)
        weights, curve = train_network(
            self.architecture,
            self.plan,
            [_sequence(front_end, recording, mean_n, scale_n) for recording in train],
            [_sequence(front_end, recording, mean_n, scale_n) for recording in validation],
            self.seed,
            self.device,
            checkpoint,
            None if report is None else lambda epoch, *maes: report(epoch, *(scale_n * mae for mae in maes)),
        )
        self.learning_curve = LearningCurve(
            [scale_n * mae for mae in curve.train_mae],
            [scale_n * mae for mae in curve.validation_mae],
            curve.best_epoch,
        )
        network = network_to_onnx(weights)
        self._set(HybridParts(self.design, front_end, network, None, mean_n, scale_n))
        if self.forest_plan is not None:
            self._set(self._with_forest(train, self.forest_plan))
        self.calibrate(largest_friction_n(train), validation)
        return self

    def without_forest(self) -> HybridEstimator:
        """Return the LSTM alone: the same network, the forest left out."""
        parts = self._fitted()
        alone = HybridEstimator(self.cylinder, self.design, self.architecture, self.plan, None, self.seed, self.device)
        alone.sample_time_s, alone.training_range, alone.guard = self.sample_time_s, self.training_range, self.guard
        alone._set(
            HybridParts(parts.design, parts.front_end, parts.network, None, parts.target_mean_n, parts.target_scale_n)
        )
        return alone

    def new_state(self) -> HybridState:
        self._fitted()
        return HybridState(self._front_end.new_state(), self._network.new_state())

    def advance(self, state: HybridState, samples: Array) -> Array:
        parts = self._fitted()
        features, base_n = self._front_end.advance(state.front_end, samples)
        hidden, head = self._network.advance(state.network, features)
        corrected_n = base_n + parts.target_mean_n + parts.target_scale_n * head.astype(np.float64)
        if self._forest is None:
            return corrected_n
        forest_n = parts.target_scale_n * self._forest.predict(forest_input(parts.design, hidden, head, features))
        if parts.design == "paper":
            return base_n + parts.target_mean_n + forest_n
        return corrected_n + forest_n

    def multiply_adds(self) -> int:
        self._fitted()
        trees = 0 if self._forest is None else self._forest.comparisons()
        return self._front_end.multiply_adds() + self._network.weights.multiply_adds() + trees

    def _set(self, parts: HybridParts) -> None:
        self.parts = parts
        self.design = parts.design
        self._front_end = FrontEndBlock(parts.front_end)
        self._network = Lstm(network_from_onnx(parts.network))
        self._forest: Forest | None = None if parts.forest is None else forest_from_onnx(parts.forest)

    def _fitted(self) -> HybridParts:
        self._refuse_unfitted()
        assert self.parts is not None
        return self.parts

    def _with_forest(self, train: Sequence[Recording], plan: ForestPlan) -> HybridParts:
        """Fit the forest on ``plan.rows`` usable rows: on the label (paper) or on what the LSTM leaves of it."""
        parts = self._fitted()
        inputs, targets = [], []
        for recording in train:
            features, base_n = self._front_end.advance(self._front_end.new_state(), recording.samples())
            hidden, head = self._network.advance(self._network.new_state(), features)
            target = (recording.column("friction_n") - base_n - parts.target_mean_n) / parts.target_scale_n
            left = target if parts.design == "paper" else target - head
            mask = recording.usable()
            inputs.append(forest_input(parts.design, hidden, head, features)[mask])
            targets.append(left[mask])
        rows, target = np.concatenate(inputs), np.concatenate(targets)
        count = min(plan.rows, len(rows))
        chosen = np.sort(np.random.default_rng(self.seed).choice(len(rows), count, replace=False))
        forest = fit_forest(rows[chosen], target[chosen], plan.trees, plan.depth, plan.leaf, self.seed)
        return HybridParts(
            parts.design, parts.front_end, parts.network, forest, parts.target_mean_n, parts.target_scale_n
        )

    def _write(self, folder: Path) -> dict[str, Any]:
        parts = self._fitted()
        (folder / NETWORK_FILE).write_bytes(parts.network.SerializeToString(deterministic=True))
        if parts.forest is not None:
            (folder / FOREST_FILE).write_bytes(parts.forest.SerializeToString(deterministic=True))
        return {
            "design": parts.design,
            "front_end": parts.front_end.to_dict(),
            "network": NETWORK_FILE,
            "forest": None if parts.forest is None else FOREST_FILE,
            "target_mean_n": parts.target_mean_n,
            "target_scale_n": parts.target_scale_n,
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        estimator = cls(design=parameters["design"])
        forest = None if parameters["forest"] is None else onnx.load(folder / parameters["forest"])
        estimator._set(
            HybridParts(
                parameters["design"],
                FrontEnd.from_dict(parameters["front_end"]),
                onnx.load(folder / parameters["network"]),
                forest,
                parameters["target_mean_n"],
                parameters["target_scale_n"],
            )
        )
        return estimator


def forest_input(design: Design, hidden: Any, head: Any, features: Any) -> Any:
    """Return what the forest sees, float32: the last hidden state; in ``force_balance`` head and features too."""
    if design == "paper":
        return hidden
    return np.concatenate([hidden, head[:, None], features], axis=1)


def _target_scaling(front_end: FrontEnd, recordings: Sequence[Recording]) -> tuple[float, float]:
    """Return mean and standard deviation [N] of what the network is to learn, over the usable rows."""
    block = FrontEndBlock(front_end)
    left = np.concatenate([_left(block, recording)[1][recording.usable()] for recording in recordings])
    return float(left.mean()), float(left.std()) or 1.0


def _left(block: FrontEndBlock, recording: Recording) -> tuple[Any, Array]:
    features, base_n = block.advance(block.new_state(), recording.samples())
    return features, recording.column("friction_n") - base_n


def _sequence(front_end: FrontEnd, recording: Recording, mean_n: float, scale_n: float) -> SequenceData:
    features, left = _left(FrontEndBlock(front_end), recording)
    return SequenceData(features, ((left - mean_n) / scale_n).astype(np.float32), recording.usable())

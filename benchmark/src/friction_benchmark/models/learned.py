"""What learned estimators share: features in, a correction of the force balance (or all of friction) out."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.front_end import FrontEnd, FrontEndBlock, FrontEndState, fit_front_end
from cylinder_friction.estimators.training_plan import SequenceData
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.recordings.recording import Recording

NETWORK_FILE = "network.onnx"


@dataclass
class LearnedState:
    """State of the features, and the model's own memory."""

    features: FrontEndState
    memory: Any


class LearnedEstimator(FrictionEstimator):
    """Features of any sensors into a model that learns, in standard deviations, what the force balance leaves.

    A subclass gives ``learn``, ``new_memory``, ``predict``, ``model_multiply_adds``, ``write_model``, ``read_model``
    and its own constructor, which passes these on.

    Args:
        cylinder: Its areas.
        inputs: Columns that it sees; ``position_m`` must be one; raw pressures come first.
        seed: Seeds everything random.
    """

    def __init__(self, cylinder: Cylinder, inputs: Sequence[str] = SAMPLE_COLUMNS, seed: int = 0) -> None:
        super().__init__(inputs)
        self.cylinder, self.seed = cylinder, seed
        self.target_mean_n, self.target_scale_n = 0.0, 1.0
        self.features: FrontEnd | None = None
        self._block: FrontEndBlock | None = None

    @abstractmethod
    def learn(self, train: Sequence[SequenceData]) -> None:
        """Learn the targets, in standard deviations, of one sequence per recording.

        Features are standardised float32, shape ``(n, len(self.features.names))``.
        """

    @abstractmethod
    def new_memory(self) -> Any:
        """Return the model's memory before the first sample; None where it has none."""

    @abstractmethod
    def predict(self, memory: Any, features: NDArray[np.float32]) -> NDArray[Any]:
        """Return the target, shape ``(n,)``, of the next ``n`` rows of features; changes ``memory``.

        Cutting the rows into pieces must not change one bit (a matrix product over many rows does: compute row by row).
        """

    @abstractmethod
    def model_multiply_adds(self) -> int:
        """Return the multiply-adds of one step of the model, features left out."""

    @abstractmethod
    def write_model(self, folder: Path) -> dict[str, Any]:
        """Write networks and forests as ONNX into ``folder``; returns the rest, constructor arguments too, as JSON."""

    @classmethod
    @abstractmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        """Return the estimator that ``write_model`` wrote; features and scaling are set by the caller."""

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from all recordings, to the end of the schedule, and return the estimator itself.

        Nothing is held out for early stopping: measured on other sessions, the sessions missed more than it brought.
        """
        self._begin_fit(recordings)
        self._set_features(fit_front_end("full", self.cylinder, recordings, self.inputs))
        pairs = [self._pair(recording) for recording in recordings]
        targets = np.concatenate(
            [left[recording.usable()] for (_, left), recording in zip(pairs, recordings, strict=True)]
        )
        self.target_mean_n, self.target_scale_n = float(targets.mean()), float(targets.std()) or 1.0
        self.learn([self._sequence(recording, *pair) for recording, pair in zip(recordings, pairs, strict=True)])
        return self

    def new_state(self) -> LearnedState:
        assert self._block is not None
        return LearnedState(self._block.new_state(), self.new_memory())

    def advance(self, state: LearnedState, samples: Array) -> Array:
        assert self._block is not None
        features, base_n = self._block.advance(state.features, samples)
        predicted = self.predict(state.memory, features)
        return np.asarray(base_n + self.target_mean_n + self.target_scale_n * predicted.astype(np.float64))

    def multiply_adds(self) -> int:
        assert self._block is not None
        return self._block.multiply_adds() + self.model_multiply_adds()

    def _set_features(self, features: FrontEnd) -> None:
        self.features, self._block = features, FrontEndBlock(features)

    def _pair(self, recording: Recording) -> tuple[NDArray[np.float32], Array]:
        """Return the features of a recording, and what the force balance leaves of its label [N]."""
        assert self._block is not None
        features, base_n = self._block.advance(self._block.new_state(), recording.samples(self.inputs))
        return features, recording.column("friction_n") - base_n

    def _sequence(self, recording: Recording, features: NDArray[np.float32], left: Array) -> SequenceData:
        target = ((left - self.target_mean_n) / self.target_scale_n).astype(np.float32)
        return SequenceData(features, target, recording.usable())

    def _write(self, folder: Path) -> dict[str, Any]:
        assert self.features is not None
        return {
            "cylinder": asdict(self.cylinder),
            "features": self.features.to_dict(),
            "target_mean_n": self.target_mean_n,
            "target_scale_n": self.target_scale_n,
            "model": self.write_model(folder),
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        features = FrontEnd.from_dict(parameters["features"])
        cylinder = Cylinder(**parameters["cylinder"])
        estimator = cls.read_model(folder, parameters["model"], cylinder, features.inputs)
        estimator._set_features(features)
        estimator.target_mean_n = parameters["target_mean_n"]
        estimator.target_scale_n = parameters["target_scale_n"]
        return estimator

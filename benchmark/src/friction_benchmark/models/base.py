"""What every model of the benchmark is: it fits labelled recordings and estimates friction."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.front_end import FrontEnd, fit_front_end
from cylinder_friction.estimators.training_plan import SequenceData
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.registry import BuildConfiguration, Estimator

Single = NDArray[np.float32]


class Model(Estimator):
    """A model that is fitted to labelled recordings and then estimates friction; ``position_m`` is among its inputs."""

    def __init__(self, inputs: Sequence[str] = SAMPLE_COLUMNS) -> None:
        self.inputs = tuple(inputs)
        if "position_m" not in self.inputs:
            raise ValueError(f"expected position_m among the inputs, but got {self.inputs}")


class FeatureModel(Model):
    """A model on the product's features of any sensors. It learns what the force balance misses, or all of friction.

    The force balance is there when both raw pressures are inputs. Features are standardised, and so is the target. A
    subclass gives ``learn``, ``predict`` and ``model_multiply_adds``.
    """

    features: FrontEnd  # Set by ``fit``

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build.inputs)
        self.build, self.cylinder, self.seed = build, build.cylinder, build.seed
        self.target_mean_n, self.target_scale_n = 0.0, 1.0

    @abstractmethod
    def learn(self, train: Sequence[SequenceData]) -> None:
        """Learn the targets, in standard deviations, of one sequence per recording."""

    @abstractmethod
    def predict(self, features: Single) -> NDArray[Any]:
        """Return the target at each row of a recording's features, shape ``(n,)``."""

    @abstractmethod
    def model_multiply_adds(self) -> int:
        """Return the multiply-adds of one sample, features left out."""

    def set_features(self, recordings: Sequence[Recording], inputs: Sequence[str]) -> None:
        """Choose the features of these inputs, and scale them by the recordings."""
        self.features = fit_front_end("full", self.cylinder, recordings, inputs)

    def features_of(self, recording: Recording) -> tuple[Single, Array]:
        """Return features, shape ``(n, k)``, and the force balance that is corrected [N], zero if there is none."""
        return self.features.run(recording.samples(self.features.inputs))

    def column(self, features: Single, name: str) -> Array:
        """Return one feature in its own unit, shape ``(n,)``."""
        place = self.features.names.index(name)
        return features[:, place].astype(np.float64) * self.features.scale[place] + self.features.mean[place]

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from all recordings, to the end of the schedule.

        Nothing is held out for early stopping. Measured on other sessions, missing those sessions costs more.
        """
        self.set_features(recordings, self.inputs)
        pairs = [self.features_of(recording) for recording in recordings]
        missed = [each.column("friction_n") - base_n for each, (_, base_n) in zip(recordings, pairs, strict=True)]
        masks = [recording.usable() for recording in recordings]
        targets = np.concatenate([each[mask] for each, mask in zip(missed, masks, strict=True)])
        self.target_mean_n, self.target_scale_n = float(targets.mean()), float(targets.std()) or 1.0
        self.learn(
            [
                SequenceData(features, ((each - self.target_mean_n) / self.target_scale_n).astype(np.float32), mask)
                for (features, _), each, mask in zip(pairs, missed, masks, strict=True)
            ]
        )
        return self

    def estimate(self, recording: Recording) -> Array:
        features, base_n = self.features_of(recording)
        predicted = self.predict(features).astype(np.float64)
        return np.asarray(base_n + self.target_mean_n + self.target_scale_n * predicted)

    def multiply_adds(self) -> int:
        return self.features.multiply_adds() + self.model_multiply_adds()

"""The protocol of everything that estimates friction from raw samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.realtime.bounds import calibrated_bounds, unknown_bounds, velocity_taps
from cylinder_friction.realtime.guard import TrainingRange, guard_from
from cylinder_friction.realtime.model import Bounds, Guard, StepModel, from_json
from cylinder_friction.realtime.stream import EstimatorStream, RealTimeStream, StrictStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.files import read_json, write_json
from cylinder_friction.recordings.recording import Recording, RecordingError, refuse_not_finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.arrays import Array


DESCRIPTION_FILE = "estimator.json"


class NotFittedError(RuntimeError):
    """An estimator was used before ``fit`` or ``load``."""


class FrictionEstimator(ABC):
    """Estimates friction from raw samples, without looking ahead.

    Input is the raw sample as the sensor gave it, in SI units: pressure 1 (piston side) [Pa, gauge], pressure 2
    (rod side) [Pa, gauge], position [m, extension positive]; an estimator for a rig with other sensors names them in
    ``inputs``. Filtering, differentiation and scaling happen inside, with state, so that training and serving cannot
    differ. Output is friction [N], positive when it opposes positive velocity.

    A subclass sets ``kind`` and gives ``fit``, ``new_state``, ``advance``, ``multiply_adds``, ``_write`` and ``_read``.
    ``estimate`` and ``stream`` both call ``advance``, so they cannot disagree. One that can run in real time, and in
    other runtimes, gives its ``step_model``.

    Attributes:
        kind: Name of the class in a saved model folder.
        shown: Names of the attributes that its representation shows.
        inputs: The columns of a recording that make up a sample, in this order.
        sample_time_s: Time between two samples that the estimator is made for [s]; None before ``fit``.
        training_range: Range of the raw samples that it was trained on; None before ``fit``.
        guard: What a sample must be in real time; None before ``calibrate``.
        bounds: The interval around the estimate that holds the label; None before ``calibrate``.
    """

    kind: ClassVar[str]
    shown: ClassVar[tuple[str, ...]] = ()
    _kinds: ClassVar[dict[str, type[FrictionEstimator]]] = {}

    def __init__(self, inputs: Sequence[str] = SAMPLE_COLUMNS) -> None:
        self.inputs = tuple(inputs)
        self.sample_time_s: float | None = None
        self.training_range: TrainingRange | None = None
        self.guard: Guard | None = None
        self.bounds: Bounds | None = None

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "kind" in cls.__dict__:
            FrictionEstimator._kinds[cls.kind] = cls

    def __repr__(self) -> str:
        settings = [f"{name}={getattr(self, name)!r}" for name in (*self.shown, "inputs")]
        state = "not fitted" if self.sample_time_s is None else f"fitted at {1.0 / self.sample_time_s:g} Hz"
        return f"<{type(self).__name__}({', '.join(settings)}), {state}>"

    @abstractmethod
    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from labelled recordings (columns ``friction_n`` and ``usable``) and return the estimator itself.

        An implementation calls ``_begin_fit`` first.
        """

    @abstractmethod
    def new_state(self) -> Any:
        """Return the state before the first sample."""

    @abstractmethod
    def advance(self, state: Any, samples: Array) -> Array:
        """Return friction [N], shape ``(n,)``, for the next ``n`` samples, shape ``(n, inputs)``; changes ``state``.

        Cutting the samples into pieces must not change one bit of the output.
        """

    @abstractmethod
    def multiply_adds(self) -> int:
        """Return the multiply-add operations of one step, the usual measure of a network's cost."""

    @abstractmethod
    def _write(self, folder: Path) -> dict[str, Any]:
        """Write what is not JSON into ``folder`` and return the rest as JSON content."""

    @classmethod
    @abstractmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        """Return the estimator that ``_write`` wrote."""

    def estimate(self, recording: Recording) -> Array:
        """Return friction [N], shape ``(n,)``, one value per sample, from a fresh state.

        Raises:
            RecordingError: The recording has another sample time, or a sample is NaN or infinite.
            NotFittedError: There is nothing fitted or loaded yet.
        """
        self._refuse_unfitted()
        if self.sample_time_s is None or not np.isclose(recording.sample_time_s, self.sample_time_s, rtol=1e-6):
            raise RecordingError(
                f"recording {recording.name!r}: sample time is {recording.sample_time_s} s, but this estimator was "
                f"trained at {self.sample_time_s} s; resample the recording or train at its rate"
            )
        samples = recording.samples(self.inputs)
        refuse_not_finite(f"recording {recording.name!r}", samples, self.inputs)
        return self.advance(self.new_state(), samples)

    def stream(self) -> EstimatorStream | StrictStream:
        """Return a fresh stream; streams of one estimator do not touch each other."""
        self._refuse_unfitted()
        return EstimatorStream(self.new_state, self.advance, self.inputs)

    def step_model(self) -> StepModel:
        """Return what one real-time step needs: the description from which every runtime is made.

        Raises:
            NotFittedError: There is nothing fitted or loaded yet.
            ValueError: This kind of estimator has no such step.
        """
        raise ValueError(f"{self.kind}: has no real-time step; expected a hybrid, forest, force balance or ridge")

    def real_time(self) -> RealTimeStream:
        """Return a fresh guarded stream, which takes whatever the sensors give; see ``RealTimeStream``."""
        return RealTimeStream(self.step_model())

    def calibrate(self, largest_friction_n: float, validation: Sequence[Recording]) -> None:
        """Set guard and bounds, the latter from the errors on recordings that the estimator did not learn from.

        Args:
            largest_friction_n: Largest absolute label of training [N].
            validation: Labelled recordings of other sessions.
        """
        self._refuse_unfitted()
        assert self.training_range is not None
        assert self.sample_time_s is not None
        self.guard = guard_from(self.training_range, largest_friction_n, self.sample_time_s)
        estimates_n = [self.estimate(recording) for recording in validation]
        self.bounds = calibrated_bounds(validation, estimates_n, self.sample_time_s, self.guard.warm_up_samples)

    def save(self, folder: str | Path) -> None:
        """Write the estimator into ``folder``: JSON for parameters, ONNX for networks and forests, no pickle."""
        self._refuse_unfitted()
        assert self.training_range is not None
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        parameters = self._write(folder)
        write_json(
            folder / DESCRIPTION_FILE,
            {
                "kind": self.kind,
                "sample_time_s": self.sample_time_s,
                "input": list(self.inputs),
                "output": "friction_n",
                "training_range": {
                    column: [lower, upper]
                    for column, lower, upper in zip(
                        self.inputs, self.training_range.lower, self.training_range.upper, strict=True
                    )
                },
                "guard": None if self.guard is None else asdict(self.guard),
                "bounds": None if self.bounds is None else asdict(self.bounds),
                "multiply_adds_a_step": self.multiply_adds(),
                "parameters": parameters,
            },
        )

    @classmethod
    def load(cls, folder: str | Path) -> FrictionEstimator:
        """Return the estimator saved in ``folder``, of whichever kind it is.

        Raises:
            FileNotFoundError: The folder holds no saved estimator.
            ValueError: The kind is not known.
        """
        folder = Path(folder)
        path = folder / DESCRIPTION_FILE
        if not path.is_file():
            raise FileNotFoundError(f"{folder}: holds no {DESCRIPTION_FILE}; expected a folder that `save` wrote")
        description = read_json(path)
        known = FrictionEstimator._kinds
        if description["kind"] not in known:
            raise ValueError(f"{path}: kind is {description['kind']!r}, but expected one of {sorted(known)}")
        estimator = known[description["kind"]]._read(folder, description["parameters"])
        estimator.inputs = tuple(description["input"])
        limits = [description["training_range"][column] for column in estimator.inputs]
        estimator.sample_time_s = description["sample_time_s"]
        estimator.training_range = TrainingRange(
            estimator.inputs, tuple(low for low, _ in limits), tuple(high for _, high in limits)
        )
        estimator.guard = from_json(Guard, description.get("guard"))
        estimator.bounds = from_json(Bounds, description.get("bounds"))
        return estimator

    def _begin_fit(self, recordings: Sequence[Recording]) -> None:
        """Check the recordings and note their sample time and range.

        Raises:
            RecordingError: There is no recording, or they do not share one sample time.
        """
        if not recordings:
            raise RecordingError(f"{self.kind}: nothing to fit on, got no recording; expected at least one")
        sample_times = sorted({recording.sample_time_s for recording in recordings})
        if not np.allclose(sample_times, sample_times[0], rtol=1e-6):
            raise RecordingError(
                f"{self.kind}: recordings have different sample times {sample_times} s; expected one; resample them"
            )
        self.sample_time_s = sample_times[0]
        self.training_range = TrainingRange.of(recordings, self.inputs)

    def _step_model(self, **fields: Any) -> StepModel:
        """Return a step model with these fields; the others are those of a step without features, network and forest.

        Guard and bounds are the estimator's own; without them a guard from its training range, which cannot notice a
        frozen position, and bounds so wide that they state nothing.
        """
        self._refuse_unfitted()
        assert self.sample_time_s is not None
        assert self.training_range is not None
        none = np.zeros(0)
        defaults: dict[str, Any] = {
            "feature_taps": np.zeros((0, len(self.inputs), 1)),
            **dict.fromkeys(("feature_limits", "feature_mean", "feature_scale"), none),
            "network": None,
            "forest": None,
            "forest_sees": "nothing",
            "head_counts": False,
            "target_mean_n": 0.0,
            "target_scale_n": 1.0,
        }
        return StepModel(
            **defaults | fields,
            sample_time_s=self.sample_time_s,
            velocity_taps=velocity_taps(self.sample_time_s, self.inputs),
            guard=self.guard or guard_from(self.training_range, np.inf, self.sample_time_s),
            bounds=self.bounds or unknown_bounds(self.sample_time_s),
            inputs=self.inputs,
        )

    def _refuse_unfitted(self) -> None:
        if self.sample_time_s is None or self.training_range is None:
            raise NotFittedError(f"{self.kind}: not fitted yet; call fit or load first")

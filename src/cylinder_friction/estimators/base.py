"""The protocol of everything that estimates friction from raw samples."""

from __future__ import annotations

import copy
import json
import math
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.entry_points import GROUP, own_class, own_kinds
from cylinder_friction.estimators.saved_folder import (
    CONTENT_HASH,
    DESCRIPTION_FILE,
    SavedModelError,
    read_description,
    write_description,
)
from cylinder_friction.realtime.bounds import (
    LearnedOffset,
    causal_velocity,
    unknown_bounds,
    velocity_taps,
    without_line_loss,
)
from cylinder_friction.realtime.bounds_by_noise import NoiseBounds, calibrated_by_noise, level_for
from cylinder_friction.realtime.checking import check_step_model, check_timing
from cylinder_friction.realtime.guard import TrainingRange, freeze_travel_m, guard_from, largest_friction_n
from cylinder_friction.realtime.model import Bounds, Guard, StepModel, applied, from_json
from cylinder_friction.realtime.position_load import PositionLoad, channel_names
from cylinder_friction.realtime.sensor_offset import BALANCE, OffsetTracker
from cylinder_friction.realtime.stream import NO_OFFSET, EstimatorStream, RealTimeStream, StrictStream
from cylinder_friction.realtime.trained_for import TrainedFor, pressure_noise_pa
from cylinder_friction.realtime.unmodelled_force import with_force_limits
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, POSITION, PRESSURES, SAMPLE_COLUMNS
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.recording import Recording, RecordingError, refuse_not_finite


class NotFittedError(RuntimeError):
    """An estimator was used before ``fit`` or ``load``.

    Every method that needs what training finds raises it: ``estimate``, ``stream``, ``step_model``, ``save`` and the
    exports. Call ``fit`` on labelled recordings, or load a saved estimator by ``cf.load``.
    """


class FrictionEstimator(ABC):
    """Estimates friction from raw samples, without looking ahead.

    Input is the raw sample in SI units: pressure 1 (piston side) [Pa, gauge], pressure 2 (rod side) [Pa, gauge],
    position [m, extension positive]; an estimator for a rig with other sensors names them in ``inputs``. ``estimate``
    and ``stream`` take a recording's columns, to which ingest has applied the mapping's signs and offsets.
    ``real_time`` and every export take readings as the sensors give them, and apply ``corrections`` first. Filtering,
    differentiation and scaling happen inside, with state, so that training and serving cannot differ. Output is
    friction [N], positive when it opposes positive velocity.

    A subclass sets ``kind`` and gives ``fit``, ``multiply_adds``, ``_write`` and ``_read``. It also gives
    ``step_model``, and can then run in real time and be exported to other runtimes, or ``new_state`` and ``advance``,
    or all three. ``estimate`` and ``stream`` both call ``advance``, so they cannot disagree.

    Attributes:
        kind: Name of the class in a saved model folder.
        shown: Names of the attributes in ``repr``.
        balances_forces: Whether pressures or a drive force enter its estimate as forces, which a load adds to.
        files: Names of the files that ``save`` writes beside its description.
        inputs: The columns of a recording that make up a sample, in this order.
        sample_time_s: Time between two samples that the estimator is made for [s]; None before ``fit``.
        training_range: Range of the raw training samples; None before ``fit``.
        guard: Limits that a sample must meet in real time; None before ``calibrate``.
        bounds: The interval around the estimate that holds friction or its label; None before ``calibrate``.
        bounds_by_noise: Bounds for each level of noise, the quietest first, if calibration sessions differ in noise.
        lag_s: Delay of the estimate [s]: a step gives the friction of ``lag_s`` before its sample, and is surer the
            longer it waits. ``estimate`` shifts the result back to the moment that it describes.
        offset: Tracker that learns the offset of the sensors' zeros while running, see ``labelling.offset_tracker``;
            None: no offset is learned. Training sees samples without their identified zeros.
        position_load: The load as a function of position, subtracted as if a load cell had measured it; None: a load
            is among the inputs, or there is none. Set before ``fit``.
        corrections: Sign and offset that the mapping of the training recordings states for an input; inputs with
            neither are left out.
        line_loss: Loss of lines between pressure sensors and chambers that the same mapping states. A step subtracts it
            at the causal velocity; a kind without a step leaves it in the pressures.

    Example:
        >>> hybrid.inputs, hybrid.sample_time_s
        (('pressure_1_pa', 'pressure_2_pa', 'position_m'), 0.005)
        >>> friction_n = hybrid.estimate(test[0])
        >>> friction_n.shape == (len(test[0]),)
        True
        >>> stream = hybrid.real_time()  # as in a control loop: newtons with bounds, and flags
        >>> newtons, flags = stream.run(test[0].samples())
        >>> newtons.shape == (len(test[0]), 3)
        True
    """

    kind: ClassVar[str]
    shown: ClassVar[tuple[str, ...]] = ()
    balances_forces: ClassVar[bool] = True
    files: tuple[str, ...] = ()
    _kinds: ClassVar[dict[str, type[FrictionEstimator]]] = {}

    def __init__(self, inputs: Sequence[str] = SAMPLE_COLUMNS, lag_s: float = 0.0) -> None:
        if not 0.0 <= lag_s < math.inf:
            raise ValueError(f"lag_s must be zero or a positive number of seconds, but got {lag_s!r}")
        self.inputs = tuple(inputs)
        self.lag_s = lag_s
        self.sample_time_s: float | None = None
        self.training_range: TrainingRange | None = None
        self.guard: Guard | None = None
        self.bounds: Bounds | None = None
        self.bounds_by_noise: tuple[NoiseBounds, ...] = ()
        self.trained_for: TrainedFor | None = None
        self.offset: OffsetTracker | None = None
        self.position_load: PositionLoad | None = None
        self.corrections: dict[str, ChannelCorrection] = {}
        self.line_loss: dict[str, LineLoss] = {}

    @property
    def channels(self) -> tuple[str, ...]:
        """The inputs of the filters: the sample's columns, and a load that position decides."""
        return channel_names(self.inputs, self.position_load)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "kind" in cls.__dict__:
            known = FrictionEstimator._kinds.get(cls.kind)
            if known is not None and _is_ours(known) and not _is_ours(cls):
                raise ValueError(f"{cls.__name__}: its kind {cls.kind!r} is that of {known.__name__}; choose another")
            FrictionEstimator._kinds[cls.kind] = cls

    def __repr__(self) -> str:
        settings = [f"{name}={getattr(self, name)!r}" for name in (*self.shown, "inputs")]
        state = "not fitted" if self.sample_time_s is None else f"fitted at {1.0 / self.sample_time_s:g} Hz"
        return f"<{type(self).__name__}({', '.join(settings)}), {state}>"

    @abstractmethod
    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from labelled recordings (columns ``friction_n`` and ``usable``) and return the estimator itself.

        An implementation learns from what ``_begin_fit`` returns.
        """

    def new_state(self) -> Any:
        """Return the state before the first sample."""
        return StrictStream(replace(self.step_model(), offset=None, line_loss={}))

    def advance(self, state: Any, samples: Array) -> Array:
        """Estimate friction [N], shape ``(n,)``, for the next samples, shape ``(n, channels)``; updates ``state``.

        Pressures are those in the chambers, without the loss of lines. Cutting the samples into pieces must not change
        one bit of the output. The result still contains the sensors' offset; ``estimate`` and ``stream`` learn it and
        subtract it.
        """
        newtons, _ = state.run(samples[:, : len(self.inputs)])
        return np.ascontiguousarray(newtons[:, 0])

    @abstractmethod
    def multiply_adds(self) -> int:
        """Count the multiply-add operations of one step, the usual measure of a network's cost."""

    @abstractmethod
    def _write(self, folder: Path) -> dict[str, Any]:
        """Write what is not JSON into ``folder`` and return the rest as JSON content."""

    @classmethod
    @abstractmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        """Rebuild the estimator that ``_write`` wrote."""

    def estimate(self, recording: Recording, offset_n: float = 0.0, offset_uncertainty_n: float | None = None) -> Array:
        """Estimate friction [N] at each sample of a recording, from a fresh state; shape ``(n,)``.

        With a lag, the last rows would need samples after the recording's end, so they repeat the last estimate.

        Args:
            recording: At the sample time of training.
            offset_n: Offset of the sensors' zeros in friction to start from, if the estimator learns one [N].
            offset_uncertainty_n: Its standard uncertainty [N]; None: that of the stated zeros.

        Raises:
            RecordingError: The recording has another sample time, or a sample is NaN or infinite.
            NotFittedError: The estimator is neither fitted nor loaded.
            ValueError: An offset is given, but this estimator learns none; or a number is impossible.
        """
        return self.aligned(self._stepped(recording, offset_n, offset_uncertainty_n))

    def with_position_load(self, load: PositionLoad) -> Self:
        """Copy this fitted estimator for another position-dependent load, such as another weight or crane angle.

        Raises:
            ValueError: It was not fitted with a load that position decides.
        """
        if self.position_load is None or self.training_range is None:
            raise ValueError(
                f"{self.kind}: knows no load that position decides, so that none can take its place; "
                "fit it with position_load"
            )
        other = copy.copy(self)
        other.position_load = load
        if self.guard is not None:
            trained = self.training_range.trusted(load)
            other.guard = replace(self.guard, trained_lower=trained.lower, trained_upper=trained.upper)
        return other

    def with_bounds_for(self, recordings: Sequence[Recording]) -> Self:
        """Copy this fitted estimator with bounds for the recordings' noise: wider if they are noisier."""
        noise_pa = pressure_noise_pa(recordings)
        level = self.noise_level(noise_pa)
        if self.trained_for is None or level is None:
            return self
        level, other = level.widened(noise_pa), copy.copy(self)
        other.bounds, other.trained_for = level.bounds, replace(self.trained_for, pressure_noise_pa=level.noise_pa)
        return other

    def noise_level(self, noise_pa: float) -> NoiseBounds | None:
        """Choose the bounds of the quietest calibration sessions that are at least as noisy, else of the noisiest.

        None if no session's noise is known. ``noise_pa`` comes from ``pressure_noise_pa``.
        """
        if self.trained_for is None or self.bounds is None:
            return None
        own = NoiseBounds(self.trained_for.pressure_noise_pa, (), self.bounds)
        return level_for(self.bounds_by_noise if noise_pa > 0.0 else (), noise_pa) or own

    def aligned(self, stepped: Array) -> Array:
        """Shift the output of steps, shape ``(n, ...)``, back by the lag; the last rows repeat the last output."""
        after = np.minimum(np.arange(len(stepped)) + self.lag_samples, len(stepped) - 1)
        return stepped[after] if self.lag_samples else stepped

    @property
    def lag_samples(self) -> int:
        """The lag in samples; 0 before ``fit``."""
        return 0 if self.sample_time_s is None else round(self.lag_s / self.sample_time_s)

    def _stepped(self, recording: Recording, offset_n: float = 0.0, offset_uncertainty_n: float | None = None) -> Array:
        """Run the step on each sample; its output [N], shape ``(n,)``, is the friction of ``lag_s`` before it."""
        self._refuse_unfitted()
        if self.sample_time_s is None or not np.isclose(recording.sample_time_s, self.sample_time_s, rtol=1e-6):
            raise RecordingError(
                f"recording {recording.name!r}: sample time is {recording.sample_time_s} s, but this estimator was "
                f"trained at {self.sample_time_s} s; resample the recording or train at its rate"
            )
        samples = recording.samples(self.inputs)
        refuse_not_finite(f"recording {recording.name!r}", samples, self.inputs)
        if self._needs_its_step:
            stream = StrictStream(self.step_model())
            stream.reset(offset_n, offset_uncertainty_n)
            return np.ascontiguousarray(stream.run(samples)[0][:, 0])
        if offset_n != 0.0 or offset_uncertainty_n is not None:
            raise ValueError(NO_OFFSET)
        return self.advance(self.new_state(), self.channels_of(samples))

    def channels_of(self, samples: Array) -> Array:
        """Turn samples, shape ``(n, inputs)``, into the filters' channels, ``(n, channels)``."""
        if self.position_load is None:
            return samples
        places = [self.inputs.index(column) for column in self.position_load.columns]
        return np.column_stack([samples, self.position_load.at(samples[:, places])])

    def stream(self) -> EstimatorStream | StrictStream:
        """Start a stream over a recording's samples from a fresh state; streams of one estimator are independent."""
        self._refuse_unfitted()
        if self._needs_its_step or type(self).advance is FrictionEstimator.advance:
            return StrictStream(self.step_model())
        return EstimatorStream(
            self.new_state, lambda state, samples: self.advance(state, self.channels_of(samples)), self.inputs
        )

    @property
    def _needs_its_step(self) -> bool:
        """Whether ``advance`` alone is not enough: the step also learns an offset, or subtracts the loss of lines."""
        return self.offset is not None or bool(self.line_loss)

    @property
    def has_step(self) -> bool:
        """Whether its kind has a real-time step."""
        return type(self).step_model is not FrictionEstimator.step_model

    def step_model(self) -> StepModel:
        """Describe one real-time step; every runtime (Python, C, FMU, served model) is made from this description.

        It takes readings as the sensors give them; ``step_model().for_recordings()`` takes a recording's columns.

        Raises:
            NotFittedError: The estimator is neither fitted nor loaded.
            ValueError: This kind of estimator has no such step.
        """
        raise ValueError(f"{self.kind}: has no real-time step; expected a hybrid, forest, force balance or ridge")

    def real_time(self) -> RealTimeStream:
        """Start a guarded stream of sensor readings, which flags bad ones; see ``RealTimeStream``."""
        return RealTimeStream(self.step_model())

    def calibrate(
        self,
        train: Sequence[Recording],
        validation: Sequence[Recording],
        cylinder: Cylinder | None = None,
        estimates_n: Sequence[Array] | None = None,
    ) -> None:
        """Set guard and bounds, the latter from the errors on recordings that the estimator did not learn from.

        Args:
            train: Labelled recordings of training, as measured, for the guard.
            cylinder: The recordings' cylinder; None: no force counts as unmodelled, and the model does not know which
                cylinder it fits.
            validation: Labelled recordings of other sessions, their pressures as measured.
            estimates_n: Stepped estimates [N] for ``validation`` by models that did not learn from it; None: this
                estimator did not learn from it, and makes them.
        """
        self._refuse_unfitted()
        assert self.training_range is not None
        assert self.sample_time_s is not None
        limits = largest_friction_n(train), self.sample_time_s, self.position_load, freeze_travel_m(train)
        self.guard = guard_from(self.training_range, *limits)
        # estimates and labels both late by the lag, because bounds depend on the present regime of motion
        lagged = [recording.lagged(self.lag_samples) for recording in validation]
        if estimates_n is None:
            estimates_n = [self._stepped(recording) for recording in validation]
        offsets = None if self.offset is None else [self._learned_offset(each) for each in validation]
        known = calibrated_by_noise(lagged, estimates_n, self.sample_time_s, self.guard.warm_up_samples, offsets)
        self.bounds_by_noise = tuple(known) if len(known) > 1 else ()
        level = level_for(known, pressure_noise_pa(validation)) or known[-1]
        self.bounds, own = level.bounds, [each for each in validation if each.metadata.session in level.sessions]
        self.trained_for = None if cylinder is None else TrainedFor.of(train, cylinder).calibrated_on(own)
        if cylinder is not None:
            own = [self._in_channels(each) for each in train]
            self.guard = with_force_limits(self.guard, self.bounds, cylinder, own, self.channels)

    def save(self, folder: str | Path) -> None:
        """Write the estimator into ``folder``: JSON for parameters, ONNX for networks and forests, no pickle."""
        self._refuse_unfitted()
        assert self.training_range is not None
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        parameters = self._write(folder)
        write_description(
            folder,
            {
                "kind": self.kind,
                **self._defined_in(),
                "sample_time_s": self.sample_time_s,
                "input": list(self.inputs),
                "output": "friction_n",
                "lag_s": self.lag_s,
                "training_range": {
                    column: [lower, upper]
                    for column, lower, upper in zip(
                        self.inputs, self.training_range.lower, self.training_range.upper, strict=True
                    )
                },
                "guard": None if self.guard is None else asdict(self.guard),
                "bounds": None if self.bounds is None else asdict(self.bounds),
                "trained_for": None if self.trained_for is None else self.trained_for.to_dict(),
                **({"bounds_by_noise": list(map(asdict, self.bounds_by_noise))} if self.bounds_by_noise else {}),
                "offset": None if self.offset is None else self.offset.to_dict(),
                "position_load": None if self.position_load is None else self.position_load.to_dict(),
                "corrections": {column: asdict(each) for column, each in self.corrections.items()},
                "line_loss": {column: asdict(line) for column, line in self.line_loss.items()},
                "multiply_adds_a_step": self.multiply_adds(),
                "parameters": parameters,
            },
            self.files,
        )

    def _defined_in(self) -> dict[str, str]:
        """Return what states the class of an estimator that is not of this package."""
        cls = type(self)
        return {} if _is_ours(cls) else {"defined_in": f"{cls.__module__}.{cls.__qualname__}"}

    def saved_hash(self) -> str:
        """Return the hash that ``save`` writes into the description as ``sha256``: it covers every file."""
        with tempfile.TemporaryDirectory() as folder:
            self.save(folder)
            return str(json.loads((Path(folder) / DESCRIPTION_FILE).read_text(encoding="utf-8"))[CONTENT_HASH])

    @classmethod
    def load(cls, folder: str | Path) -> FrictionEstimator:
        """Load the estimator saved in a folder, of any known kind; hashes of all its files are checked.

        Raises:
            FileNotFoundError: The folder holds no saved estimator.
            SavedModelError: The folder is damaged, or holds what no runtime would take.
        """
        folder = Path(folder)
        description = read_description(folder)
        try:
            estimator = cls._from_description(folder, description)
            step = estimator._checked_step()
            for bounds in (step.bounds, *(each.bounds for each in estimator.bounds_by_noise)):
                check_step_model(replace(step, bounds=bounds))
        except SavedModelError:
            raise
        except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError) as error:
            why = f"has no {error}" if isinstance(error, KeyError) else str(error)
            raise SavedModelError(f"{folder / DESCRIPTION_FILE}: {why}; save the model again") from error
        return estimator

    @classmethod
    def _from_description(cls, folder: Path, description: dict[str, Any]) -> FrictionEstimator:
        if not {"corrections", "line_loss"} <= description.keys():
            raise SavedModelError(
                f"{folder / DESCRIPTION_FILE}: was saved by an earlier version, which did not state what its step "
                "subtracts from the sensors' readings; train or adapt the model anew"
            )
        known, kind = FrictionEstimator._kinds, description["kind"]
        if kind not in known and kind in own_kinds():
            own_class(own_kinds()[kind])  # importing it makes it known
        if kind not in known:
            where = description.get("defined_in")
            more = f"; it is {where}: import that module first" if isinstance(where, str) else ""
            raise ValueError(
                f"kind is {kind!r}, but expected one of {sorted(known)}{more}; a package can register its kinds as "
                f"entry points of the group {GROUP}"
            )
        sample_time_s, lag_s = description["sample_time_s"], description.get("lag_s", 0.0)
        check_timing(sample_time_s, lag_s)
        estimator = known[kind]._read(folder, description["parameters"])
        estimator.inputs = tuple(description["input"])
        limits = [description["training_range"][column] for column in estimator.inputs]
        estimator.sample_time_s, estimator.lag_s = sample_time_s, lag_s
        estimator.training_range = TrainingRange(
            estimator.inputs, tuple(low for low, _ in limits), tuple(high for _, high in limits)
        )
        estimator.guard = from_json(Guard, description.get("guard"))
        estimator.bounds = from_json(Bounds, description.get("bounds"))
        estimator.bounds_by_noise = tuple(map(NoiseBounds.from_dict, description.get("bounds_by_noise", ())))
        estimator.trained_for = TrainedFor.from_dict(description.get("trained_for"))
        tracker = description.get("offset")
        estimator.offset = None if tracker is None else OffsetTracker.from_dict(tracker)
        load = description.get("position_load")
        estimator.position_load = None if load is None else PositionLoad.from_dict(load)
        stated, lines = description["corrections"], description["line_loss"]
        estimator.corrections = {column: ChannelCorrection(**stated[column]) for column in stated}
        estimator.line_loss = {column: LineLoss(**lines[column]) for column in lines}
        return estimator

    def _checked_step(self) -> StepModel:
        """Build the step model that ``load`` checks; for a kind without a step, one with guard and bounds alone."""
        if self.has_step:
            return self.step_model()
        return self._step_model(base_taps=np.zeros((len(self.channels), 1)))

    def _begin_fit(self, recordings: Sequence[Recording]) -> list[Recording]:
        """Check the recordings, store their sample time and range, and subtract their identified zeros.

        Raises:
            RecordingError: There is no recording, they do not share one sample time, or their labels subtracted a load
                that this estimator would not know.
        """
        if not recordings:
            raise RecordingError(f"{self.kind}: nothing to fit on, got no recording; expected at least one")
        sample_times = sorted({recording.sample_time_s for recording in recordings})
        if not np.allclose(sample_times, sample_times[0], rtol=1e-6):
            raise RecordingError(
                f"{self.kind}: recordings have different sample times {sample_times} s; expected one; resample them"
            )
        loaded = next((each.name for each in recordings if LOAD_FORCE in each.columns), "")
        forces = self.balances_forces and not {*PRESSURES, DRIVE_FORCE}.isdisjoint(self.inputs)
        if loaded and forces and LOAD_FORCE not in self.channels:
            raise RecordingError(
                f"{self.kind}: the label of recording {loaded!r} subtracted a load ({LOAD_FORCE}), which these "
                f"inputs do not show; give inputs={(*self.inputs, LOAD_FORCE)} if the load is known in use too, or, if "
                "position decides it, set position_load to cf.position_load(recordings, cylinder)"
            )
        self.sample_time_s = sample_times[0]
        self.training_range = TrainingRange.of(recordings, self.inputs)
        self.corrections, self.line_loss = self._mapping_of(recordings)
        return [self._training_recording(recording) for recording in recordings]

    def _mapping_of(self, recordings: Sequence[Recording]) -> tuple[dict[str, ChannelCorrection], dict[str, LineLoss]]:
        """Read the sign, offset and loss of lines that all recordings' mappings state alike, by input."""
        stated: list[tuple[dict[str, ChannelCorrection], dict[str, LineLoss]]] = []
        for who in (each.metadata for each in recordings):
            corrections = {name: who.corrections[name] for name in self.inputs if name in who.corrections}
            lines = {name: who.line_loss[name] for name in self.inputs if name in who.line_loss and self.has_step}
            stated.append((corrections, {name: line for name, line in lines.items() if any(line.terms())}))
        other = next((each for each in stated if each != stated[0]), stated[0])
        if other != stated[0]:
            pair = [", ".join(applied(self.inputs, *each)) or "neither sign nor offset" for each in (stated[0], other)]
            raise RecordingError(
                f"{self.kind}: the recordings' mappings disagree: {pair[0]}; {pair[1]}; expected the same sign, offset "
                "and line loss of a channel in all, because a real-time step applies them; train on recordings of one "
                "mapping"
            )
        return stated[0]

    def _training_recording(self, recording: Recording) -> Recording:
        """Prepare a recording for training: its filters' channels, without its zeros."""
        return self._in_channels(recording).zeroed().lagged(self.lag_samples)

    def _in_channels(self, recording: Recording) -> Recording:
        """Make a recording of the filters' channels: pressures in the chambers, and the load that position decides."""
        return without_line_loss(self._with_load(recording), self.line_loss)

    def _with_load(self, recording: Recording) -> Recording:
        """Add the load that position decides, if one is known."""
        if self.position_load is None:
            return recording
        return recording.with_columns(**{LOAD_FORCE: self.position_load.of(recording)})

    def _copy_fitted(self, other: FrictionEstimator) -> None:
        """Copy the samples' range, guard, sensor offset, load and lag from another fitted estimator."""
        self.inputs, self.sample_time_s, self.training_range = other.inputs, other.sample_time_s, other.training_range
        self.guard, self.offset, self.position_load, self.lag_s = (
            other.guard,
            other.offset,
            other.position_load,
            other.lag_s,
        )
        self.corrections, self.line_loss = other.corrections, other.line_loss

    def _step_model(self, **fields: Any) -> StepModel:
        """Build a step model from these fields; the others default to no features, network and forest.

        Guard and bounds are the estimator's own. Before ``calibrate``, the guard comes from the training range and
        cannot notice a frozen position, and the bounds are so wide that they state nothing.
        """
        self._refuse_unfitted()
        assert self.sample_time_s is not None
        assert self.training_range is not None
        none = np.zeros(0)
        guard = self.guard or guard_from(self.training_range, np.inf, self.sample_time_s, self.position_load)
        defaults: dict[str, Any] = {
            "feature_taps": np.zeros((0, len(self.channels), 1)),
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
            velocity_taps=velocity_taps(self.sample_time_s, self.channels),
            # without bounds the velocity of sliding is unknown
            guard=replace(guard, force_weights=()) if self.bounds is None else guard,
            bounds=self.bounds or unknown_bounds(self.sample_time_s),
            inputs=self.inputs,
            offset=self.offset,
            position_load=self.position_load,
            lag_s=self.lag_samples * self.sample_time_s,
            trained_for=self.trained_for,
            corrections=self.corrections,
            line_loss=self.line_loss,
        )

    def _learned_offset(self, recording: Recording) -> LearnedOffset:
        """Learn the offset from a cold start, as a step would; an offset common to all sessions is in the label too."""
        assert self.offset is not None
        place, state = self.inputs.index(POSITION), self.offset.new_state()
        channels = self._in_channels(recording).samples(self.channels)
        found = self.offset.rows(channels, causal_velocity(recording), place, state)
        zeros = recording.metadata.identified_zero
        weights = dict(zip(self.channels, self.offset.weights[BALANCE], strict=True))
        label_n = math.hypot(*(weights[column] * zero.uncertainty for column, zero in zeros.items()))
        return LearnedOffset(np.sqrt(np.maximum(found[:, 1] ** 2 - self.offset.settings.common_n**2, 0.0)), label_n)

    def _refuse_unfitted(self) -> None:
        if self.sample_time_s is None or self.training_range is None:
            raise NotFittedError(f"{self.kind}: not fitted yet; call fit or load first")


def _is_ours(cls: type) -> bool:
    return cls.__module__.startswith("cylinder_friction.")

"""Any analytical friction model as an estimator: causal velocity from raw position, then the model."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.friction_models.catalogue import model_named
from cylinder_friction.friction_models.identification.intervals import INTERVAL_METHOD
from cylinder_friction.friction_models.identification.procedure import Identification, SearchEffort, identify
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import ModelParameters
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.signals.causal_velocity import CausalVelocity, VelocityBlock, VelocityState

VELOCITY_FILTERS = ((11, 1), (15, 1), (21, 1), (31, 2))
"""Candidate one-sided Savitzky-Golay differentiators: window in samples, and order."""

BACKLASHES_M = (0.0, 8e-5)
"""Candidate half-widths of the backlash operator [m]: none, and about six times a smoothed potentiometer's noise."""

PRESSURE_PAIRS = (("pressure_1_pa", "pressure_2_pa"), ("pressure_1_level_pa", "pressure_2_level_pa"))
"""Pairs of columns whose sum scales dry friction, the better pair first: raw pressures, or their slow level."""


@dataclass
class AnalyticalState:
    """The states of the velocity filter and of the friction model."""

    motion: VelocityState
    friction: Array


class AnalyticalEstimator(FrictionEstimator):
    """A friction model identified from labelled recordings. At run time it reads position, and pressures if needed.

    Args:
        cylinder: For the moving mass.
        model: The friction model that is identified.
        inputs: Columns of a sample; ``position_m`` must be one, and a pair of pressures for a model scaled by them.
        condition: The ``metadata.condition`` of the recordings that it is identified on; None for all.
        effort: Generations, population and simulations of the search.
        velocity_dead_band_m_s: Velocity below which the piston stands, if no backlash operator decides [m/s].
        damping_ratio: Damping ratio of the moving mass on the bristles.
        confidence: Probability of the confidence intervals.

    Attributes:
        parameters: The model's parameters; None before ``fit``.
        intervals: Confidence interval of every identified parameter.
        causal_velocity: The filter from position to velocity; None before ``fit``.
        identification: The whole result of ``fit``; None for a loaded estimator.

    Raises:
        ValueError: ``inputs`` lack the position, or pressures that the model needs.
    """

    kind: ClassVar[str] = "analytical"
    shown: ClassVar[tuple[str, ...]] = ("model",)
    balances_forces: ClassVar[bool] = False

    def __init__(
        self,
        cylinder: Cylinder,
        model: FrictionModel,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        condition: str | None = None,
        effort: SearchEffort | None = None,
        velocity_dead_band_m_s: float = 1e-3,
        damping_ratio: float = 0.5,
        confidence: float = 0.95,
    ) -> None:
        super().__init__(inputs)
        self.cylinder, self.model, self.condition = cylinder, model, condition
        self.effort = scaled_effort(1.0) if effort is None else effort
        self.velocity_dead_band_m_s = velocity_dead_band_m_s
        self.damping_ratio = damping_ratio
        self.confidence = confidence
        self.parameters: ModelParameters | None = None
        self.intervals: dict[str, tuple[float, float]] = {}
        self.causal_velocity: CausalVelocity | None = None
        self.identification: Identification | None = None
        self._position, self._pressures = _columns_of(model, self.inputs)
        self._motion: VelocityBlock | None = None
        self._values = np.zeros(0)

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Identify the model on the recordings of its condition, and ignore the others.

        Raises:
            RecordingError: There is no recording of that condition.
        """
        chosen = [recording for recording in recordings if self.condition in (None, recording.metadata.condition)]
        if recordings and not chosen:
            raise RecordingError(
                f"{self.kind}: no recording of condition {self.condition!r}; got conditions "
                f"{sorted({recording.metadata.condition for recording in recordings})}; name one of them"
            )
        found = identify(
            self.model,
            self._begin_fit(chosen),
            {name: _velocity_by(velocity) for name, velocity in self._velocities().items()},
            None if self._pressures is None else self._scaling_pressure,
            self.effort,
            mass_kg=self.cylinder.moving_mass_kg,
            damping_ratio=self.damping_ratio,
            dead_band_m_s=self.velocity_dead_band_m_s,
            confidence=self.confidence,
        )
        self.intervals, self.identification = found.intervals, found
        self._use(found.parameters, self._velocities()[found.velocity])
        return self

    def new_state(self) -> AnalyticalState:
        assert self._motion is not None
        return AnalyticalState(self._motion.new_state(), self.model.new_state())

    def advance(self, state: AnalyticalState, samples: Array) -> Array:
        assert self._motion is not None
        assert self.sample_time_s is not None
        velocity = self._motion.advance(state.motion, samples[:, self._position : self._position + 1])
        pressure = None
        if self._pressures is not None:
            pressure = np.ascontiguousarray(samples[:, self._pressures[0]] + samples[:, self._pressures[1]])
        return self.model.simulate(self._values, velocity, self.sample_time_s, state.friction, pressure)

    def multiply_adds(self) -> int:
        return self.model.multiply_adds + (0 if self.causal_velocity is None else 2 * self.causal_velocity.window)

    def _scaling_pressure(self, recording: Recording) -> Array:
        assert self._pressures is not None
        samples = recording.samples(tuple(self.inputs[column] for column in self._pressures))
        return np.ascontiguousarray(samples[:, 0] + samples[:, 1])

    def _velocities(self) -> dict[str, CausalVelocity]:
        velocities = [
            CausalVelocity(window, order, backlash_m, 0.0 if backlash_m else self.velocity_dead_band_m_s)
            for window, order in VELOCITY_FILTERS
            for backlash_m in BACKLASHES_M
        ]
        return {repr(velocity): velocity for velocity in velocities}

    def _use(self, parameters: ModelParameters, velocity: CausalVelocity) -> None:
        assert self.sample_time_s is not None
        self.parameters, self._values = parameters, parameters.packed()
        self.causal_velocity, self._motion = velocity, velocity.block(self.sample_time_s)

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - everything is JSON
        assert self.parameters is not None
        assert self.causal_velocity is not None
        return {
            "cylinder": self.cylinder.to_dict(),
            "friction_model": self.model.name,
            "condition": self.condition,
            "sample_time_s": self.sample_time_s,
            "velocity": asdict(self.causal_velocity),
            "least_velocity_dead_band_m_s": self.velocity_dead_band_m_s,
            "damping_ratio": self.damping_ratio,
            "confidence": self.confidence,
            "interval_method": INTERVAL_METHOD,
            "model": {
                spec.name: {
                    "value": self.parameters.value(spec.name),
                    "unit": spec.unit,
                    "meaning": spec.meaning,
                    "interval": list(self.intervals.get(spec.name, ())) or None,
                }
                for spec in self.model.specs
            },
            "inputs": list(self.inputs),
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003 - everything is JSON
        estimator = cls(
            Cylinder(**parameters["cylinder"]),
            model_named(parameters["friction_model"]),
            parameters["inputs"],
            parameters["condition"],
            velocity_dead_band_m_s=parameters["least_velocity_dead_band_m_s"],
            damping_ratio=parameters["damping_ratio"],
            confidence=parameters["confidence"],
        )
        estimator._restore(parameters)
        return estimator

    def _restore(self, content: dict[str, Any]) -> None:
        model = content["model"]
        self.intervals = {
            name: (entry["interval"][0], entry["interval"][1]) for name, entry in model.items() if entry["interval"]
        }
        self.sample_time_s = content["sample_time_s"]
        numbers = {name: entry["value"] for name, entry in model.items()}
        self._use(self.model.parameter_class(**numbers), CausalVelocity(**content["velocity"]))


def scaled_effort(effort: float, seed: int = 0) -> SearchEffort:
    """Plan a search with a share of the full effort, in (0, 1]: fewer generations and simulations.

    Raises:
        ValueError: The share is not in (0, 1].
    """
    if not 0.0 < effort <= 1.0:
        raise ValueError(f"expected an effort above 0 and at most 1, but got {effort!r}")
    return SearchEffort(
        seed,
        population=8,
        generations=max(1, round(40 * effort)),
        simulated_recordings=40,
        first_look_evaluations=max(12, round(120 * effort)),
        polish_evaluations=max(20, round(400 * effort)),
        piece_s=5.0,
        polished_piece_s=15.0,
    )


def _columns_of(model: FrictionModel, inputs: tuple[str, ...]) -> tuple[int, tuple[int, int] | None]:
    if "position_m" not in inputs:
        raise ValueError(f"{model.name}: inputs are {list(inputs)}, but expected position_m among them")
    position = inputs.index("position_m")
    if not model.pressure_scaled:
        return position, None
    for first, second in PRESSURE_PAIRS:
        if first in inputs and second in inputs:
            return position, (inputs.index(first), inputs.index(second))
    raise ValueError(
        f"{model.name}: inputs are {list(inputs)}, but expected one pair of pressures among them: "
        + " or ".join(" and ".join(pair) for pair in PRESSURE_PAIRS)
    )


def _velocity_by(velocity: CausalVelocity) -> Callable[[Recording], Array]:
    def of(recording: Recording) -> Array:
        block = velocity.block(recording.sample_time_s)
        return block.advance(block.new_state(), recording.samples(("position_m",)))

    return of

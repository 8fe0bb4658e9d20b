"""LuGre as an estimator: causal velocity from raw position, then the model; pressures only scale it, if at all."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.motion_sense import MotionBlock, MotionSense, MotionState
from cylinder_friction.friction_models import (
    INTERVAL_METHOD,
    LUGRE_UNITS,
    Identification,
    LugreParameters,
    SearchEffort,
    identify,
    new_bristle,
    simulate,
)
from cylinder_friction.recordings import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.recordings import Recording

    Array = NDArray[np.float64]

VELOCITY_FILTERS = ((11, 1), (15, 1), (21, 1), (31, 2))
"""One-sided Savitzky-Golay differentiators on offer, window in samples and order."""

PLAYS_M = (0.0, 8e-5)
"""Half-widths of the play on offer [m]: none, and about six times the noise of a smoothed potentiometer."""

LUGRE_STEP_MULTIPLY_ADDS = 100
"""What one LuGre step costs beside the velocity filter: five exponentials or logarithms at about 16, and the rest."""


@dataclass
class LugreState:
    """The state of the velocity, and the bristle deflection, shape ``(1,)`` [m]."""

    motion: MotionState
    bristle_m: Array


class LugreEstimator(FrictionEstimator):
    """LuGre identified on one test alone, as published comparisons do; at run time it sees position only.

    Args:
        cylinder: For the moving mass.
        test: The ``metadata.test`` of the recordings that it is identified on.
        seed: Seed of the search.
        population: Members of differential evolution, a coordinate.
        generations: Greatest number of generations.
        simulated_recordings: How many recordings differential evolution simulates.
        velocity_dead_band_m_s: Slower counts as standstill, where no play tells it [m/s].
        damping_ratio: Damping ratio of the moving mass on the bristles.
        confidence: Probability of the confidence intervals.

    Attributes:
        parameters: The model; None before ``fit``.
        intervals: Confidence interval of every parameter that was searched.
        sense: How velocity is made from position; None before ``fit``.
        identification: All that ``fit`` found; None for a loaded estimator.
    """

    kind: ClassVar[str] = "lugre"
    pressure_scaled: ClassVar[bool] = False

    def __init__(
        self,
        cylinder: Cylinder,
        test: str = "1",
        seed: int = 0,
        population: int = 12,
        generations: int = 60,
        simulated_recordings: int = 4,
        velocity_dead_band_m_s: float = 1e-3,
        damping_ratio: float = 0.5,
        confidence: float = 0.95,
    ) -> None:
        super().__init__()
        self.cylinder = cylinder
        self.test = test
        self.effort = SearchEffort(seed, population, generations, simulated_recordings)
        self.velocity_dead_band_m_s = velocity_dead_band_m_s
        self.damping_ratio = damping_ratio
        self.confidence = confidence
        self.parameters: LugreParameters | None = None
        self.intervals: dict[str, tuple[float, float]] = {}
        self.sense: MotionSense | None = None
        self.identification: Identification | None = None
        self._motion: MotionBlock | None = None

    def fit(self, recordings: Sequence[Recording]) -> None:
        """Identifies the model on the recordings of its test; the others are not looked at.

        Raises:
            RecordingError: There is no recording of that test.
        """
        chosen = [recording for recording in recordings if recording.metadata.test == self.test]
        if recordings and not chosen:
            raise RecordingError(
                f"{self.kind}: no recording of test {self.test!r}; got tests "
                f"{sorted({recording.metadata.test for recording in recordings})}; name one of them as lugre.test"
            )
        self._begin_fit(chosen)
        found = self._identify(chosen, self.effort)
        self.parameters, self.intervals, self.identification = found.parameters, found.intervals, found
        self._use(self._senses()[found.velocity])

    def best_possible(self, recordings: Sequence[Recording], effort: SearchEffort) -> Identification:
        """Returns what the best parameters of this model's class reach on given recordings, fitted to them directly.

        The search starts from this estimator's own parameters too; the estimator stays as it was. The result is a
        bound for a fit that has not seen those recordings.
        """
        if not recordings:
            raise RecordingError(f"{self.kind}: nothing to search on, got no recording; expected at least one")
        return self._identify(recordings, effort, () if self.parameters is None else (self.parameters,))

    def new_state(self) -> LugreState:
        assert self._motion is not None
        return LugreState(self._motion.new_state(), new_bristle())

    def advance(self, state: LugreState, samples: Array) -> Array:
        assert self.parameters is not None
        assert self._motion is not None
        assert self.sample_time_s is not None
        velocity = self._motion.advance(state.motion, samples[:, 2:3])
        pressure = scaling_pressure(samples) if self.pressure_scaled else None
        return simulate(self.parameters, velocity, self.sample_time_s, state.bristle_m, pressure)

    def multiply_adds(self) -> int:
        return LUGRE_STEP_MULTIPLY_ADDS + (0 if self.sense is None else 2 * self.sense.window)

    def _identify(
        self, recordings: Sequence[Recording], effort: SearchEffort, also_from: Sequence[LugreParameters] = ()
    ) -> Identification:
        return identify(
            recordings,
            {name: sense.velocity for name, sense in self._senses().items()},
            (lambda recording: scaling_pressure(recording.samples())) if self.pressure_scaled else None,
            effort,
            mass_kg=self.cylinder.moving_mass_kg,
            damping_ratio=self.damping_ratio,
            dead_band_m_s=self.velocity_dead_band_m_s,
            confidence=self.confidence,
            also_from=also_from,
        )

    def _senses(self) -> dict[str, MotionSense]:
        senses = [
            MotionSense(window, order, play_m, 0.0 if play_m else self.velocity_dead_band_m_s)
            for window, order in VELOCITY_FILTERS
            for play_m in PLAYS_M
        ]
        return {repr(sense): sense for sense in senses}

    def _use(self, sense: MotionSense) -> None:
        assert self.sample_time_s is not None
        self.sense, self._motion = sense, sense.block(self.sample_time_s)

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - everything is JSON
        assert self.parameters is not None
        assert self.sense is not None
        return {
            "cylinder": asdict(self.cylinder),
            "test": self.test,
            "sample_time_s": self.sample_time_s,
            "velocity": asdict(self.sense),
            "least_velocity_dead_band_m_s": self.velocity_dead_band_m_s,
            "damping_ratio": self.damping_ratio,
            "confidence": self.confidence,
            "interval_method": INTERVAL_METHOD,
            "model": {
                name: {
                    "value": value,
                    "unit": LUGRE_UNITS[name],
                    "interval": list(self.intervals.get(name, ())) or None,
                }
                for name, value in asdict(self.parameters).items()
            },
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003 - everything is JSON
        estimator = cls(
            Cylinder(**parameters["cylinder"]),
            test=parameters["test"],
            velocity_dead_band_m_s=parameters["least_velocity_dead_band_m_s"],
            damping_ratio=parameters["damping_ratio"],
            confidence=parameters["confidence"],
        )
        model = parameters["model"]
        estimator.parameters = LugreParameters(**{name: entry["value"] for name, entry in model.items()})
        estimator.intervals = {
            name: (entry["interval"][0], entry["interval"][1]) for name, entry in model.items() if entry["interval"]
        }
        estimator.sample_time_s = parameters["sample_time_s"]
        estimator._use(MotionSense(**parameters["velocity"]))
        return estimator


class PressureLugreEstimator(LugreEstimator):
    """LuGre whose dry friction grows linearly with the sum of both pressures; the slope is found on the same test.

    Source: Coulomb friction with preload and a pressure coefficient times the sum of pressures is the usual law of
    cylinder friction in simulation tools (Simscape's Cylinder Friction).
    """

    kind: ClassVar[str] = "pressure_lugre"
    pressure_scaled: ClassVar[bool] = True


def scaling_pressure(samples: Array) -> Array:
    """Returns the pressure that scales dry friction, P1 + P2 [Pa], shape ``(n,)``, of raw samples, shape ``(n, 3)``."""
    return np.ascontiguousarray(samples[:, 0] + samples[:, 1])

"""A Kalman filter that shares the force balance out between friction and what the pressure sensors' zeros add."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.linear import labelled_rows, on_inputs
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.signals.causal import FirFilter, FirState, moving_average_taps
from cylinder_friction.signals.kalman import constant_jerk
from friction_benchmark.models.observer_step import Belief, ObserverNoise, new_belief, observe
from friction_benchmark.models.sliding_law import BAR_PA, COEFFICIENTS, SlidingLaw
from friction_benchmark.models.steady_motion import AVERAGED, new_sense, sense

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.estimators.base import Array
    from cylinder_friction.recordings.recording import Recording

AVERAGE = FirFilter(moving_average_taps(AVERAGED)[None, None, :])
JERK_M_S3, POSITION_NOISE_M = 12.0, 3.5e-5
TUNED = ("slow_n", "balance_n", "fast_n", "slow_s", "rest_n", "fast_s", "scale", "gate", "bias_walk_n", "rest_s")
"""What the search moves, the most telling first."""
FARTHEST = 8.0
"""How many times greater or smaller than where it began the search may make a noise."""
GATES = (1.2, 5.0)


@dataclass
class ObserverState:
    """States of the moving average and of the motion's filter, and the belief."""

    average: FirState
    motion: Array
    belief: Belief


@dataclass(frozen=True)
class Traces:
    """What the observer takes of one recording: rows of ``sense``, force balance [N], P1 + P2 [bar]."""

    motion: Array
    balance_n: Array
    pressure_bar: Array


class DisturbanceObserver(FrictionEstimator):
    """Kalman filter with friction and pressure-bias states; uses position and both raw pressures.

    ``P1·A1 - P2·A2 - m·a = s·F(v, P) + w_slow + w_fast + A1·b1 - A2·b2 + noise``. Motion comes from a filter of its
    own, of which inertia (1 N) would tell nothing. A constant zero error is alike while extending and retracting,
    friction changes its sign: that parts the two. How much the zeros are off, and how fast they drift, is measured on
    the training recordings, whose labels are free of it; so is the friction law. The other noises are chosen for the
    least mean absolute error of the running filter.

    Args:
        cylinder: Areas and moving mass.
        inputs: Columns; both raw pressures and the position must be among them.
        evaluations: How often the search for the noises runs the filter over its recordings.
        recordings: How many recordings that search uses, spread evenly over the training recordings.
        noise: Where the search begins.

    Source: disturbance observer as a Kalman filter: Davison 1972 and Friedland 1969 (bias states).
    """

    kind: ClassVar[str] = "disturbance_observer"

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        evaluations: int = 200,
        recordings: int = 16,
        noise: ObserverNoise | None = None,
    ) -> None:
        super().__init__(inputs)
        if evaluations < 1 or recordings < 1:
            raise ValueError(f"expected at least one evaluation and recording, but got {evaluations} and {recordings}")
        self.cylinder, self.evaluations, self.recordings = cylinder, evaluations, recordings
        self.noise = noise or ObserverNoise()
        self.law = SlidingLaw(np.zeros((2, COEFFICIENTS)))
        self._order = [int(np.argmax(column)) for column in on_inputs(np.eye(3)[:, :, None], inputs)[:, :, 0]]

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Find the friction law, how far the sensors are off, and the noises, in this order."""
        self._begin_fit(recordings)
        traces = [
            self._trace(AVERAGE.new_state(), new_sense(), recording.samples(self.inputs)) for recording in recordings
        ]
        labels, masks = labelled_rows(recordings)
        self.law = SlidingLaw.fit(
            np.concatenate([trace.motion[mask] for trace, mask in zip(traces, masks, strict=True)]),
            np.concatenate([trace.pressure_bar[mask] for trace, mask in zip(traces, masks, strict=True)]),
            labels,
        )
        beside = [
            (trace.balance_n - recording.column("friction_n"), mask)
            for trace, recording, mask in zip(traces, recordings, masks, strict=True)
        ]
        assert self.sample_time_s is not None
        self.noise = replace(self.noise, **sensor_errors(beside, self.sample_time_s))
        count = min(self.recordings, len(recordings))
        chosen = [int(number * len(recordings) / count) for number in range(count)]
        self._tune([traces[one] for one in chosen], [recordings[one] for one in chosen])
        return self

    def _tune(self, traces: Sequence[Traces], recordings: Sequence[Recording]) -> None:
        """Doubles and halves one noise after the other, then by smaller factors, as long as the error falls.

        It keeps within ``FARTHEST`` of where it began, so that few recordings cannot lead it astray.
        """
        labels = [recording.column("friction_n") for recording in recordings]
        masks = [recording.usable() for recording in recordings]

        def error_n(noise: ObserverNoise) -> float:
            total, count = 0.0, 0
            for trace, label, mask in zip(traces, labels, masks, strict=True):
                friction = self._observe(new_belief(noise, self._areas), trace, noise)[:, 0]
                total += float(np.abs(friction - label)[mask].sum())
                count += int(mask.sum())
            return total / max(count, 1)

        first = self.noise
        best, factor, left = error_n(first), 2.0, self.evaluations - 1
        while left > 0 and factor > 1.05:
            before = best
            for name in TUNED:
                for way in (factor, 1.0 / factor):
                    if left <= 0:
                        return
                    value, began = way * getattr(self.noise, name), getattr(first, name)
                    low, high = GATES if name == "gate" else (began / FARTHEST, began * FARTHEST)
                    if not low <= value <= high:
                        continue
                    tried = replace(self.noise, **{name: value})
                    error = error_n(tried)
                    left -= 1
                    if error < best:
                        best, self.noise = error, tried
                        break
            if best > 0.995 * before:
                factor = factor**0.5

    @cached_property
    def _areas(self) -> Array:
        return np.array([self.cylinder.piston_area_m2, self.cylinder.annulus_area_m2])

    @cached_property
    def _gains(self) -> Array:
        assert self.sample_time_s is not None
        return np.ascontiguousarray(constant_jerk(JERK_M_S3, POSITION_NOISE_M, self.sample_time_s).gains().filter[-1])

    def _trace(self, average: FirState, motion_state: Array, samples: Array) -> Traces:
        assert self.sample_time_s is not None
        pressure_1, pressure_2, position = (np.ascontiguousarray(samples[:, column]) for column in self._order)
        averaged = np.ascontiguousarray(AVERAGE.advance(average, position[:, None])[:, 0])
        motion = sense(position, averaged, self._gains, self.sample_time_s, motion_state)
        areas = self._areas
        balance = pressure_1 * areas[0] - pressure_2 * areas[1] - self.cylinder.moving_mass_kg * motion[:, 1]
        return Traces(motion, balance, (pressure_1 + pressure_2) / BAR_PA)

    def _observe(self, belief: Belief, trace: Traces, noise: ObserverNoise) -> Array:
        assert self.sample_time_s is not None
        return np.asarray(
            observe(
                trace.motion,
                trace.balance_n,
                trace.pressure_bar,
                self.law.coefficients,
                noise.packed(),
                self._areas,
                self.sample_time_s,
                belief.mean,
                belief.covariance,
                belief.last,
            )
        )

    def new_state(self) -> ObserverState:
        return ObserverState(AVERAGE.new_state(), new_sense(), new_belief(self.noise, self._areas))

    def advance(self, state: ObserverState, samples: Array) -> Array:
        return np.ascontiguousarray(
            self._observe(state.belief, self._trace(state.average, state.motion, samples), self.noise)[:, 0]
        )

    def multiply_adds(self) -> int:
        """Five passes over the covariance, five exponentials at about 16, and the rest."""
        return 5 * 49 + 5 * 16 + 80

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - everything is JSON
        return {
            "cylinder": asdict(self.cylinder),
            "inputs": list(self.inputs),
            "evaluations": self.evaluations,
            "recordings": self.recordings,
            "noise": asdict(self.noise),
            "law": self.law.coefficients.tolist(),
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003
        estimator = cls(
            Cylinder(**parameters["cylinder"]),
            parameters["inputs"],
            parameters["evaluations"],
            parameters["recordings"],
            ObserverNoise(**parameters["noise"]),
        )
        estimator.law = SlidingLaw(np.array(parameters["law"]))
        return estimator


def sensor_errors(beside: Sequence[tuple[Array, Any]], sample_time_s: float) -> dict[str, float]:
    """Return how far the force balance is off at the start, how fast that changes, and how much it wanders.

    Args:
        beside: For each recording force balance less label [N], and its mask of usable rows.
        sample_time_s: Between two rows [s].
    """
    starts, rates, walks = [], [], []
    window = max(2, round(0.5 / sample_time_s))
    for difference, mask in beside:
        rows = np.flatnonzero(mask)
        pieces = [difference[piece].mean() for piece in np.array_split(rows, len(rows) // window)] if len(rows) else []
        if len(pieces) < 4:
            continue
        times = window * sample_time_s * np.arange(len(pieces))
        rate, start = np.polyfit(times, pieces, 1)
        starts.append(start)
        rates.append(rate)
        walks.append(np.median(np.abs(np.diff(pieces) - rate * times[1])) / np.sqrt(times[1]))
    if not starts:
        return {}
    return {
        "bias_n": max(1.0, float(np.sqrt(np.mean(np.square(starts))))),
        "bias_rate_n_s": max(0.01, float(np.sqrt(np.mean(np.square(rates))))),
        "bias_walk_n": max(0.01, float(np.median(walks))),
    }

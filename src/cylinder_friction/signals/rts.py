"""The Rauch-Tung-Striebel smoother: the optimal off-line filter of a linear model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.signals.causal_chain import CausalFilter, SteadyKalman
from cylinder_friction.signals.kalman import KalmanModel, constant_jerk, random_walk
from cylinder_friction.signals.smooth_signals import P1, P2, SignalFilter, SmoothSignals, Support, X

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array


@dataclass(frozen=True)
class RtsSmoother(SignalFilter):
    """Constant jerk for the position, random walks for the pressures (Rauch, Tung and Striebel 1965).

    The noise of each measured signal is never taken below LSB²/12, the noise of the converter, whose step is found
    in the recording itself.
    """

    position_noise_m: float = 3.5e-5  # Standard deviation of the position sensor [m]
    # Standard deviation of the jerk, constant within one sample and white between samples [m/s³]
    jerk_noise_m_s3: float = 12.0
    pressure_noise_pa: float = 5.5e3  # Standard deviation of the pressure sensors [Pa]
    # How fast pressures wander: the standard deviation of one step, over the sample time [Pa/s]
    pressure_rate_pa_s: float = 6e5

    def models(self, sample_time_s: float) -> tuple[KalmanModel, KalmanModel]:
        """Return the models of a pressure and of the position, with the noise as declared."""
        return self._pressure_model(0.0, sample_time_s), self._position_model(0.0, sample_time_s)

    def causal(self) -> KalmanFilter:
        """Return the Kalman filter of the same models: this smoother without its look-ahead."""
        return KalmanFilter(self)

    def smooth(self, samples: Array, sample_time_s: float) -> SmoothSignals:
        pressures = []
        for values in (samples[:, P1], samples[:, P2]):
            model = self._pressure_model(quantisation_step(values), sample_time_s)
            pressures.append(smooth_states(model, values)[:, 0])
        return SmoothSignals(pressures[0], pressures[1], *self.motion(samples[:, X], sample_time_s))

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        # How much is smoothed follows from pressure_rate over pressure_noise alone, so their pascals cancel.
        return smooth_states(self._pressure_model(0.0, sample_time_s), force_n)[:, 0].copy()

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        states = smooth_states(self._position_model(quantisation_step(position_m), sample_time_s), position_m)
        return states[:, 1].copy(), states[:, 2].copy()

    def support(self, sample_time_s: float) -> Support:
        """Return the rows after which less than 1 % of a disturbance is left; strictly it looks at all rows."""
        rows = max(model.memory_rows() for model in self.models(sample_time_s))
        return Support(rows, rows)

    def _pressure_model(self, step_pa: float, sample_time_s: float) -> KalmanModel:
        return random_walk(self.pressure_rate_pa_s * sample_time_s, at_least_converter(self.pressure_noise_pa, step_pa))

    def _position_model(self, step_m: float, sample_time_s: float) -> KalmanModel:
        noise_m = at_least_converter(self.position_noise_m, step_m)
        return constant_jerk(self.jerk_noise_m_s3, noise_m, sample_time_s)


@dataclass(frozen=True)
class KalmanFilter(CausalFilter):
    """The Kalman filter of an ``RtsSmoother``, with its steady gains."""

    smoother: RtsSmoother

    def block(self, sample_time_s: float) -> SteadyKalman:
        return SteadyKalman(*self.smoother.models(sample_time_s))

    def support(self, sample_time_s: float) -> Support:
        return Support(self.smoother.support(sample_time_s).before, 0)


def quantisation_step(values: Array) -> float:
    """Return the smallest step between two different values: the converter's least significant bit, or 0."""
    steps = np.diff(np.unique(values))
    return float(steps.min()) if len(steps) else 0.0


def at_least_converter(noise_std: float, step: float) -> float:
    """Return the noise, but no less than that of rounding to ``step``, whose variance is step²/12."""
    return max(noise_std, step / 12.0**0.5)


def smooth_states(model: KalmanModel, measured: Array) -> Array:
    """Return the smoothed states, shape ``(n, k)``, from measurements of the first state, shape ``(n,)``."""
    gains = model.gains()
    # Relative to the first value numbers stay small; the first state of the model then has zero mean.
    first = measured[0]
    states = _smooth(model.transition, gains.filter, gains.smoother, np.ascontiguousarray(measured - first))
    states[:, 0] += first
    return states


@numba.njit(cache=True)
def _smooth(transition: Array, filter_gains: Array, smoother_gains: Array, measured: Array) -> Array:
    rows, size, settled = measured.shape[0], transition.shape[0], filter_gains.shape[0] - 1
    updated = np.zeros((rows, size))
    predicted = np.zeros((rows, size))
    for row in range(rows):
        gain = filter_gains[min(row, settled)]
        if row > 0:
            for i in range(size):
                total = 0.0
                for j in range(size):
                    total += transition[i, j] * updated[row - 1, j]
                predicted[row, i] = total
        surprise = measured[row] - predicted[row, 0]
        for i in range(size):
            updated[row, i] = predicted[row, i] + gain[i] * surprise
    for row in range(rows - 2, -1, -1):
        gain_back = smoother_gains[min(row, settled)]
        for i in range(size):
            total = 0.0
            for j in range(size):
                total += gain_back[i, j] * (updated[row + 1, j] - predicted[row + 1, j])
            updated[row, i] += total
    return updated

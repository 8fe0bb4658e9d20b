"""Linear models with one measured state, and the gains of their Kalman filter and Rauch-Tung-Striebel smoother."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cylinder_friction.arrays import Array

MAXIMUM_ROWS = 20_000
"""Rows after which unsettled gains are refused."""


class Gains(NamedTuple):
    """Gains row by row until they have settled; the last one holds for all later rows."""

    filter: Array  # Kalman gains, shape ``(rows, k)``
    smoother: Array  # Gains that carry the next row's smoothed state back, shape ``(rows, k, k)``


@dataclass(frozen=True)
class KalmanModel:
    """``state[t+1] = transition @ state[t] + noise``; the first state is measured, with noise."""

    transition: Array  # Shape ``(k, k)``
    process_noise: Array  # Covariance per step, shape ``(k, k)``
    measurement_noise: float  # Variance of the measurement
    first_covariance: Array  # Covariance of the state at the first row, before its measurement, shape ``(k, k)``

    @cached_property
    def gains(self) -> Gains:
        """The gains, which do not depend on the measurements (Rauch, Tung and Striebel 1965).

        Raises:
            ValueError: The gains do not settle: no noise moves the state.
        """
        predicted = self.first_covariance
        filter_gains: list[Array] = []
        smoother_gains: list[Array] = []
        for _ in range(MAXIMUM_ROWS):
            gain = np.asarray(predicted[:, 0] / (predicted[0, 0] + self.measurement_noise), dtype=np.float64)
            updated = predicted - np.outer(gain, predicted[0])
            updated = 0.5 * (updated + updated.T)
            following = self.transition @ updated @ self.transition.T + self.process_noise
            back: Array = np.linalg.solve(following, self.transition @ updated).T.astype(np.float64)
            filter_gains.append(gain)
            smoother_gains.append(back)
            if np.allclose(following, predicted, rtol=1e-10, atol=0.0):
                return Gains(np.array(filter_gains), np.array(smoother_gains))
            predicted = 0.5 * (following + following.T)
        raise ValueError(f"the Kalman gains have not settled after {MAXIMUM_ROWS} rows; raise the process noise")

    def memory_rows(self) -> int:
        """Count the rows after which the slowest part of a disturbance has decayed to a thousandth."""
        gain = self.gains.filter[-1]
        corrected = self.transition - np.outer(gain, self.transition[0])
        slowest = float(np.abs(np.linalg.eigvals(corrected)).max())
        return max(1, math.ceil(math.log(1e-3) / math.log(slowest))) if slowest > 0.0 else 1


def random_walk(step_std: float, noise_std: float) -> KalmanModel:
    """Model a random walk: each step adds white noise of ``step_std``; measurements have noise of ``noise_std``."""
    one = np.ones((1, 1))
    return KalmanModel(one, step_std**2 * one, noise_std**2, 1e6 * (step_std**2 + noise_std**2) * one)


def constant_jerk(jerk_std_m_s3: float, noise_std_m: float, sample_time_s: float) -> KalmanModel:
    """Model position, velocity and acceleration under a jerk that is constant within a step and white between steps.

    The standard deviation of the jerk holds for this sample time only.

    Source: Bar-Shalom, Li and Kirubarajan 2001, section 6.3 (piecewise constant white acceleration), one order up.
    """
    step = sample_time_s
    transition = np.array([[1.0, step, 0.5 * step**2], [0.0, 1.0, step], [0.0, 0.0, 1.0]])
    effect = np.array([step**3 / 6.0, step**2 / 2.0, step])
    jerk_noise = jerk_std_m_s3**2 * np.outer(effect, effect)
    # With one jerk per step the covariance is singular; a little independent noise keeps the smoother's inverse exact.
    jerk_noise += 1e-6 * np.diag(np.diag(jerk_noise))
    time_s = (noise_std_m / jerk_std_m_s3) ** (1.0 / 3.0)
    first = np.diag((1e3 * noise_std_m / time_s ** np.arange(3.0)) ** 2)
    return KalmanModel(transition, jerk_noise, noise_std_m**2, first)

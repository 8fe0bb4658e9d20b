"""One row of the disturbance observer: predict, let the friction law change side, correct with the force balance.

States, all but the scale in newtons: what the zero of pressure 1 and of pressure 2 adds to the force balance, and the
rates of both; the scale of the friction law; friction that the law has not, slow and fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numba
import numpy as np

from friction_benchmark.models.sliding_law import BAR_PA, FADING_M_S, TERMS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STATES = 7
BIAS_1, BIAS_2, RATE_1, RATE_2, SCALE, SLOW, FAST = range(STATES)


@dataclass(frozen=True)
class ObserverNoise:
    """What moves the states, and how far the force balance can be trusted.

    Attributes:
        bias_n: Standard deviation of the sensors' part of the force balance at the start [N].
        bias_rate_n_s: Of its rate [N/s].
        bias_walk_n: Of what it wanders in a second, besides [N].
        scale: Standard deviation of the friction law's scale.
        slow_n, slow_s: Standard deviation [N] and time constant [s] of what the law leaves while sliding.
        fast_n, fast_s: The same for what settles quickly after a start.
        rest_n, rest_s: The same at standstill, where friction is whatever balances the pressures.
        balance_n: Noise of one sample of the force balance [N].
        gate: Innovations beyond so many standard deviations are a jump of friction.

    Raises:
        ValueError: A number is not finite and positive.
    """

    bias_n: float = 5.0
    bias_rate_n_s: float = 0.1
    bias_walk_n: float = 0.1
    scale: float = 0.03
    slow_n: float = 35.0
    slow_s: float = 1.2
    fast_n: float = 30.0
    fast_s: float = 0.06
    rest_n: float = 250.0
    rest_s: float = 3.0
    balance_n: float = 30.0
    gate: float = 2.2

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"ObserverNoise: {field.name} must be a positive number, but got {value!r}")

    def packed(self) -> Array:
        """Return the numbers in the order of the fields, shape ``(12,)``, as the compiled step takes them."""
        return np.array([getattr(self, field.name) for field in fields(self)])


@dataclass
class Belief:
    """Mean, shape ``(7,)``, covariance, shape ``(7, 7)``, and ``(law's last friction [N], smoothed pressure [bar])``,
    shape ``(2,)``; before the first sample the last pressure is NaN."""

    mean: Array
    covariance: Array
    last: Array


def new_belief(noise: ObserverNoise, areas_m2: Array) -> Belief:
    """Return the belief before the first sample; both pressures' zeros are equally uncertain in pascal."""
    share = areas_m2**2 / (areas_m2**2).sum()
    mean = np.zeros(STATES)
    mean[SCALE] = 1.0
    rate = noise.bias_rate_n_s**2 * share
    spread = [*(noise.bias_n**2 * share), *rate, noise.scale**2, noise.slow_n**2, noise.rest_n**2]
    return Belief(mean, np.diag(np.array(spread)), np.array([0.0, np.nan]))


@numba.njit(cache=True)
def law_parts(coefficients: Array, direction: float, speed: float, memory: float) -> tuple[float, float]:
    """Return signed friction at nought pressure [N] and its rise with pressure [N/bar]; 0 without a direction."""
    if direction == 0.0:
        return 0.0, 0.0
    row = coefficients[0] if direction > 0.0 else coefficients[1]
    plain = row[0] + row[1] * speed + row[5] * memory
    slope = row[TERMS] + row[TERMS + 4] * memory
    for number in range(3):
        fading = math.exp(-speed / FADING_M_S[number])
        plain += row[2 + number] * fading
        slope += row[TERMS + 1 + number] * fading
    return direction * plain, direction * slope


@numba.njit(cache=True)
def observe(
    motion: Array,
    balance_n: Array,
    pressure_bar: Array,
    coefficients: Array,
    noise: Array,
    areas_m2: Array,
    sample_time_s: float,
    mean: Array,
    covariance: Array,
    last: Array,
) -> Array:
    """Return friction and the sensors' part of the force balance [N], shape ``(n, 2)``; changes the belief in place.

    Args:
        motion: Rows of ``sense``, shape ``(n, 4)``.
        balance_n: P1·A1 - P2·A2 - m·a as measured, shape ``(n,)`` [N].
        pressure_bar: P1 + P2 as measured, shape ``(n,)`` [bar].
        coefficients: Of the sliding law, shape ``(2, k)``.
        noise: ``ObserverNoise.packed``.
        areas_m2: Piston and annulus area, shape ``(2,)`` [m²].
        sample_time_s: Between two samples [s].
        mean, covariance, last: Of the belief.
    """
    result = np.empty((motion.shape[0], 2))
    jacobian = np.ones(STATES)
    jacobian[RATE_1] = jacobian[RATE_2] = 0.0
    bar_n = areas_m2 * BAR_PA
    for row in range(motion.shape[0]):
        if np.isnan(last[1]):
            last[1] = pressure_bar[row]
        last[1] += 0.1 * (pressure_bar[row] - last[1])
        sliding = motion[row, 0] != 0.0
        _predict(mean, covariance, noise, areas_m2, sample_time_s, sliding)
        if sliding:
            plain, slope = law_parts(coefficients, motion[row, 2], abs(motion[row, 0]), motion[row, 3])
            true_bar = last[1] - mean[BIAS_1] / bar_n[0] + mean[BIAS_2] / bar_n[1]
            law_n = plain + slope * max(true_bar, 0.0)
            if law_n * last[0] <= 0.0:  # friction itself does not jump with the law's side
                mean[FAST] += mean[SCALE] * (last[0] - law_n)
                covariance[FAST, FAST] += noise[8] ** 2
            last[0] = law_n
            jacobian[BIAS_1] = 1.0 - mean[SCALE] * slope / bar_n[0]
            jacobian[BIAS_2] = 1.0 + mean[SCALE] * slope / bar_n[1]
        else:
            jacobian[BIAS_1] = jacobian[BIAS_2] = 1.0
        jacobian[SCALE] = last[0]
        friction_n = mean[SCALE] * last[0] + mean[SLOW] + mean[FAST]
        _correct(
            mean, covariance, jacobian, balance_n[row] - friction_n - mean[BIAS_1] - mean[BIAS_2], noise[10], noise[11]
        )
        result[row, 0] = mean[SCALE] * last[0] + mean[SLOW] + mean[FAST]
        result[row, 1] = mean[BIAS_1] + mean[BIAS_2]
    return result


@numba.njit(cache=True)
def _predict(mean: Array, covariance: Array, noise: Array, areas_m2: Array, step: float, sliding: bool) -> None:
    fast_n, fast_s = (noise[6], noise[7]) if sliding else (noise[8], noise[9])
    kept = (math.exp(-step / noise[5]), math.exp(-step / fast_s))
    for bias in (BIAS_1, BIAS_2):
        mean[bias] += step * mean[bias + 2]
        for column in range(STATES):
            covariance[bias, column] += step * covariance[bias + 2, column]
        for column in range(STATES):
            covariance[column, bias] += step * covariance[column, bias + 2]
    for number, state in enumerate((SLOW, FAST)):
        mean[state] *= kept[number]
        for column in range(STATES):
            covariance[state, column] *= kept[number]
        for column in range(STATES):
            covariance[column, state] *= kept[number]
    covariance[SLOW, SLOW] += (1.0 - kept[0] ** 2) * noise[4] ** 2
    covariance[FAST, FAST] += (1.0 - kept[1] ** 2) * fast_n**2
    covariance[SCALE, SCALE] += 1e-3 * step * noise[3] ** 2
    total = areas_m2[0] ** 2 + areas_m2[1] ** 2
    for bias in (BIAS_1, BIAS_2):
        share = areas_m2[bias] ** 2 / total
        covariance[bias, bias] += share * step * noise[2] ** 2
        covariance[bias + 2, bias + 2] += 1e-4 * share * step * noise[1] ** 2


@numba.njit(cache=True)
def _correct(mean: Array, covariance: Array, jacobian: Array, innovation: float, balance_n: float, gate: float) -> None:
    """Joseph's form, which keeps the covariance positive definite whatever is rounded (Bucy and Joseph 1968)."""
    toward = np.zeros(STATES)
    variance = balance_n**2
    for row in range(STATES):
        for column in range(STATES):
            toward[row] += covariance[row, column] * jacobian[column]
        variance += jacobian[row] * toward[row]
    beyond = innovation**2 - gate**2 * variance
    if beyond > 0.0:
        covariance[FAST, FAST] += beyond
        toward[FAST] += beyond
        variance += beyond
    gain = toward / variance
    for row in range(STATES):
        mean[row] += gain[row] * innovation
        for column in range(STATES):
            covariance[row, column] -= gain[row] * toward[column]
    for row in range(STATES):
        toward[row] = 0.0
        for column in range(STATES):
            toward[row] += covariance[row, column] * jacobian[column]
    for row in range(STATES):
        for column in range(STATES):
            covariance[row, column] += gain[column] * (balance_n**2 * gain[row] - toward[row])
    for row in range(STATES):
        for column in range(row):
            middle = 0.5 * (covariance[row, column] + covariance[column, row])
            covariance[row, column] = covariance[column, row] = middle

"""A Kalman filter that divides the force balance into friction and the contribution of the pressure sensors' zeros.

States, all but the scale in newtons: the contribution of either pressure's zero to the force balance, and its rate; the
scale of the friction law; the rest of friction, slow and fast.

The law of sliding friction is a curve over speed all of whose parts but the viscous one grow with pressure:
``|F| = c + d |v| + sum_k e_k exp(-|v| / v_k) + f h + (c' + sum_k e'_k exp(-|v| / v_k) + f' h) (P1 + P2)``, one set of
coefficients per direction. The memory ``h`` follows ``exp(-|v| / v_2)`` with a delay of 0.2 s, as the lubricant film
does (Yanada and Sekikawa 2008). It is linear in the coefficients, so that robust least squares finds them.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from typing import Self

import numba
import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.estimators.linear import refuse_missing_inputs
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.evenly import evenly
from friction_benchmark.models.base import Model
from friction_benchmark.models.robust_regression import robust_weights
from friction_benchmark.models.steady_motion import causal_motion
from friction_benchmark.registry import BuildConfiguration, RegisteredModel, needs_raw_pressures

STATES = 7
BIAS_1, BIAS_2, RATE_1, RATE_2, SCALE, SLOW, FAST = range(STATES)
BAR_PA = 1e5
FADING_M_S = (0.004, 0.012, 0.035)
"""Speeds over which the exponentials fade [m/s]: the span of Stribeck velocities of cylinder seals."""
TERMS = 6  # Without pressure: 1, |v|, three exponentials, memory; pressure multiplies all but |v|
COEFFICIENTS = 2 * TERMS - 1
SMALL_RESIDUAL_N, PASSES = 5.0, 15
TUNED = ("slow_n", "balance_n", "fast_n", "slow_s", "rest_n", "fast_s", "scale", "gate", "bias_walk_n", "rest_s")
"""Noises that are searched, the most influential first."""
FARTHEST = 8.0  # Largest factor by which the search may change a noise
GATES = (1.2, 5.0)


@dataclass(frozen=True)
class ObserverNoise:
    """Noises of the states and of the force balance, all positive."""

    bias_n: float = 5.0  # Standard deviation of the sensors' contribution to the force balance at the start [N]
    bias_rate_n_s: float = 0.1  # Of its rate [N/s]
    bias_walk_n: float = 0.1  # Of its random walk within a second [N]
    scale: float = 0.03  # Standard deviation of the friction law's scale
    slow_n: float = 35.0  # Standard deviation of the law's residual while sliding [N]
    slow_s: float = 1.2  # Its time constant [s]
    fast_n: float = 30.0  # Both for the part that settles quickly after a start
    fast_s: float = 0.06
    rest_n: float = 250.0  # Both at standstill, where friction balances the pressures
    rest_s: float = 3.0
    balance_n: float = 30.0  # Noise of one sample of the force balance [N]
    gate: float = 2.2  # Innovations beyond so many standard deviations are a jump of friction


def first_covariance(noise: ObserverNoise, areas_m2: Array) -> Array:
    """Return the covariance before the first sample; the zeros of both pressures are equally uncertain in pascal."""
    share = areas_m2**2 / (areas_m2**2).sum()
    rate = noise.bias_rate_n_s**2 * share
    return np.diag([*(noise.bias_n**2 * share), *rate, noise.scale**2, noise.slow_n**2, noise.rest_n**2])


@dataclass(frozen=True)
class Traces:
    """The observer's inputs from one recording."""

    motion: Array  # Rows of ``causal_motion``
    balance_n: Array  # Force balance [N]
    pressure_bar: Array  # P1 + P2 [bar]
    sample_time_s: float


class DisturbanceObserver(Model):
    """Kalman filter with friction and pressure-bias states (Davison 1972, Friedland 1969); uses both raw pressures.

    ``P1·A1 - P2·A2 - m·a = s·F(v, P) + w_slow + w_fast + A1·b1 - A2·b2 + noise``. Motion comes from a filter of its
    own, to which inertia (1 N) would add nothing. A constant zero error has one sign while extending and retracting,
    friction changes its sign: that separates the two. Size and drift of the zero errors are measured on the training
    recordings, whose labels are free of them; so is the friction law. The other noises are chosen for the least mean
    absolute error of the running filter. Effort cuts how often that search runs the filter, and over how many
    recordings, spread evenly over those of training.
    """

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build.inputs)
        refuse_missing_inputs(build.inputs)
        self.cylinder = build.cylinder
        self._areas = np.array([build.cylinder.piston_area_m2, build.cylinder.annulus_area_m2])
        self.evaluations, self.recordings = build.share(600, 2), max(2, round(24 * build.effort**0.5))
        self.noise = ObserverNoise()
        self.law = np.zeros((2, COEFFICIENTS))

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Find the friction law, the sensors' errors, and the noises, in this order."""
        known = [(self._trace(one), one.column("friction_n"), one.usable()) for one in recordings]
        self.law = sliding_law(
            np.concatenate([trace.motion[usable] for trace, _, usable in known]),
            np.concatenate([trace.pressure_bar[usable] for trace, _, usable in known]),
            np.concatenate([label_n[usable] for _, label_n, usable in known]),
        )
        differences = [(trace.balance_n - label_n, usable) for trace, label_n, usable in known]
        self.noise = replace(self.noise, **sensor_errors(differences, recordings[0].sample_time_s))
        self._tune(evenly(known, self.recordings))
        return self

    def _tune(self, known: Sequence[tuple[Traces, Array, Mask]]) -> None:
        """Double and halve one noise after the other, then use smaller factors, as long as the error falls.

        The search stays within ``FARTHEST`` of its start, so that few recordings cannot lead it astray.
        """

        def error_n(noise: ObserverNoise) -> float:
            off = [np.abs(self._observe(trace, noise) - label_n)[usable] for trace, label_n, usable in known]
            return float(np.concatenate(off).mean())

        first = self.noise
        best, factor, left = error_n(first), 2.0, self.evaluations - 1
        while left > 0 and factor > 1.05:
            before = best
            for name in TUNED:
                for change in (factor, 1.0 / factor):
                    if left <= 0:
                        return
                    value, began = change * getattr(self.noise, name), getattr(first, name)
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

    def _trace(self, recording: Recording) -> Traces:
        pressure_1, pressure_2, position = (np.ascontiguousarray(recording.column(name)) for name in SAMPLE_COLUMNS)
        motion, areas = causal_motion(position, recording.sample_time_s), self._areas
        balance = pressure_1 * areas[0] - pressure_2 * areas[1] - self.cylinder.moving_mass_kg * motion[:, 1]
        return Traces(motion, balance, (pressure_1 + pressure_2) / BAR_PA, recording.sample_time_s)

    def _observe(self, trace: Traces, noise: ObserverNoise) -> Array:
        measured = (trace.motion, trace.balance_n, trace.pressure_bar)
        noises, start = np.array(astuple(noise)), first_covariance(noise, self._areas)
        return np.asarray(observe(*measured, self.law, noises, self._areas, trace.sample_time_s, start))

    def estimate(self, recording: Recording) -> Array:
        return self._observe(self._trace(recording), self.noise)

    def multiply_adds(self) -> int:
        """Return five passes over the covariance, five exponentials at about 16, and the rest."""
        return 5 * 49 + 5 * 16 + 80


def sensor_errors(differences: Sequence[tuple[Array, Mask]], sample_time_s: float) -> dict[str, float]:
    """Return the force balance's error at the start, its rate, and its random walk, by the names of the noises.

    ``differences`` hold force balance less label [N] and the mask of usable rows of each recording.
    """
    starts, rates, walks = [], [], []
    window = max(2, round(0.5 / sample_time_s))
    for difference, mask in differences:
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


def sliding_law(motion: Array, pressure_bar: Array, friction_n: Array) -> Array:
    """Return the law of least absolute error on labelled sliding: while extending and retracting, shape ``(2, k)``.

    ``motion`` are rows of ``causal_motion``, of which those at rest are skipped; ``pressure_bar`` is P1 + P2.
    """
    found = np.zeros((2, COEFFICIENTS))
    for side, direction in enumerate((1.0, -1.0)):
        rows = motion[:, 0] * direction > 0.0
        if rows.sum() > 10 * COEFFICIENTS:
            speed = np.abs(motion[rows, 0])
            exponentials = [np.exp(-speed / fading) for fading in FADING_M_S]
            scaled = [np.ones_like(speed), *exponentials, motion[rows, 3]]
            plain = [scaled[0], speed, *scaled[1:]]
            design = np.stack([*plain, *(pressure_bar[rows] * part for part in scaled)], axis=1)
            found[side] = robust_weights(design, direction * friction_n[rows], SMALL_RESIDUAL_N, PASSES)
    if not found[1].any() or not found[0].any():
        found[:] = found.sum(axis=0)
    return found


@numba.njit(cache=True)
def law_parts(coefficients: Array, direction: float, speed: float, memory: float) -> tuple[float, float]:
    """Return signed friction at zero pressure [N] and its rise with pressure [N/bar]; 0 without a direction."""
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
    motion: Array,  # Rows of ``causal_motion``, shape ``(n, 4)``
    balance_n: Array,  # P1·A1 - P2·A2 - m·a as measured, shape ``(n,)``
    pressure_bar: Array,  # P1 + P2 as measured, shape ``(n,)``
    coefficients: Array,  # From ``sliding_law``
    noise: Array,  # The fields of ``ObserverNoise``
    areas_m2: Array,  # Piston and annulus area
    step: float,  # Between two samples [s]
    covariance: Array,  # Before the first sample, shape ``(7, 7)``; changed in place
) -> Array:
    """Return friction [N], shape ``(n,)``. Each row of this recursion needs the one before, hence the compiler."""
    result, mean, memory = np.empty(motion.shape[0]), np.zeros(STATES), np.array([0.0, pressure_bar[0]])
    mean[SCALE] = 1.0
    for row in range(motion.shape[0]):
        measured = (motion[row], balance_n[row], pressure_bar[row])
        result[row] = observe_one(measured, coefficients, noise, areas_m2, step, covariance, mean, memory)
    return result


@numba.njit(cache=True)
def observe_one(
    measured: tuple[Array, float, float],  # One row of what ``observe`` takes: motion, balance and pressure
    coefficients: Array,
    noise: Array,
    areas_m2: Array,
    step: float,
    covariance: Array,
    mean: Array,  # The states; changed in place like ``covariance`` and ``memory``
    memory: Array,  # The law's friction of the last row [N], and the smoothed pressure [bar]
) -> float:
    """Return friction [N] at one row."""
    motion, balance_n, pressure_bar = measured
    jacobian, bar_n = np.ones(STATES), areas_m2 * BAR_PA
    jacobian[RATE_1] = jacobian[RATE_2] = 0.0
    memory[1] += 0.1 * (pressure_bar - memory[1])
    sliding = motion[0] != 0.0
    _predict(mean, covariance, noise, areas_m2, step, sliding)
    if sliding:
        plain, slope = law_parts(coefficients, motion[2], abs(motion[0]), motion[3])
        true_bar = memory[1] - mean[BIAS_1] / bar_n[0] + mean[BIAS_2] / bar_n[1]
        law_n = plain + slope * max(true_bar, 0.0)
        if law_n * memory[0] <= 0.0:  # friction itself does not jump with the law's side
            mean[FAST] += mean[SCALE] * (memory[0] - law_n)
            covariance[FAST, FAST] += noise[8] ** 2
        memory[0] = law_n
        jacobian[BIAS_1] -= mean[SCALE] * slope / bar_n[0]
        jacobian[BIAS_2] += mean[SCALE] * slope / bar_n[1]
    jacobian[SCALE] = memory[0]
    friction_n = mean[SCALE] * memory[0] + mean[SLOW] + mean[FAST]
    missed_n = balance_n - friction_n - mean[BIAS_1] - mean[BIAS_2]
    _correct(mean, covariance, jacobian, missed_n, noise[10], noise[11])
    return float(mean[SCALE] * memory[0] + mean[SLOW] + mean[FAST])


@numba.njit(cache=True)
def _predict(mean: Array, covariance: Array, noise: Array, areas_m2: Array, step: float, sliding: bool) -> None:
    fast_n, fast_s = (noise[6], noise[7]) if sliding else (noise[8], noise[9])
    total = areas_m2[0] ** 2 + areas_m2[1] ** 2
    for bias in (BIAS_1, BIAS_2):
        mean[bias] += step * mean[bias + 2]
        covariance[bias] += step * covariance[bias + 2]
        covariance[:, bias] += step * covariance[:, bias + 2]
        share = areas_m2[bias] ** 2 / total
        covariance[bias, bias] += share * step * noise[2] ** 2
        covariance[bias + 2, bias + 2] += 1e-4 * share * step * noise[1] ** 2
    for state, spread_n, lasting_s in ((SLOW, noise[4], noise[5]), (FAST, fast_n, fast_s)):
        kept = math.exp(-step / lasting_s)
        mean[state] *= kept
        covariance[state] *= kept
        covariance[:, state] *= kept
        covariance[state, state] += (1.0 - kept**2) * spread_n**2
    covariance[SCALE, SCALE] += 1e-3 * step * noise[3] ** 2


@numba.njit(cache=True)
def _correct(mean: Array, covariance: Array, jacobian: Array, innovation: float, balance_n: float, gate: float) -> None:
    """Joseph's form, which keeps the covariance positive definite despite rounding (Bucy and Joseph 1968)."""
    toward = (covariance * jacobian).sum(axis=1)
    variance = balance_n**2 + (jacobian * toward).sum()
    beyond = innovation**2 - gate**2 * variance
    if beyond > 0.0:
        covariance[FAST, FAST] += beyond
        toward[FAST] += beyond
        variance += beyond
    gain = toward / variance
    mean += gain * innovation
    covariance -= np.outer(gain, toward)
    covariance += np.outer(balance_n**2 * gain - (covariance * jacobian).sum(axis=1), gain)
    covariance[:] = 0.5 * (covariance + covariance.T)


MODELS = (
    RegisteredModel(
        name="disturbance_observer",
        title="Kalman filter with friction and pressure-bias states",
        family="modern",
        source="Friedland 1969; Davison 1972",
        build=DisturbanceObserver,
        supports=needs_raw_pressures,
        chosen="Friction law over speed and pressure fitted to sliding; sensor errors measured on the training "
        "recordings; all other noises found by its own search for the least error, so nothing else is tuned.",
    ),
)

"""A Kalman filter that divides the force balance into friction and the contribution of the pressure sensors' zeros.

States, all but the scale in newtons: the contribution of the zero of pressure 1 and of pressure 2 to the force balance,
and the rates of both; the scale of the friction law; the rest of friction, slow and fast.

The law of sliding friction is a curve over speed all of whose parts but the viscous one grow with pressure:
``|F| = c + d |v| + sum_k e_k exp(-|v| / v_k) + f h + (c' + sum_k e'_k exp(-|v| / v_k) + f' h) (P1 + P2)``, one set of
coefficients per direction. The memory ``h`` follows ``exp(-|v| / v_2)`` with a delay of 0.2 s, as the lubricant film
does (Yanada and Sekikawa 2008). It is linear in the coefficients, so that robust least squares finds them.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace
from typing import Any, Self

import numba
import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.estimators.linear import labelled_rows, refuse_missing_inputs
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
    """Noises of the states and of the force balance.

    Raises:
        ValueError: A number is not finite and positive.
    """

    bias_n: float = 5.0  # Standard deviation of the sensors' contribution to the force balance at the start [N]
    bias_rate_n_s: float = 0.1  # Of its rate [N/s]
    bias_walk_n: float = 0.1  # Of its random walk within a second [N]
    scale: float = 0.03  # Standard deviation of the friction law's scale
    slow_n: float = 35.0  # Standard deviation [N] and time constant [s] of the law's residual while sliding
    slow_s: float = 1.2  # Standard deviation [N] and time constant [s] of the law's residual while sliding
    fast_n: float = 30.0  # The same for the part that settles quickly after a start
    fast_s: float = 0.06  # The same for the part that settles quickly after a start
    rest_n: float = 250.0  # The same at standstill, where friction balances the pressures
    rest_s: float = 3.0  # The same at standstill, where friction balances the pressures
    balance_n: float = 30.0  # Noise of one sample of the force balance [N]
    gate: float = 2.2  # Innovations beyond so many standard deviations are a jump of friction

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"ObserverNoise: {field.name} must be a positive number, but got {value!r}")


def first_covariance(noise: ObserverNoise, areas_m2: Array) -> Array:
    """Return the covariance before the first sample; the zeros of both pressures are equally uncertain in pascal."""
    share = areas_m2**2 / (areas_m2**2).sum()
    rate = noise.bias_rate_n_s**2 * share
    spread = [*(noise.bias_n**2 * share), *rate, noise.scale**2, noise.slow_n**2, noise.rest_n**2]
    return np.diag(np.array(spread))


@dataclass(frozen=True)
class Traces:
    """The observer's inputs from one recording: rows of ``causal_motion``, force balance [N], P1 + P2 [bar], and the
    sample time [s]."""

    motion: Array
    balance_n: Array
    pressure_bar: Array
    sample_time_s: float


class DisturbanceObserver(Model):
    """Kalman filter with friction and pressure-bias states; uses position and both raw pressures.

    ``P1·A1 - P2·A2 - m·a = s·F(v, P) + w_slow + w_fast + A1·b1 - A2·b2 + noise``. Motion comes from a filter of its
    own, to which inertia (1 N) would add nothing. A constant zero error has one sign while extending and retracting,
    friction changes its sign: that separates the two. Size and drift of the zero errors are measured on the training
    recordings, whose labels are free of them; so is the friction law. The other noises are chosen for the least mean
    absolute error of the running filter.

    Args:
        build: Cylinder and inputs. Effort cuts how often the search for the noises runs the filter, and over how many
            recordings, spread evenly over the training recordings.

    Source: disturbance observer as a Kalman filter: Davison 1972 and Friedland 1969 (bias states).
    """

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build.inputs)
        refuse_missing_inputs(build.inputs)
        self.cylinder = build.cylinder
        self.evaluations, self.recordings = build.share(600, 2), max(2, round(24 * build.effort**0.5))
        self.noise = ObserverNoise()
        self.law = np.zeros((2, COEFFICIENTS))

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Find the friction law, the sensors' errors, and the noises, in this order."""
        traces = [self._trace(recording) for recording in recordings]
        labels, masks = labelled_rows(recordings)
        self.law = sliding_law(
            np.concatenate([trace.motion[mask] for trace, mask in zip(traces, masks, strict=True)]),
            np.concatenate([trace.pressure_bar[mask] for trace, mask in zip(traces, masks, strict=True)]),
            labels,
        )
        differences = [
            (trace.balance_n - recording.column("friction_n"), mask)
            for trace, recording, mask in zip(traces, recordings, masks, strict=True)
        ]
        self.noise = replace(self.noise, **sensor_errors(differences, recordings[0].sample_time_s))
        pairs = zip(traces, recordings, strict=True)
        self._tune(
            [(trace, one.column("friction_n"), one.usable()) for trace, one in evenly([*pairs], self.recordings)]
        )
        return self

    def _tune(self, known: Sequence[tuple[Traces, Array, Mask]]) -> None:
        """Double and halve one noise after the other, then use smaller factors, as long as the error falls.

        The search stays within ``FARTHEST`` of its start, so that few recordings cannot lead it astray.
        """

        def error_n(noise: ObserverNoise) -> float:
            off = [np.abs(self._observe(trace, noise) - label)[mask] for trace, label, mask in known]
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

    @property
    def _areas(self) -> Array:
        return np.array([self.cylinder.piston_area_m2, self.cylinder.annulus_area_m2])

    def _trace(self, recording: Recording) -> Traces:
        pressure_1, pressure_2, position = (np.ascontiguousarray(recording.column(name)) for name in SAMPLE_COLUMNS)
        motion = causal_motion(position, recording.sample_time_s)
        areas = self._areas
        balance = pressure_1 * areas[0] - pressure_2 * areas[1] - self.cylinder.moving_mass_kg * motion[:, 1]
        return Traces(motion, balance, (pressure_1 + pressure_2) / BAR_PA, recording.sample_time_s)

    def _observe(self, trace: Traces, noise: ObserverNoise) -> Array:
        measured = (trace.motion, trace.balance_n, trace.pressure_bar)
        start = first_covariance(noise, self._areas)
        return np.asarray(
            observe(*measured, self.law, np.array(astuple(noise)), self._areas, trace.sample_time_s, start)
        )

    def estimate(self, recording: Recording) -> Array:
        return self._observe(self._trace(recording), self.noise)

    def multiply_adds(self) -> int:
        """Return five passes over the covariance, five exponentials at about 16, and the rest."""
        return 5 * 49 + 5 * 16 + 80


def sensor_errors(differences: Sequence[tuple[Array, Any]], sample_time_s: float) -> dict[str, float]:
    """Return the force balance's error at the start, its rate, and its random walk, by the names of the noises.

    Args:
        differences: For each recording force balance less label [N], and its mask of usable rows.
        sample_time_s: Between two rows [s].
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

    Args:
        motion: Rows of ``causal_motion``, shape ``(n, 4)``; rows at rest are skipped.
        pressure_bar: P1 + P2, shape ``(n,)`` [bar].
        friction_n: Labels, shape ``(n,)`` [N].
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
    motion: Array,
    balance_n: Array,
    pressure_bar: Array,
    coefficients: Array,
    noise: Array,
    areas_m2: Array,
    step: float,
    covariance: Array,
) -> Array:
    """Return friction [N], shape ``(n,)``. Each row of this recursion needs the one before, hence the compiler.

    Args:
        motion: Rows of ``causal_motion``, shape ``(n, 4)``.
        balance_n: P1·A1 - P2·A2 - m·a as measured, shape ``(n,)`` [N].
        pressure_bar: P1 + P2 as measured, shape ``(n,)`` [bar].
        coefficients: From ``sliding_law``, shape ``(2, k)``.
        noise: The fields of ``ObserverNoise``, shape ``(12,)``.
        areas_m2: Piston and annulus area, shape ``(2,)`` [m²].
        step: Between two samples [s].
        covariance: Before the first sample, shape ``(7, 7)``; changed in place.
    """
    result = np.empty(motion.shape[0])
    mean, jacobian = np.zeros(STATES), np.ones(STATES)
    mean[SCALE], last_law_n, smooth_bar = 1.0, 0.0, pressure_bar[0]
    jacobian[RATE_1] = jacobian[RATE_2] = 0.0
    bar_n = areas_m2 * BAR_PA
    for row in range(motion.shape[0]):
        smooth_bar += 0.1 * (pressure_bar[row] - smooth_bar)
        sliding = motion[row, 0] != 0.0
        _predict(mean, covariance, noise, areas_m2, step, sliding)
        jacobian[BIAS_1] = jacobian[BIAS_2] = 1.0
        if sliding:
            plain, slope = law_parts(coefficients, motion[row, 2], abs(motion[row, 0]), motion[row, 3])
            true_bar = smooth_bar - mean[BIAS_1] / bar_n[0] + mean[BIAS_2] / bar_n[1]
            law_n = plain + slope * max(true_bar, 0.0)
            if law_n * last_law_n <= 0.0:  # friction itself does not jump with the law's side
                mean[FAST] += mean[SCALE] * (last_law_n - law_n)
                covariance[FAST, FAST] += noise[8] ** 2
            last_law_n = law_n
            jacobian[BIAS_1] -= mean[SCALE] * slope / bar_n[0]
            jacobian[BIAS_2] += mean[SCALE] * slope / bar_n[1]
        jacobian[SCALE] = last_law_n
        friction_n = mean[SCALE] * last_law_n + mean[SLOW] + mean[FAST]
        missed_n = balance_n[row] - friction_n - mean[BIAS_1] - mean[BIAS_2]
        _correct(mean, covariance, jacobian, missed_n, noise[10], noise[11])
        result[row] = mean[SCALE] * last_law_n + mean[SLOW] + mean[FAST]
    return result


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

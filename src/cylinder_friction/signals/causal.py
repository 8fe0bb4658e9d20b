"""Causal filters with explicit state: the same code, bit for bit, on a whole recording and sample by sample.

A block never looks ahead, and cutting its input into pieces never changes its output. Before the first sample
every filter behaves as if the first sample had always been there, so that a start makes no transient.
"""

import math
import operator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from types import ModuleType
from typing import Any, Protocol

import numpy as np

from cylinder_friction.arrays import Array


@cache  # An import statement takes half as long as filtering one sample
def _loops() -> ModuleType:
    from cylinder_friction.signals import causal_loops  # Numba: labels need not wait for it

    return causal_loops


class CausalBlock(Protocol):
    """The protocol of causal filters: one row in, one row out, without looking ahead.

    Implement it to use a filter of your own in a chain: ``advance`` must give the same bits however the input is cut
    into pieces, and must not change anything but ``state``.
    """

    def new_state(self) -> Any:
        """Return the state before the first sample; ``advance`` changes it in place."""

    def advance(self, state: Any, inputs: Array) -> Array:
        """Filter the next ``n`` inputs, shape ``(n, k)``; outputs have shape ``(n, m)``."""


@dataclass
class FirState:
    """The last inputs of an ``FirFilter``, oldest first, shape ``(taps - 1, k)``; None before the first sample.

    ``FirFilter.new_state`` makes it, and ``advance`` updates it. Keep one per stream; the filter itself holds no state,
    so one filter serves any number of streams.
    """

    history: Array | None = None


class FirFilter:
    """A bank of finite-impulse-response filters: ``y[t, j] = sum over i, l of taps[j, i, l] * u[t - l, i]``.

    Moving averages, differences, one-sided Savitzky-Golay filters and every linear map of lagged samples are
    of this form.

    Args:
        taps: Shape ``(m, k, length)``: output, input, lag (0 is the present sample).

    Raises:
        ValueError: ``taps`` has another number of dimensions, is empty, or is not finite.

    Example:
        >>> import numpy as np
        >>> from cylinder_friction.signals.causal import FirFilter, moving_average_taps
        >>> average = FirFilter(moving_average_taps(4)[None, None, :])
        >>> average.run(np.array([[0.0], [4.0], [8.0]]))[:, 0].tolist()
        [0.0, 1.0, 3.0]
    """

    def __init__(self, taps: Array) -> None:
        taps = np.ascontiguousarray(taps, dtype=np.float64)
        if taps.ndim != 3 or taps.size == 0:
            raise ValueError(f"taps must have shape (outputs, inputs, lags), none of them zero, but got {taps.shape}")
        if not np.isfinite(taps).all():
            raise ValueError("taps must be finite numbers, but got NaN or infinity")
        self.taps = taps

    @property
    def length(self) -> int:
        """Number of lags, the present sample included."""
        return int(self.taps.shape[2])

    def new_state(self) -> FirState:
        return FirState()

    def advance(self, state: FirState, inputs: Array) -> Array:
        inputs = np.ascontiguousarray(inputs, dtype=np.float64)
        if len(inputs) == 0:
            return np.empty((0, self.taps.shape[0]))
        if state.history is None:
            state.history = np.repeat(inputs[:1], self.length - 1, axis=0)
        padded = np.concatenate([state.history, inputs])
        state.history = padded[len(padded) - (self.length - 1) :].copy()
        return _loops().fir(self.taps, padded)

    def run(self, inputs: Array) -> Array:
        """Filter a whole recording, from a fresh state."""
        return self.advance(self.new_state(), inputs)


@dataclass
class LowPassState:
    """The last output of an ``ExponentialLowPass``, shape ``(k,)``; None before the first sample.

    ``ExponentialLowPass.new_state`` makes it, and ``advance`` updates it. Keep one per stream.
    """

    output: Array | None = None


class ExponentialLowPass:
    """First-order low-pass, ``y[t] = y[t-1] + weight * (u[t] - y[t-1])``, on every column alike.

    Use it if a filter must cost two operations per sample. Its delay at low frequencies is ``1 / weight - 1`` samples.

    Args:
        weight: Share of the new sample, in (0, 1]; 1 lets everything through.

    Raises:
        ValueError: The weight is outside (0, 1].

    Example:
        >>> import numpy as np
        >>> from cylinder_friction.signals.causal import ExponentialLowPass
        >>> low_pass = ExponentialLowPass(0.5)
        >>> low_pass.advance(low_pass.new_state(), np.array([[0.0], [4.0], [4.0]]))[:, 0].tolist()
        [0.0, 2.0, 3.0]
    """

    def __init__(self, weight: float) -> None:
        if not 0.0 < weight <= 1.0:
            raise ValueError(f"weight must be in (0, 1], but got {weight!r}")
        self.weight = weight

    def new_state(self) -> LowPassState:
        return LowPassState()

    def advance(self, state: LowPassState, inputs: Array) -> Array:
        inputs = np.ascontiguousarray(inputs, dtype=np.float64)
        if len(inputs) == 0:
            return inputs.copy()
        if state.output is None:
            state.output = inputs[0].copy()
        return _loops().low_pass(self.weight, state.output, inputs)


def moving_average_taps(window: int) -> Array:
    """Build the ``window`` equal taps of a causal moving average; its delay is ``(window - 1) / 2`` samples.

    Use them in an ``FirFilter`` to smooth a signal, and in ``cascade_taps`` to smooth and differentiate in one filter.
    White noise shrinks by ``sqrt(window)``.

    Raises:
        ValueError: The window has no sample.

    Example:
        >>> from cylinder_friction.signals.causal import moving_average_taps
        >>> moving_average_taps(4).tolist()
        [0.25, 0.25, 0.25, 0.25]
    """
    if window < 1:
        raise ValueError(f"window must be at least 1 sample, but got {window!r}")
    return np.full(window, 1.0 / window)


def difference_taps(sample_time_s: float) -> Array:
    """Build the taps of the backward difference, per second.

    It turns positions [m] into velocities [m/s] half a sample late, and amplifies noise by ``1.4 / sample_time_s``:
    combine it with a moving average, by ``cascade_taps``, unless the position is free of noise.

    Example:
        >>> from cylinder_friction.signals.causal import difference_taps
        >>> difference_taps(0.005).tolist()
        [200.0, -200.0]
    """
    return np.array([1.0, -1.0]) / sample_time_s


def one_sided_savitzky_golay_taps(window: int, order: int, derivative: int, sample_time_s: float) -> Array:
    """Build taps that fit a polynomial to the last ``window`` samples and evaluate it at the present one.

    Args:
        window: Number of samples of the fit, greater than ``order``.
        order: Order of the polynomial.
        derivative: 0 for the value, 1 for the rate [1/s], 2 for the second derivative [1/s²].
        sample_time_s: Time between two samples [s].

    Source: Savitzky and Golay 1964, evaluated at the end point (Gorry 1990).

    Example:
        >>> from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps
        >>> one_sided_savitzky_golay_taps(window=5, order=1, derivative=1, sample_time_s=1.0).round(6).tolist()
        [0.2, 0.1, 0.0, -0.1, -0.2]
    """
    if not 0 <= derivative <= order < window:
        raise ValueError(
            f"one-sided Savitzky-Golay needs derivative <= order < window, but got derivative {derivative}, "
            f"order {order}, window {window}"
        )
    return np.array(_end_point_fit(window, order, derivative)) / sample_time_s**derivative


@lru_cache
def _end_point_fit(window: int, order: int, derivative: int) -> tuple[float, ...]:
    """Fit the taps for a sample time of 1. Exact fractions take milliseconds, so each fit is made once."""
    powers = [[Fraction((-lag) ** power) for power in range(order + 1)] for lag in range(window)]
    unit = [Fraction(int(power == derivative)) for power in range(order + 1)]
    gram = [[sum((row[i] * row[j] for row in powers), Fraction()) for j in range(order + 1)] for i in range(order + 1)]
    coefficients = _solved(gram, unit)
    fit = (sum(map(operator.mul, row, coefficients)) * math.factorial(derivative) for row in powers)
    return tuple(float(tap) for tap in fit)


def _solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Solve a few linear equations exactly (Gauss and Jordan), with the same result on every processor."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for pivot in range(len(rows)):
        rows[pivot] = [value / rows[pivot][pivot] for value in rows[pivot]]
        for other in range(len(rows)):
            if other != pivot:
                factor = rows[other][pivot]
                rows[other] = [a - factor * b for a, b in zip(rows[other], rows[pivot], strict=True)]
    return [row[-1] for row in rows]


def cascade_taps(*stages: Array) -> Array:
    """Combine one-input filters that run one after the other into the taps of a single filter.

    The single filter gives the chain's output up to rounding, with one state, and costs one multiplication per tap. Its
    length is the sum of the lengths less the number of stages, plus one.

    Example:
        >>> from cylinder_friction.signals.causal import cascade_taps, difference_taps, moving_average_taps
        >>> cascade_taps(moving_average_taps(2), difference_taps(1.0)).tolist()
        [0.5, 0.0, -0.5]
    """
    total = np.ones(1)
    for taps in stages:
        total = np.convolve(total, taps)
    return total

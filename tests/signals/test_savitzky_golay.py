from __future__ import annotations

from fractions import Fraction
from math import perm

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from cylinder_friction.signals.savitzky_golay import BLOCK_ROWS, savitzky_golay

FILTERS = [
    (11, 2, 0, 1.0),  # symmetric taps
    (21, 4, 1, 1.0),  # antisymmetric taps
    (21, 3, 1, 0.005),  # neither, to the last bit
    (41, 3, 2, 0.005),
    (1, 0, 0, 1.0),
    (3, 0, 0, 1.0),
    (101, 5, 2, 0.001),
]


def signal(rows: int) -> np.ndarray:
    return np.cumsum(np.random.default_rng(rows).normal(size=rows))


@pytest.mark.parametrize(("window", "order", "derivative", "step_s"), FILTERS)
@pytest.mark.parametrize("beyond", [0, 1, 7, BLOCK_ROWS - 1, BLOCK_ROWS, 3 * BLOCK_ROWS + 5])
def test_scipy_s_figures(window: int, order: int, derivative: int, step_s: float, beyond: int) -> None:
    values = signal(window + beyond)
    expected = savgol_filter(values, window, order, deriv=derivative, delta=step_s)
    got = savitzky_golay(values, window, order, derivative, step_s)
    whole = slice(window // 2, len(values) - window // 2)
    np.testing.assert_array_equal(got[whole], expected[whole])
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(("window", "order", "derivative", "step_s"), FILTERS)
def test_edges_are_the_fitted_polynomial_s(window: int, order: int, derivative: int, step_s: float) -> None:
    values = signal(window)
    powers = [[Fraction(place) ** power for power in range(order + 1)] for place in range(window)]
    weights = solved(
        [[sum(row[i] * row[j] for row in powers) for j in range(order + 1)] for i in range(order + 1)],
        [sum(row[i] * Fraction(value) for row, value in zip(powers, values, strict=True)) for i in range(order + 1)],
    )
    exact = np.array(
        [
            float(
                sum(
                    weights[power] * perm(power, derivative) * Fraction(place) ** (power - derivative)
                    for power in range(derivative, order + 1)
                )
            )
            for place in range(window)
        ]
    )
    got = savitzky_golay(values, window, order, derivative, step_s) * step_s**derivative
    edges = np.delete(np.arange(window), window // 2)
    np.testing.assert_allclose(got[edges], exact[edges], rtol=0.0, atol=1e-12 * np.abs(exact).max())


def solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Return the exact solution of a system of linear equations, by elimination."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for at, pivot in enumerate(rows):
        for place, row in enumerate(rows):
            if place != at:
                factor = row[at] / pivot[at]
                rows[place] = [value - factor * own for value, own in zip(row, pivot, strict=True)]
    return [row[-1] / row[at] for at, row in enumerate(rows)]


@given(st.integers(0, 3 * BLOCK_ROWS))
def test_an_impulse_touches_its_window_only(place: int) -> None:
    values = np.zeros(3 * BLOCK_ROWS + 1)
    values[place] = 1.0
    touched = np.flatnonzero(savitzky_golay(values, 21, 3, 1, 0.005))
    assert len(touched)
    first, last = 10, len(values) - 11  # the outermost rows look at a whole window
    assert all(abs(min(max(row, first), last) - place) <= 10 for row in touched)


def test_any_layout_gives_the_same() -> None:
    samples = np.random.default_rng(3).normal(size=(5000, 3))
    read_only = np.ascontiguousarray(samples[:, 1])
    read_only.flags.writeable = False
    expected = savitzky_golay(read_only.copy(), 41, 3, 2, 0.005)
    for values in (samples[:, 1], read_only, samples[::-1, 1][::-1]):
        np.testing.assert_array_equal(savitzky_golay(values, 41, 3, 2, 0.005), expected)


def test_too_short_a_signal_is_refused() -> None:
    with pytest.raises(ValueError, match="got 20 samples, but Savitzky-Golay needs at least its window of 21"):
        savitzky_golay(np.zeros(20), 21, 3)

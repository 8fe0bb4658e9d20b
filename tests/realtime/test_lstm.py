"""tanh and the logistic function against the mathematics library's in double precision."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from cylinder_friction.realtime.lstm import sigmoid, tanh


@numba.njit
def _every(function, values: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
    result = np.empty_like(values)
    for index in range(len(values)):
        result[index] = function(values[index])
    return result


VALUES = np.concatenate(
    [np.linspace(-12.0, 12.0, 400_001), np.geomspace(1e-40, 1e38, 2001), -np.geomspace(1e-40, 1e38, 2001)]
).astype(np.float32)


@pytest.mark.parametrize(
    ("function", "exact", "largest"), [(tanh, np.tanh, 4e-7), (sigmoid, lambda x: 0.5 + 0.5 * np.tanh(0.5 * x), 3e-7)]
)
def test_it_is_right_to_single_precision(function, exact, largest: float) -> None:  # type: ignore[no-untyped-def]
    got = _every(function, VALUES)
    assert got.dtype == np.float32
    assert np.abs(got - exact(VALUES.astype(np.float64))).max() < largest

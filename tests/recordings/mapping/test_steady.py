from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.mapping.steady import averaged, longest_steady, mean_uncertainty


def brute_force(signals: np.ndarray, spans: np.ndarray, bounds: np.ndarray) -> tuple[int, int]:
    best = (0, 0)
    for first in range(len(signals)):
        for end in range(first + 1, len(signals) + 1):
            part = signals[first:end]
            if (
                np.all(np.abs(part) <= bounds)
                and np.all(np.ptp(part, axis=0) <= spans)
                and end - first > best[1] - best[0]
            ):
                best = (first, end)
    return best


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9) | st.just(None)), max_size=24))
def test_longest_stretch_is_the_one_that_trying_them_all_finds(rows: list[tuple[int, int | None]]) -> None:
    signals = np.array([[a, np.nan if b is None else b] for a, b in rows], dtype=np.float64).reshape(-1, 2)
    spans, bounds = np.array([3.0, 5.0]), np.array([np.inf, 7.0])
    with np.errstate(invalid="ignore"):
        expected = brute_force(signals, spans, bounds)
    assert longest_steady(signals, spans, bounds) == expected


def test_uncertainty_of_white_noise_is_sigma_over_root_n() -> None:
    values = np.random.default_rng(3).normal(7.0, 2.0, 4096)
    # The largest of several estimates of the same figure is a little above it.
    assert 2.0 / 64.0 * 0.95 < mean_uncertainty(values) < 2.0 / 64.0 * 1.8


@pytest.mark.parametrize("memory", [0.9, 0.98])
def test_uncertainty_covers_autocorrelated_noise(memory: float) -> None:
    rng = np.random.default_rng(4)
    means, stated = [], []
    for _ in range(60):
        noise = np.empty(4096)
        noise[0] = 0.0
        kicks = rng.normal(0.0, 1.0, 4096)
        for row in range(1, 4096):
            noise[row] = memory * noise[row - 1] + kicks[row]
        means.append(noise.mean())
        stated.append(mean_uncertainty(noise))
    # As if independent it would be too small by √((1+0.9)/(1-0.9)) = 4.4 and more.
    assert 0.85 < np.mean(stated) / np.std(means) < 1.8


def test_constant_and_short_readings_show_no_scatter() -> None:
    assert mean_uncertainty(np.full(1000, 3.3)) == 0.0
    assert mean_uncertainty(np.array([1.0, 2.0])) == 0.0


def test_averages_are_centred_and_shorter_at_the_ends() -> None:
    signals = np.column_stack([np.arange(6.0) ** 2 + 1e9, np.ones(6)])
    result = averaged(signals, 1)
    np.testing.assert_allclose(result[:, 0] - 1e9, [0.5, 5 / 3, 14 / 3, 29 / 3, 50 / 3, 20.5], rtol=1e-6)
    assert np.array_equal(result[:, 1], np.ones(6))
    assert averaged(signals, 0) is signals

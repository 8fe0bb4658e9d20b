import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.signals.noise import noise_deviation


@given(st.integers(0, 1000), st.floats(0.1, 1e6))
def test_the_deviation_of_white_noise(seed: int, scale: float) -> None:
    noise = scale * np.random.default_rng(seed).normal(size=8000)
    assert noise_deviation(noise) == pytest.approx(scale, rel=0.12)


def test_steps_and_ramps_are_not_noise() -> None:
    time_s = 0.005 * np.arange(8000)
    signal = 400.0 * np.sign(np.sin(2.0 * time_s)) + 50.0 * time_s
    noise = 20.0 * np.random.default_rng(3).normal(size=len(signal))
    assert noise_deviation(signal + noise) == pytest.approx(20.0, rel=0.05)


def test_noise_that_a_logger_filtered_counts_by_what_it_leaves_in_means() -> None:
    white = np.random.default_rng(4).normal(size=16000)
    filtered = np.convolve(white, np.full(3, 1.0 / 3.0), mode="same")
    assert np.std(filtered) == pytest.approx(3.0**-0.5, rel=0.03)
    assert noise_deviation(filtered) > 0.75, "means over long windows are as noisy as those of the white noise"


def test_a_signal_without_noise_has_none() -> None:
    assert noise_deviation(np.zeros(100)) == 0.0
    assert noise_deviation(np.arange(2.0)) == 0.0

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.arrays import Array
from cylinder_friction.signals.zero_phase import AdaptiveWindow, SavitzkyGolay

STEP_S, NOISE_N = 0.005, 20.0
ADAPTIVE = AdaptiveWindow(3.1e-3, 2.5e-3)
TIME_S = STEP_S * np.arange(4000)
STEPS_N = 300.0 * np.sign(np.sin(2.0 * np.pi * 0.31 * TIME_S))
SEED = st.integers(0, 10_000)


def noisy(force_n: Array, seed: int = 1) -> Array:
    return force_n + NOISE_N * np.random.default_rng(seed).normal(size=len(force_n))


def near_steps(width: int = 20) -> Any:
    return np.convolve(np.abs(np.diff(STEPS_N, prepend=STEPS_N[0])) > 0.0, np.ones(2 * width + 1), mode="same") > 0.5


@given(SEED)
@settings(deadline=None)
def test_it_is_nearer_to_a_force_with_steps_than_a_polynomial(seed: int) -> None:
    force_n = noisy(STEPS_N, seed)
    adaptive, polynomial = (each.smooth_force(force_n, STEP_S) for each in (ADAPTIVE, SavitzkyGolay()))
    near = near_steps()
    for rows, share in ((near, 0.95), (~near, 0.6)):
        assert np.abs(adaptive - STEPS_N)[rows].mean() < share * np.abs(polynomial - STEPS_N)[rows].mean()


@given(SEED)
@settings(deadline=None)
def test_windows_end_before_a_step(seed: int) -> None:
    step_n = np.where(TIME_S < 10.0, 0.0, 500.0)
    smooth_n = ADAPTIVE.smooth_force(noisy(step_n, seed), STEP_S)
    beside = np.abs(TIME_S - 10.0) < ADAPTIVE.shortest_s + STEP_S
    assert np.abs(smooth_n - step_n)[~beside].max() < 3.5 * NOISE_N, "no mean over both sides of the step"


@given(SEED)
@settings(deadline=None)
def test_the_deviation_holds_the_error(seed: int) -> None:
    force_n = noisy(STEPS_N + 60.0 * np.sin(3.0 * TIME_S), seed)
    error_n = ADAPTIVE.smooth_force(force_n, STEP_S) - STEPS_N - 60.0 * np.sin(3.0 * TIME_S)
    held = np.abs(error_n) < 2.0 * ADAPTIVE.deviation(force_n, STEP_S)
    assert held.mean() > 0.85
    assert held[near_steps()].mean() > 0.8


def test_a_constant_force_is_averaged_over_the_longest_windows() -> None:
    windows = ADAPTIVE.windows(noisy(np.zeros(4000)), STEP_S)
    assert np.median(windows.before) == np.median(windows.after) == 41
    assert windows.residual_noise()[2000] == pytest.approx(NOISE_N / 9.0, rel=0.35)


def test_backwards_in_time_is_the_mirror_image() -> None:
    force_n = noisy(STEPS_N)
    there, back = ADAPTIVE.smooth_force(force_n, STEP_S), ADAPTIVE.smooth_force(force_n[::-1].copy(), STEP_S)
    np.testing.assert_allclose(back[::-1], there, atol=1e-6)


def test_pressures_share_the_windows_of_their_force() -> None:
    generator = np.random.default_rng(2)
    common_pa = 2e6 * np.sin(40.0 * TIME_S)
    p1 = 1e6 + common_pa * 2.5 / 3.1 + 5e3 * generator.normal(size=len(TIME_S)) + STEPS_N / 3.1e-3
    p2 = 1e6 + common_pa + 5e3 * generator.normal(size=len(TIME_S))
    smooth = ADAPTIVE.smooth(np.column_stack([p1, p2, 0.1 + 0.01 * TIME_S]), STEP_S)
    force_n = smooth.pressure_1_smooth_pa * 3.1e-3 - smooth.pressure_2_smooth_pa * 2.5e-3
    np.testing.assert_allclose(force_n, ADAPTIVE.smooth_force(p1 * 3.1e-3 - p2 * 2.5e-3, STEP_S), atol=1e-6)
    assert np.abs(force_n - (STEPS_N + 600.0))[~near_steps()].mean() < 6.0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"shortest_s": 0.3}, r"expected 0 < shortest_s <= longest_s, but got shortest_s 0\.3 and longest_s 0\.2"),
        ({"shortest_s": 0.0}, "but got shortest_s 0.0"),
        ({"confidence": 0.0}, r"expected a positive confidence, but got 0\.0"),
    ],
)
def test_impossible_settings_are_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        AdaptiveWindow(3.1e-3, 2.5e-3, **wrong)

import numpy as np
import pytest

from cylinder_friction.signals.causal_velocity import CausalVelocity

SAMPLE_TIME_S = 0.005


def velocity_of(sense: CausalVelocity, position_m: np.ndarray) -> np.ndarray:
    block = sense.block(SAMPLE_TIME_S)
    return block.advance(block.new_state(), position_m[:, None])


def measured(position_m: np.ndarray, seed: int = 0) -> np.ndarray:
    noisy = position_m + np.random.default_rng(seed).normal(0.0, 30e-6, len(position_m))
    return np.round(noisy / 61e-6) * 61e-6


@pytest.mark.parametrize("sense", [CausalVelocity(15, 1, 8e-5, 0.0), CausalVelocity(21, 1, 0.0, 1e-3)])
def test_noise_at_standstill_is_no_motion(sense: CausalVelocity) -> None:
    velocity = velocity_of(sense, measured(np.full(4000, 0.1)))
    assert np.mean(velocity != 0.0) < 0.02


def test_the_play_lets_creep_through_that_a_dead_band_swallows() -> None:
    creep = measured(0.1 + 7e-4 * SAMPLE_TIME_S * np.arange(2000))
    with_play = velocity_of(CausalVelocity(15, 1, 8e-5, 0.0), creep)[400:]
    assert with_play.mean() == pytest.approx(7e-4, rel=0.15)
    with_dead_band = velocity_of(CausalVelocity(21, 1, 0.0, 1e-3), creep)[400:]
    assert with_dead_band.mean() < 3e-4


@pytest.mark.parametrize("backlash_m", [0.0, 4e-5])
def test_fast_motion_passes_unchanged(backlash_m: float) -> None:
    velocity = velocity_of(CausalVelocity(11, 1, backlash_m, 0.0), 0.1 - 0.05 * SAMPLE_TIME_S * np.arange(200))
    np.testing.assert_allclose(velocity[20:], -0.05, rtol=1e-9)

"""Motion behind a backlash: zero at standstill, and a sudden stop does not reverse the direction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friction_benchmark.models.steady_motion import SteadyMotion

STEP_S = 0.005


def moved(speeds_m_s: list[float], rows: int = 400, seed: int = 0) -> np.ndarray:
    speeds = np.repeat(speeds_m_s, rows)
    noise = np.random.default_rng(seed).normal(0.0, 3e-5, len(speeds))
    lsb = 0.25 / 4096
    position_m = np.round((0.1 + np.cumsum(speeds) * STEP_S + noise) / lsb) * lsb
    motion = SteadyMotion(STEP_S)
    return motion.advance(motion.new_state(), position_m[:, None])


def test_noise_and_quantisation_at_standstill_are_no_motion() -> None:
    found = moved([0.0], rows=20_000)
    assert (found[:, 0] == 0.0).all()
    assert (found[:, 1] == 0.0).all()


@settings(max_examples=25, deadline=None)
@given(speed=st.floats(0.004, 0.15), way=st.sampled_from([-1.0, 1.0]), seed=st.integers(0, 50))
def test_a_stop_at_once_keeps_the_direction_and_ends_the_motion(speed: float, way: float, seed: int) -> None:
    found = moved([0.0, way * speed, 0.0], rows=500, seed=seed)
    assert found[540:990, 0].mean() == pytest.approx(way * speed, rel=0.05)
    assert (found[1150:, 0] == 0.0).all()
    assert (found[540:, 1] == way).all()


def test_cutting_the_input_changes_no_bit() -> None:
    position_m = 0.1 + 0.02 * np.sin(0.02 * np.arange(900))[:, None]
    motion = SteadyMotion(STEP_S)
    whole = motion.advance(motion.new_state(), position_m)
    state = motion.new_state()
    pieces = [motion.advance(state, position_m[a:b]) for a, b in ((0, 1), (1, 350), (350, 350), (350, 900))]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)

"""Motion behind a backlash, and friction from the direction of the last motion, against levels that are known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from friction_benchmark.models.baselines import SITUATIONS, ByDirection
from friction_benchmark.models.steady_motion import causal_motion, steady_motion

SPEED_M_S, STEP_S = 0.02, 0.005


def moved(speeds_m_s: list[float], rows: int = 400, seed: int = 0) -> np.ndarray:
    """Return the position [m] of a 12-bit potentiometer with noise, at these speeds for so many rows each."""
    speeds = np.repeat(speeds_m_s, rows)
    noise = np.random.default_rng(seed).normal(0.0, 3e-5, len(speeds))
    lsb = 0.25 / 4096
    return np.round((0.1 + np.cumsum(speeds) * STEP_S + noise) / lsb) * lsb


def test_noise_and_quantisation_at_standstill_are_no_motion() -> None:
    assert (steady_motion(moved([0.0], rows=20_000), STEP_S) == 0.0).all()


@settings(max_examples=15, deadline=None)
@given(speed=st.floats(0.004, 0.15), way=st.sampled_from([-1.0, 1.0]), seed=st.integers(0, 50))
def test_a_stop_at_once_keeps_the_direction_and_ends_the_motion(speed: float, way: float, seed: int) -> None:
    position = moved([0.0, way * speed, 0.0], rows=500, seed=seed)
    for velocity, direction in (
        steady_motion(position, STEP_S).T,
        causal_motion(position, STEP_S)[:, [0, 2]].T,
    ):
        assert velocity[540:990].mean() == pytest.approx(way * speed, rel=0.05)
        assert (velocity[1150:] == 0.0).all()
        assert (direction[540:] == way).all()


def test_the_memory_of_a_motion_fades_with_speed_and_comes_back_at_rest() -> None:
    memory = causal_motion(moved([0.0, 0.1, 0.0]), STEP_S)[:, 3]
    assert memory[390] == pytest.approx(1.0)
    assert memory[790] < 0.01
    assert memory[1190] > 0.98


def stroke_recording(viscous_n_s_m: float = 0.0) -> Recording:
    """Rest 1 s, out 2 s, rest 2 s, in 2 s at twice the speed, rest 2 s; friction 7, +300, +100, -250 and -60 N."""
    speeds = np.repeat([0.0, SPEED_M_S, 0.0, -2.0 * SPEED_M_S, 0.0], [200, 400, 400, 400, 400])
    levels = np.repeat([7.0, 300.0, 100.0, -250.0, -60.0], [200, 400, 400, 400, 400])
    noise = np.random.default_rng(0).normal(0.0, 3e-5, len(speeds))
    table = pd.DataFrame(
        {
            "time_s": STEP_S * np.arange(len(speeds)),
            "pressure_1_pa": 0.0,
            "pressure_2_pa": 0.0,
            "position_m": 0.1 + np.cumsum(speeds) * STEP_S + noise,
            "friction_n": levels + viscous_n_s_m * speeds,
        }
    )
    return Recording(RecordingMetadata("strokes", "1", "s", STEP_S), table)


def test_constants_are_the_medians_of_each_situation() -> None:
    model = ByDirection(("position_m",), viscous=False).fit([stroke_recording()])
    assert model.levels_n.tolist() == pytest.approx([300.0, -250.0, 100.0, -60.0, 7.0])
    assert set(model.estimate(stroke_recording())[760:1000]) == {100.0}, "noise at standstill turns no direction"


def test_the_line_finds_coulomb_and_viscous_friction() -> None:
    recording = stroke_recording(viscous_n_s_m=1500.0)
    settled = np.ones(len(recording), dtype=bool)
    for change in (200, 600, 1000, 1400):
        settled[change - 30 : change + 120] = False
    model = ByDirection(("position_m",), viscous=True).fit([recording.with_columns(usable=settled)])
    # One speed in each direction determines level and slope only together: check the fitted line.
    assert model.levels_n[0] + SPEED_M_S * model.viscous_n_s_m == pytest.approx(330.0, abs=3.0)
    assert model.levels_n[1] - 2.0 * SPEED_M_S * model.viscous_n_s_m == pytest.approx(-310.0, abs=3.0)


@pytest.mark.parametrize("viscous", [False, True])
def test_a_situation_that_never_occurs_gets_zero(viscous: bool) -> None:
    recording = stroke_recording()
    still = Recording(recording.metadata, recording.table.iloc[:150].reset_index(drop=True))
    levels = ByDirection(("position_m",), viscous=viscous).fit([still]).levels_n
    np.testing.assert_allclose(levels, [0.0] * (len(SITUATIONS) - 1) + [7.0], atol=1e-9)

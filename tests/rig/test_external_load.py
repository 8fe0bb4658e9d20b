"""Loads on the rod: what they are by themselves, and what they do to the rig."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.rig.external_load import LARGEST_N, ExternalLoad, load_at, varied_load
from cylinder_friction.rig.parameters import RigParameters
from cylinder_friction.rig.simulate import balanced_state, simulate

STROKE_M = 0.25


def test_a_load_is_straight_between_its_values_and_held_beyond_them() -> None:
    force_n, share, along_n = np.array([0.0, 100.0]), np.array([1.0, 1.0]), np.array([0.0, 500.0, 600.0])

    def at(time_s: float, position_m: float) -> float:
        return load_at(force_n, share, along_n, time_s, position_m, STROKE_M)

    assert at(0.0005, 0.0) == pytest.approx(50.0)
    assert at(0.0, 0.0625) == pytest.approx(250.0)
    assert at(0.0, 0.1875) == pytest.approx(550.0)
    assert at(5.0, 0.3) == pytest.approx(700.0)
    assert at(-1.0, -0.1) == pytest.approx(0.0)
    assert ExternalLoad(force_n, share, along_n).at_start(0.125, STROKE_M) == pytest.approx(500.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31 - 1), st.floats(5.0, 60.0))
def test_varied_loads_keep_to_three_kilonewtons_and_change(seed: int, seconds: float) -> None:
    load = varied_load(np.random.default_rng(seed), round(seconds, 3), STROKE_M)
    for along in (load.along_n.min(), load.along_n.max()):
        assert np.abs(load.force_n + load.share * along).max() <= LARGEST_N + 1e-9
    assert np.ptp(load.force_n) > 0.0


def test_no_load_and_a_load_of_zero_are_the_same_to_the_bit(rigs: dict[str, RigParameters]) -> None:
    lever, start = np.full(2010, 0.5), balanced_state(rigs["2"], 0.1, 8e5, 35.0)
    without = simulate(rigs["2"], lever, start, 2.0)
    with_zero = simulate(rigs["2"], lever, start, 2.0, external_force=ExternalLoad.of_time(np.zeros(len(lever))))
    pd.testing.assert_frame_equal(without, with_zero, check_exact=True)
    assert (without["load_force_n"] == 0.0).all()


@pytest.mark.parametrize("load_n", [-2500.0, 0.0, 3000.0])
def test_a_balanced_start_carries_the_load_at_rest(rigs: dict[str, RigParameters], load_n: float) -> None:
    rig = replace(rigs["1"], hydraulics=replace(rigs["1"].hydraulics, leakage_m3_s_pa=0.0))
    start = balanced_state(rig, 0.1, 8e5, 35.0, load_n)
    trace = simulate(rig, np.zeros(3002), start, 3.0, external_force=ExternalLoad.of_time(np.full(3002, load_n)))
    assert min(start.pressure_1_pa, start.pressure_2_pa) >= 2e5 - 1e-6
    assert (trace["position_m"] - 0.1).abs().max() < 1e-9
    assert trace["friction_n"].abs().max() < 1e-3


def test_anti_cavitation_valves_keep_a_pulling_load_from_a_vacuum(rigs: dict[str, RigParameters]) -> None:
    bare = rigs["1"]
    fitted = replace(bare, hydraulics=replace(bare.hydraulics, makeup_gain=2e-6))
    time_s = 0.001 * np.arange(2010)
    lever, pull = np.clip((time_s - 0.1) / 0.2, 0.0, 1.0), ExternalLoad.of_time(np.full(2010, -2800.0))
    start = balanced_state(bare, 0.05, 8e5, 35.0, -2800.0)
    lowest = [simulate(rig, lever, start, 2.0, external_force=pull)["pressure_1_pa"].min() for rig in (bare, fitted)]
    assert lowest[1] > -0.7e5
    assert lowest[1] > lowest[0] + 0.1e5

"""Loads on the rod: what they are by themselves, and what they do to the rig."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cylinder_friction.rig.external_load import LARGEST_N, ExternalLoad, boom_n, load_at, varied_load
from cylinder_friction.rig.parameters import RigParameters
from cylinder_friction.rig.simulate import balanced_state, simulate
from rig_reference import solve_reference

STROKE_M = 0.25


def reversing(seconds: float, level: float = 0.5) -> NDArray[np.float64]:
    """Return a lever swung to and fro."""
    time_s = 0.001 * np.arange(round((seconds + 0.01) / 0.001))
    swing = np.sin(2.0 * np.pi * 1.1 * (time_s - 0.05)) * np.clip((time_s - 0.05) / 0.2, 0.0, 1.0)
    return np.asarray(level * swing)


def boom_with_steps(seconds: float) -> ExternalLoad:
    ticks = round(seconds * 1000) + 10
    steps = np.interp(np.arange(ticks), [0, 700, 900, 1500, 1600], [200.0, 200.0, -400.0, -400.0, 600.0])
    return ExternalLoad(steps, np.ones(ticks), boom_n(np.random.default_rng(3), STROKE_M))


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
    assert len(load.force_n) == len(load.share) == round(round(seconds, 3) * 1000) + 2
    here, there = load.along_n.min(), load.along_n.max()
    for along in (here, there):
        assert np.abs(load.force_n + load.share * along).max() <= LARGEST_N + 1e-9
    assert np.ptp(load.force_n) > 0.0
    again = varied_load(np.random.default_rng(seed), round(seconds, 3), STROKE_M)
    assert np.array_equal(again.force_n, load.force_n)


def test_loads_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected force_n and share of one length .* but got shapes \(3,\), \(2,\)"):
        ExternalLoad(np.zeros(3), np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match=r"along_n: expected at least 2 values, but got 1"):
        ExternalLoad(np.zeros(3), np.zeros(3), np.zeros(1))
    with pytest.raises(ValueError, match=r"expected finite forces, but got NaN or infinity"):
        ExternalLoad.of_time(np.array([0.0, np.nan]))


def test_a_load_that_ends_too_soon_is_refused(rigs: dict[str, RigParameters]) -> None:
    start = balanced_state(rigs["1"], 0.1, 8e5, 35.0)
    with pytest.raises(ValueError, match=r"external_force: got 500 values, but 1\.0 s need 1002, one each millisecond"):
        simulate(rigs["1"], np.zeros(1002), start, 1.0, external_force=np.zeros(500))


def test_no_load_and_a_load_of_zero_are_the_same_to_the_bit(rigs: dict[str, RigParameters]) -> None:
    lever, start = reversing(2.0), balanced_state(rigs["2"], 0.1, 8e5, 35.0)
    without = simulate(rigs["2"], lever, start, 2.0)
    with_zero = simulate(rigs["2"], lever, start, 2.0, external_force=np.zeros(len(lever)))
    pd.testing.assert_frame_equal(without, with_zero, check_exact=True)
    assert (without["load_force_n"] == 0.0).all()


@pytest.mark.parametrize("load_n", [-2500.0, -800.0, 1500.0, 3000.0])
def test_a_balanced_start_carries_the_load_at_rest(rigs: dict[str, RigParameters], load_n: float) -> None:
    rig = replace(rigs["1"], hydraulics=replace(rigs["1"].hydraulics, leakage_m3_s_pa=0.0))
    start = balanced_state(rig, 0.1, 8e5, 35.0, load_n)
    trace = simulate(rig, np.zeros(3002), start, 3.0, external_force=np.full(3002, load_n))
    assert min(start.pressure_1_pa, start.pressure_2_pa) >= 2e5 - 1e-6
    assert (trace["position_m"] - 0.1).abs().max() < 1e-9
    assert trace["friction_n"].abs().max() < 1e-3


def test_a_loaded_rig_agrees_with_the_stiff_reference_solver(rigs: dict[str, RigParameters]) -> None:
    rig, seconds = rigs["2"], 1.8
    rig = replace(rig, hydraulics=replace(rig.hydraulics, makeup_gain=2e-6))
    load, lever = boom_with_steps(seconds), reversing(seconds)
    start = balanced_state(rig, 0.12, 10e5, 35.0, load.at_start(0.12, STROKE_M))
    found = simulate(rig, lever, start, seconds, external_force=load)
    reference = solve_reference(rig, lever, start, seconds, 1e-6, external_force=load)
    assert reference["velocity_m_s"].max() > 0.02
    assert reference["velocity_m_s"].min() < -0.02
    for column, mean in (("pressure_1_pa", 5e3), ("velocity_m_s", 1e-4), ("position_m", 2e-5), ("friction_n", 1.5)):
        assert (found[column] - reference[column]).abs().mean() < mean, column


def test_anti_cavitation_valves_keep_a_pulling_load_from_a_vacuum(rigs: dict[str, RigParameters]) -> None:
    bare = rigs["1"]
    fitted = replace(bare, hydraulics=replace(bare.hydraulics, makeup_gain=2e-6))
    time_s = 0.001 * np.arange(2010)
    lever, pull_n = np.clip((time_s - 0.1) / 0.2, 0.0, 1.0), np.full(2010, -2800.0)
    start = balanced_state(bare, 0.05, 8e5, 35.0, -2800.0)
    lowest = [simulate(rig, lever, start, 2.0, external_force=pull_n)["pressure_1_pa"].min() for rig in (bare, fitted)]
    assert lowest[1] > -0.7e5
    assert lowest[1] > lowest[0] + 0.1e5

"""Physics of the whole rig: balances, limits, and agreement with a stiff reference solver."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.hydraulics import bulk_modulus
from cylinder_friction.rig.parameters import PUMP_FLOWS_M3_S, RigParameters, default_rig, hydraulic_constants
from cylinder_friction.rig.simulate import balanced_state, simulate
from rig_reference import solve_reference

TESTS = ("1", "2", "3", "4")


def held(level: float, seconds: float, after_s: float = 0.3) -> np.ndarray:
    """Return a lever that is pulled at 0.1 s and held."""
    time_s = 0.001 * np.arange(round((seconds + 0.01) / 0.001))
    return level * np.clip((time_s - 0.1) / (after_s - 0.1), 0.0, 1.0)


def reversing(seconds: float) -> np.ndarray:
    """Return a lever swung to and fro, then let go."""
    time_s = 0.001 * np.arange(round((seconds + 0.01) / 0.001))
    lever = 0.5 * np.sin(2.0 * np.pi * 1.1 * (time_s - 0.05)) * np.clip((time_s - 0.05) / 0.2, 0.0, 1.0)
    return np.where(time_s < 0.8 * seconds, lever, 0.0)


@pytest.mark.parametrize("condition", ["1", "3"])
def test_fixed_step_agrees_with_the_stiff_reference_solver_over_reversals(
    rigs: dict[str, RigParameters], condition: str
) -> None:
    rig, seconds = rigs[condition], 2.2
    lever, start = reversing(seconds), balanced_state(rigs[condition], 0.12, 10e5, 35.0)
    found, reference = simulate(rig, lever, start, seconds), solve_reference(rig, lever, start, seconds, 1e-6)
    velocity = reference["velocity_m_s"]
    assert velocity.max() > 0.03
    assert velocity.min() < -0.03
    moves = np.sign(velocity[velocity.abs() > 1e-3])
    assert int((np.diff(moves) != 0).sum()) >= 3

    def apart(column: str) -> tuple[float, float]:
        difference = (found[column] - reference[column]).abs()
        return float(difference.mean()), float(difference.max())

    for column, mean, worst in (
        ("pressure_1_pa", 5e3, 4e4),
        ("pressure_2_pa", 5e3, 4e4),
        ("velocity_m_s", 1e-4, 1.5e-3),
        ("position_m", 2e-5, 5e-5),
        ("friction_n", 1.0, 15.0),
    ):
        assert apart(column)[0] < mean, column
        assert apart(column)[1] < worst, column


@pytest.mark.parametrize("fill_pa", [2e5, 20e5])
def test_nothing_moves_while_the_lever_rests_but_by_leakage(rigs: dict[str, RigParameters], fill_pa: float) -> None:
    rig, lever = rigs["1"], np.zeros(10_002)
    tight = replace(rig, hydraulics=replace(rig.hydraulics, leakage_m3_s_pa=0.0))
    start = balanced_state(rig, 0.1, fill_pa, 35.0)
    assert (simulate(tight, lever, start, 10.0)["position_m"] - 0.1).abs().max() < 1e-9
    leaking = simulate(rig, lever, start, 10.0)
    leak_m3 = rig.hydraulics.leakage_m3_s_pa / 0.8 * (start.pressure_2_pa - start.pressure_1_pa) * 10.0
    assert (leaking["position_m"] - 0.1).abs().max() < leak_m3 / rig.hydraulics.annulus_area_m2


@pytest.mark.parametrize("condition", TESTS)
def test_oil_volume_is_balanced(
    traces: dict[str, pd.DataFrame], rigs: dict[str, RigParameters], condition: str
) -> None:
    trace, y = traces[condition], hydraulic_constants(rigs[condition].hydraulics)
    sides = (
        (1, y.dead_volume_1_m3 + y.piston_area_m2 * trace["position_m"], y.piston_area_m2),
        (2, y.dead_volume_2_m3 + y.annulus_area_m2 * (y.stroke_m - trace["position_m"]), -y.annulus_area_m2),
    )
    for side, chamber_m3, area_m2 in sides:
        pressure = trace[f"pressure_{side}_pa"].to_numpy()
        middle = 0.5 * (pressure[1:] + pressure[:-1])
        modulus = np.array([bulk_modulus(y, value) for value in middle])
        squeezed = np.diff(pressure) / modulus * 0.5 * (chamber_m3.to_numpy()[1:] + chamber_m3.to_numpy()[:-1])
        displaced = area_m2 * np.diff(trace["position_m"])
        entered = np.diff(trace[f"volume_{side}_m3"])
        turned_over = np.abs(displaced).sum()
        assert abs((entered - displaced - squeezed).sum()) < 1e-3 * turned_over


@pytest.mark.parametrize("condition", TESTS)
def test_force_balance_holds_in_steady_motion(
    traces: dict[str, pd.DataFrame], rigs: dict[str, RigParameters], condition: str
) -> None:
    trace, y = traces[condition], rigs[condition].hydraulics
    oil = trace["pressure_1_pa"] * y.piston_area_m2 - trace["pressure_2_pa"] * y.annulus_area_m2
    residual = oil + trace["stop_force_n"] - trace["friction_n"]
    acceleration = np.gradient(trace["velocity_m_s"], 0.001)
    calm = (np.abs(acceleration) < 0.1) & (trace["velocity_m_s"].abs() > 0.003)
    assert calm.mean() > 0.2
    assert np.abs(residual[calm]).mean() < 1.0
    assert np.abs(residual - y.mass_kg * acceleration).mean() < 2.0


@pytest.mark.parametrize("condition", TESTS)
def test_friction_takes_energy_out_of_sliding_motion(traces: dict[str, pd.DataFrame], condition: str) -> None:
    power = traces[condition]["friction_n"] * traces[condition]["velocity_m_s"]
    # After a reversal the elements first give back what they stored, over some hundred micrometres.
    travelled = traces[condition]["velocity_m_s"].abs().rolling(100).min()
    assert (power[travelled > 2e-3] > 0.0).all()
    assert power.sum() > 0.0
    given_back = -power[power < 0.0].sum() / power[power > 0.0].sum()
    assert given_back < 0.02


@pytest.mark.parametrize("condition", TESTS)
def test_pressures_keep_between_cavitation_and_the_boosted_supply(
    traces: dict[str, pd.DataFrame], rigs: dict[str, RigParameters], condition: str
) -> None:
    trace, y = traces[condition], rigs[condition].hydraulics
    relief_pa = y.relief_factor * y.pump_pressure_pa
    boosted_pa = relief_pa * y.piston_area_m2 / y.annulus_area_m2
    assert trace[["pressure_1_pa", "pressure_2_pa"]].to_numpy().min() > -1.0e5
    assert trace["supply_pressure_pa"].max() < 1.05 * relief_pa
    assert trace["pressure_1_pa"].max() < 1.05 * boosted_pa
    assert trace["pressure_2_pa"].max() < 1.05 * boosted_pa


@pytest.mark.parametrize("level", [1.0, -1.0])
def test_an_end_stop_holds_and_its_cushion_brakes(rigs: dict[str, RigParameters], level: float) -> None:
    rig = rigs["1"]
    trace = simulate(rig, held(level, 9.0), balanced_state(rig, 0.125, 8e5, 35.0), 9.0)
    beyond_m = np.maximum(-trace["position_m"], trace["position_m"] - rig.hydraulics.stroke_m)
    assert 0.0 < beyond_m.max() < 3e-4
    first_touch = int((beyond_m > 0.0).to_numpy().argmax())
    touch_speed = abs(trace["velocity_m_s"].iloc[first_touch - 5])
    assert touch_speed < 0.4 * trace["velocity_m_s"].abs().max()
    assert trace["velocity_m_s"].tail(500).abs().max() < 1e-4


@pytest.mark.parametrize(("supply", "speed_m_s"), [("industrial", 0.0533), ("didactic", 0.0160)])
def test_full_lever_gives_the_speed_of_the_pump_flow(cylinder: Cylinder, supply: str, speed_m_s: float) -> None:
    rig = default_rig(cylinder, supply)
    trace = simulate(rig, held(1.0, 2.5), balanced_state(rig, 0.03, 8e5, 35.0), 2.5)
    steady = trace["velocity_m_s"].tail(200)
    assert steady.mean() == pytest.approx(speed_m_s, rel=0.02)
    assert steady.mean() == pytest.approx(PUMP_FLOWS_M3_S[supply] / cylinder.piston_area_m2, rel=0.02)
    assert steady.std() < 0.02 * speed_m_s


def test_the_throttle_loads_extension_alone(rigs: dict[str, RigParameters]) -> None:
    rod_side = {}
    for sign in (1.0, -1.0):
        for condition, rig in rigs.items():
            trace = simulate(rig, held(sign * 0.6, 1.5), balanced_state(rig, 0.125, 8e5, 35.0), 1.5)
            rod_side[sign, condition] = float(trace["pressure_2_pa"].tail(200).mean())
    assert rod_side[1.0, "1"] < rod_side[1.0, "2"] < rod_side[1.0, "3"] < rod_side[1.0, "4"]
    assert len({round(rod_side[-1.0, condition], -3) for condition in TESTS}) == 1


def test_friction_is_hundreds_of_newtons_and_grows_from_test_to_test(traces: dict[str, pd.DataFrame]) -> None:
    extending = {condition: trace[trace["velocity_m_s"] > 0.003] for condition, trace in traces.items()}
    means = [float(extending[condition]["friction_n"].mean()) for condition in TESTS]
    assert means == sorted(means)
    assert 250.0 < means[0] < 450.0
    assert 450.0 < means[-1] < 750.0


def test_a_longer_dwell_makes_a_higher_breakaway(rigs: dict[str, RigParameters]) -> None:
    def breakaway(dwell_s: float) -> float:
        time_s = 0.001 * np.arange(round((dwell_s + 3.01) / 0.001))
        first, second = (time_s > 0.1) & (time_s < 1.0), time_s > 1.0 + dwell_s
        lever = 0.4 * first + second * np.clip(0.25 * (time_s - 1.0 - dwell_s), 0.0, 0.3)
        start = balanced_state(rigs["1"], 0.08, 8e5, 35.0)
        trace = simulate(rigs["1"], lever, start, dwell_s + 3.0)
        return float(trace["friction_n"][trace["time_s"] > 1.0 + dwell_s].max())

    short, medium, long = breakaway(0.3), breakaway(5.0), breakaway(30.0)
    assert short < medium < long


def test_times_that_do_not_fit_are_refused(rigs: dict[str, RigParameters]) -> None:
    start = balanced_state(rigs["1"], 0.1, 8e5, 35.0)
    with pytest.raises(ValueError, match=r"got 0\.001 s, but expected a multiple of time_step_s, 0\.0003 s"):
        simulate(rigs["1"], np.zeros(2000), start, 1.0, time_step_s=3e-4)
    with pytest.raises(ValueError, match=r"got 500 values, but 1\.0 s need 1002, one each millisecond"):
        simulate(rigs["1"], np.zeros(500), start, 1.0)


def test_an_unknown_supply_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(
        ValueError, match=r"record\.supply: got 'tap', but expected one of \['didactic', 'industrial'\]"
    ):
        default_rig(cylinder, "tap")

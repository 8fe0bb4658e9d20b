"""Physics of the whole rig: balances, limits, and agreement with a stiff reference solver."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.external_load import ExternalLoad, boom_n
from cylinder_friction.rig.hydraulics import bulk_modulus
from cylinder_friction.rig.parameters import PUMP_FLOWS_M3_S, RigParameters, default_rig, hydraulic_constants
from cylinder_friction.rig.simulate import balanced_state, simulate
from rig_reference import solve_reference

TESTS = ("1", "2", "3", "4")


def held(level: float, seconds: float, after_s: float = 0.3) -> np.ndarray:
    """Return a lever that is pulled at 0.1 s and held."""
    time_s = 0.001 * np.arange(round((seconds + 0.01) / 0.001))
    return level * np.clip((time_s - 0.1) / (after_s - 0.1), 0.0, 1.0)


def boom_with_steps(seconds: float) -> ExternalLoad:
    ticks = round(seconds * 1000) + 10
    steps = np.interp(np.arange(ticks), [0, 700, 900, 1500, 1600], [200.0, 200.0, -400.0, -400.0, 600.0])
    return ExternalLoad(steps, np.ones(ticks), boom_n(np.random.default_rng(3), 0.25))


@pytest.mark.parametrize(("condition", "loaded"), [("1", False), ("2", True)])
def test_fixed_step_agrees_with_the_stiff_reference_solver_over_reversals(
    rigs: dict[str, RigParameters], condition: str, loaded: bool
) -> None:
    rig, seconds = rigs[condition], 2.2
    time_s = 0.001 * np.arange(2210)
    lever = 0.5 * np.sin(2.0 * np.pi * 1.1 * (time_s - 0.05)) * np.clip((time_s - 0.05) / 0.2, 0.0, 1.0)
    lever[time_s > 0.8 * seconds] = 0.0
    load = None
    if loaded:
        rig, load = replace(rig, hydraulics=replace(rig.hydraulics, makeup_gain=2e-6)), boom_with_steps(seconds)
    start = balanced_state(rig, 0.12, 10e5, 35.0, 0.0 if load is None else load.at_start(0.12, 0.25))
    found = simulate(rig, lever, start, seconds, external_force=load)
    reference = solve_reference(rig, lever, start, seconds, 1e-6, external_force=load)
    moves = np.sign(reference["velocity_m_s"][reference["velocity_m_s"].abs() > 0.02])
    assert int((np.diff(moves) != 0).sum()) >= 2
    for column, mean, worst in (
        ("pressure_1_pa", 5e3, 4e4),
        ("pressure_2_pa", 5e3, 4e4),
        ("velocity_m_s", 1e-4, 1.5e-3),
        ("position_m", 2e-5, 5e-5),
        ("friction_n", 1.5, 15.0),
    ):
        difference = (found[column] - reference[column]).abs()
        assert difference.mean() < mean, column
        assert difference.max() < worst, column


def test_bulk_modulus_is_that_of_aerated_oil(rigs: dict[str, RigParameters]) -> None:
    y = hydraulic_constants(rigs["1"].hydraulics)
    found = [bulk_modulus(y, bar * 1e5) / 1e9 for bar in (1.0, 10.0, 50.0)]
    assert found == pytest.approx([0.09, 0.77, 1.32], rel=0.05)


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


def test_an_unknown_supply_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(
        ValueError, match=r"record\.supply: got 'tap', but expected one of \['didactic', 'industrial'\]"
    ):
        default_rig(cylinder, "tap")

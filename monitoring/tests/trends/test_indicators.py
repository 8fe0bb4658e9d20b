"""Indicators of a session whose friction, zeros, load and leak are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.trends.indicators import session_row
from cylinder_friction_monitoring.trends.plan import IndicatorPlan
from cylinder_friction_monitoring.trends.session_row import SessionRow

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
A1, A2 = CYLINDER.piston_area_m2, CYLINDER.annulus_area_m2
STEP_S = 0.005
PLAN = IndicatorPlan()
ABOUT = RecordingMetadata("r1", "1", "monday", STEP_S, source_file="a.csv", source_sha256="ab", start="2025-01-06")


def recording(
    friction_n: float = 400.0,
    viscous_n_s_m: float = 0.0,
    zeros_bar: tuple[float, float] = (0.0, 0.0),
    load_n_m: float = 0.0,
    leak: float = 0.0,
    bump_n: float = 0.0,
    strokes: int = 8,
) -> Recording:
    """Return strokes out and back at two speeds, the valve closed for two seconds between them."""
    generator = np.random.default_rng(1)
    velocity = []
    for number in range(strokes):
        speed = (0.02, 0.04)[number // 2 % 2] * (1.0, -1.0)[number % 2]
        velocity += [np.full(round(0.12 / abs(speed) / STEP_S), speed), np.zeros(round(2.0 / STEP_S))]
    velocity_m_s = np.concatenate([np.zeros(200), *velocity])
    position_m = 0.06 + np.cumsum(velocity_m_s) * STEP_S
    moving = velocity_m_s != 0.0
    sign = np.sign(velocity_m_s)
    own_n = friction_n + viscous_n_s_m * np.abs(velocity_m_s) + bump_n * (position_m > 0.12)
    pressure_2 = np.full(len(sign), 20e5)
    force_n = np.where(moving, sign * own_n, 0.0) + load_n_m * position_m
    pressure_1 = (force_n + pressure_2 * A2) / A1
    volumes = PLAN.dead_volume_m3 + A1 * position_m, PLAN.dead_volume_m3 + A2 * (CYLINDER.stroke_m - position_m)
    for row in np.flatnonzero(~moving[1:]) + 1:
        if moving[row - 1]:
            pressure_1[row - 1] = pressure_2[row - 1] * A2 / A1
        flow = leak * (pressure_1[row - 1] - pressure_2[row - 1]) * STEP_S * PLAN.bulk_modulus_pa
        pressure_1[row] = pressure_1[row - 1] - flow / volumes[0][row]
        pressure_2[row] = pressure_2[row - 1] + flow / volumes[1][row]
    noise = generator.normal(0.0, 0.02e5, (2, len(sign)))
    table = pd.DataFrame(
        {
            "time_s": STEP_S * np.arange(len(sign)),
            "pressure_1_pa": pressure_1 + 1e5 * zeros_bar[0] + noise[0],
            "pressure_2_pa": pressure_2 + 1e5 * zeros_bar[1] + noise[1],
            "position_m": position_m,
            "velocity_m_s": velocity_m_s,
        }
    )
    return Recording(ABOUT, table)


def value(row: SessionRow, name: str) -> float:
    found = row.indicators[name].value
    assert found is not None, row.indicators[name].why
    return found


def test_a_row_holds_the_indicators_and_conditions_of_a_session() -> None:
    row = session_row([recording(400.0, 2000.0)], CYLINDER, name="press")
    assert (row.cylinder, row.session, row.start) == ("press", "monday", "2025-01-06")
    speed = row.covariates["speed_m_s"]
    assert speed is not None
    assert value(row, "friction_n") == pytest.approx(400.0 + 2000.0 * speed, abs=3.0)
    assert value(row, "viscous_n_s_m") == pytest.approx(2000.0, rel=0.05)
    assert value(row, "half_sum_n") == pytest.approx(0.0, abs=3.0)
    assert row.covariates["pressure_2_bar"] == pytest.approx(20.0, abs=0.1)
    assert row.covariates["oil_temperature_c"] is None
    assert row.stroke.keys() == {"extend", "retract"}
    assert SessionRow.from_dict(row.to_dict()) == row


@settings(max_examples=20, deadline=None)
@given(st.floats(50.0, 3000.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-2000.0, 2000.0))
def test_friction_comes_out_as_it_went_in_and_zeros_and_a_load_by_position_in_half_the_sum_alone(
    friction_n: float, first: float, second: float, load_n_m: float
) -> None:
    plain = session_row([recording(friction_n)], CYLINDER)
    assert value(plain, "friction_n") == pytest.approx(friction_n, abs=2.0)
    assert value(plain, "breakaway_n") == pytest.approx(friction_n, rel=0.1, abs=15.0)
    shifted = session_row([recording(friction_n, zeros_bar=(first, second), load_n_m=load_n_m)], CYLINDER)
    assert value(shifted, "friction_n") == pytest.approx(value(plain, "friction_n"), abs=1.0)
    zeros_n = 1e5 * (first * A1 - second * A2)
    assert value(shifted, "half_sum_n") == pytest.approx(zeros_n + load_n_m * 0.12, abs=0.01 * abs(load_n_m) + 3.0)


@pytest.mark.parametrize("leak", [1e-13, 1e-12])
def test_leak_from_holds(leak: float) -> None:
    found = session_row([recording(leak=leak)], CYLINDER).indicators["leak_m3_s_pa"]
    assert found.value == pytest.approx(leak, rel=0.2)
    assert "bulk modulus of 1 GPa" in found.why


def test_leak_needs_holds_and_pressures() -> None:
    whole = recording()
    moving = Recording(ABOUT, whole.table[whole.table["velocity_m_s"] != 0.0].reset_index(drop=True))
    assert "close the valve for 2 s" in session_row([moving], CYLINDER).indicators["leak_m3_s_pa"].why
    force_n = whole.column("pressure_1_pa") * A1 - whole.column("pressure_2_pa") * A2
    driven = whole.table.drop(columns=["pressure_1_pa", "pressure_2_pa"]).assign(drive_force_n=force_n)
    row = session_row([Recording(ABOUT, driven)], CYLINDER)
    assert row.indicators["leak_m3_s_pa"].why == "a leak needs both pressures"
    assert value(row, "friction_n") == pytest.approx(400.0, abs=2.0)
    assert row.covariates["pressure_1_bar"] is None


def test_strokes_one_way_say_why_there_is_no_friction() -> None:
    whole = recording()
    out = Recording(ABOUT, whole.table[whole.table["velocity_m_s"] >= 0.0].reset_index(drop=True))
    row = session_row([out], CYLINDER)
    assert "0 blocks of strokes out and back match" in row.indicators["friction_n"].why
    assert row.indicators["friction_n"].value is None
    assert session_row([recording(strokes=2)], CYLINDER).indicators["viscous_n_s_m"].value is None, "one speed"


def test_a_bump_of_the_bore_a_measured_load_and_pressures_that_never_match_show() -> None:
    row = session_row([recording(bump_n=100.0)], CYLINDER)
    assert value(row, "profile_n") == pytest.approx(100.0, abs=10.0)
    plain = recording()
    load_n = 300.0 * np.sin(plain.column("time_s"))
    loaded = plain.with_columns(pressure_1_pa=plain.column("pressure_1_pa") + load_n / A1, load_force_n=load_n)
    row = session_row([loaded], CYLINDER, IndicatorPlan(load="measured"))
    assert value(row, "friction_n") == pytest.approx(400.0, abs=2.0)
    assert row.covariates["load_n"] is not None
    more = np.where(plain.column("velocity_m_s") < 0.0, 40e5, 0.0)
    first_pa, second_pa = plain.column("pressure_1_pa") + more * A2 / A1, plain.column("pressure_2_pa") + more
    far = session_row([plain.with_columns(pressure_1_pa=first_pa, pressure_2_pa=second_pa)], CYLINDER)
    assert value(far, "friction_n") == pytest.approx(400.0, abs=2.0)
    assert "pressures differ between the directions" in far.indicators["friction_n"].why


def test_uncertainty_covers_what_strokes_differ_by_and_recordings_of_two_sessions_are_refused() -> None:
    parts = [replace(recording(400.0 + apart), metadata=replace(ABOUT, name=f"r{apart}")) for apart in (-20.0, 20.0)]
    found = session_row(parts, CYLINDER).indicators["friction_n"]
    assert found.value == pytest.approx(400.0, abs=2.0)
    assert 3.0 < (found.uncertainty or 0.0) < 15.0
    other = replace(parts[1], metadata=replace(ABOUT, name="r2", session="tuesday"))
    for wrong, words in (([parts[0], other], r"got 2 \(monday, tuesday\); make one row per session"), ([], "got 0")):
        with pytest.raises(MonitoringError, match=words):
            session_row(wrong, CYLINDER)

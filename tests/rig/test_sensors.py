from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.rig.parameters import SensorParameters, default_rig
from cylinder_friction.rig.sensors import LOAD_COLUMN, LOGGER_COLUMNS, as_written, at_ports, measure, write_logger_csv

SILENT = SensorParameters(
    pressure_noise_pa=0.0, position_noise_m=0.0, backlash_m=0.0, temperature_noise_c=0.0, load_noise_n=0.0
)


def still(p1_bar: float = 20.0, p2_bar: float = 10.0, position_m: float = 0.1, seconds: float = 5.0) -> pd.DataFrame:
    time_s = 0.001 * np.arange(round(seconds / 0.001))
    return pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": np.full(len(time_s), p1_bar * 1e5),
            "pressure_2_pa": np.full(len(time_s), p2_bar * 1e5),
            "position_m": np.full(len(time_s), position_m),
            "oil_temperature_c": np.full(len(time_s), 37.0),
            "load_force_n": np.full(len(time_s), -1200.0),
        }
    )


def seen(sensors: SensorParameters, trace: pd.DataFrame, session_time_s: float = 0.0) -> pd.DataFrame:
    return measure(sensors, trace, np.random.default_rng(0), session_time_s)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 240.0), st.floats(0.0, 240.0), st.floats(0.0, 0.25))
def test_without_noise_only_the_bits_are_lost(p1: float, p2: float, x: float) -> None:
    table = seen(SILENT, still(p1, p2, x, 0.1))
    assert tuple(table.columns) == LOGGER_COLUMNS
    assert np.abs(table["P1 [bar]"] - p1).max() <= 0.5 * 250.0 / 4096 + 1e-9
    assert np.abs(table["P2 [bar]"] - p2).max() <= 0.5 * 250.0 / 4096 + 1e-9
    assert np.abs(table["Position [mm]"] - 1e3 * x).max() <= 0.5 * 250.0 / 4096 + 1e-9


def test_noise_is_as_stated() -> None:
    table = seen(SensorParameters(), still())
    step = 250.0 / 4096
    assert table["P1 [bar]"].std() == pytest.approx(np.hypot(0.05, step / np.sqrt(12.0)), rel=0.1)
    assert table["Position [mm]"].std() == pytest.approx(np.hypot(0.03, step / np.sqrt(12.0)), rel=0.15)
    assert np.corrcoef(table["P1 [bar]"], table["P2 [bar]"])[0, 1] == pytest.approx(0.0, abs=0.1)


def test_offset_gain_and_drift_are_seen() -> None:
    sensors = replace(
        SILENT, bits=24, pressure_offset_pa=(0.5e5, -0.5e5), pressure_gain=(1.01, 1.0), pressure_drift_pa_s=(0.0, 100.0)
    )
    table = seen(sensors, still(20.0, 10.0), session_time_s=60.0)
    assert table["P1 [bar]"].mean() == pytest.approx(20.7, abs=1e-3)
    assert table["P2 [bar]"].iloc[0] == pytest.approx(9.5 + 0.06, abs=1e-3)
    assert table["P2 [bar]"].iloc[-1] - table["P2 [bar]"].iloc[0] == pytest.approx(0.005, abs=1e-3)


def test_the_anti_alias_filter_takes_what_the_logger_cannot_see() -> None:
    trace = still()
    trace["pressure_1_pa"] += 5e5 * np.sin(2.0 * np.pi * 195.0 * trace["time_s"])
    table = seen(replace(SILENT, bits=24), trace)
    assert np.abs(table["P1 [bar]"] - 20.0)[100:].max() < 1.0


def test_the_range_ends_where_the_transmitter_does() -> None:
    table = seen(SILENT, still(300.0, -5.0))
    assert table["P1 [bar]"].max() == pytest.approx(250.0)
    assert table["P2 [bar]"].min() == pytest.approx(-2.5, abs=0.05)


def test_the_thermometer_is_off_by_its_offset_and_late_by_its_time_constant() -> None:
    sensors = replace(SILENT, bits=24, temperature_offset_c=0.4, temperature_lag_s=2.0)
    trace = still(seconds=20.0)
    trace.loc[trace["time_s"] >= 4.0, "oil_temperature_c"] = 47.0
    oil_c = seen(sensors, trace)["Oil temperature [degC]"].to_numpy()
    assert oil_c[:800] == pytest.approx(37.4, abs=1e-3)
    assert oil_c[800 + 400] == pytest.approx(37.4 + 10.0 * (1.0 - np.exp(-1.0)), abs=0.02)
    assert oil_c[-1] == pytest.approx(47.4, abs=0.01)


def test_the_load_cell_is_as_late_as_its_amplifier() -> None:
    trace = still()
    trace["load_force_n"] = 1e3 * np.sin(5.0 * trace["time_s"])
    prompt, late = (
        measure(replace(SILENT, load_delay_s=delay_s), trace, np.random.default_rng(0), load_cell=True)
        for delay_s in (0.0, 0.02)
    )
    np.testing.assert_allclose(late[LOAD_COLUMN][10:], prompt[LOAD_COLUMN].shift(4)[10:], atol=5000.0 / 2048)
    assert late["P1 [bar]"].equals(prompt["P1 [bar]"])


def test_the_load_cell_has_its_offset_its_gain_and_its_range() -> None:
    worst, trace = replace(SILENT, load_offset_n=7.0, load_gain=1.001), still()
    seen_n = measure(worst, trace, np.random.default_rng(0), load_cell=True)[LOAD_COLUMN]
    assert seen_n.mean() == pytest.approx(7.0 - 1.001 * 1200.0, abs=0.5 * 5000.0 / 2048)
    trace["load_force_n"] = 9000.0
    assert measure(worst, trace, np.random.default_rng(0), load_cell=True)[LOAD_COLUMN].max() == 5000.0


def test_a_table_as_written_is_the_file_read_back(tmp_path: Path) -> None:
    table = measure(SensorParameters(), still(), np.random.default_rng(0), load_cell=True)
    table["P1 [bar]"] = 7.8125 * np.arange(len(table)) - 300.0  # every other one lies half way between two decimals
    write_logger_csv(tmp_path / "log.csv", table)
    read = read_logged_file(tmp_path / "log.csv")[0].channels
    pd.testing.assert_frame_equal(as_written(table), read, check_exact=True, check_column_type=False)


def test_a_clock_with_jitter_states_when_it_took_each_sample() -> None:
    moving = still().assign(position_m=lambda table: 0.02 * table["time_s"])
    table = seen(replace(SILENT, bits=24, jitter_s=0.0025), moving)
    late_s = table["Time [s]"].to_numpy() - 0.005 * np.arange(len(table))
    assert 0.0024 < np.abs(late_s).max() <= 0.0025
    off_mm = (table["Position [mm]"] - 20.0 * table["Time [s]"])[20:]
    assert np.ptp(off_mm) < 1e-3, "the filter's delay alone"


def test_transmitters_in_the_ports_do_not_see_what_a_cushion_holds(cylinder: Cylinder) -> None:
    hydraulics = default_rig(cylinder).hydraulics
    trace = still().assign(position_m=lambda table: 0.1 - 0.02 * table["time_s"])
    trace["volume_1_m3"] = hydraulics.piston_area_m2 * trace["position_m"]
    trace["volume_2_m3"] = -hydraulics.annulus_area_m2 * trace["position_m"]
    seen, unseen = at_ports(trace, hydraulics), trace["position_m"] < hydraulics.cushion_length_m
    assert (seen["pressure_1_pa"] < trace["pressure_1_pa"])[unseen].all()
    assert seen[~unseen].equals(trace[~unseen])
    assert seen["pressure_2_pa"].equals(trace["pressure_2_pa"])
    assert seen["pressure_1_pa"].min() >= hydraulics.tank_pressure_pa

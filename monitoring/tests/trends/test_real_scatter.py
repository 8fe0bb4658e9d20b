"""Three repeats of one seal at four pressures, the only public measurement of how sessions differ."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import savgol_filter

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction_monitoring.trends.indicators import session_row
from cylinder_friction_monitoring.trends.plan import IndicatorPlan, MonitorPlan
from cylinder_friction_monitoring.trends.session_row import SessionRow

REPEATS = Path(__file__).parents[4] / "shared" / "data" / "pneumatic-repeats"
CYLINDER = Cylinder(bore_diameter_m=0.0257, rod_diameter_m=0.01, stroke_m=0.045, moving_mass_kg=0.1)
STEP_S = 0.01

pytestmark = pytest.mark.skipif(not REPEATS.is_dir(), reason="the public data set is not there")


def repeat(group: str, number: int, bar: int) -> SessionRow:
    path = REPEATS / f"{group}_{number}_{bar}bar.csv.gz"
    table = pd.read_csv(path, sep="\t", header=None)
    logged_s = 1e-3 * table[0].to_numpy()
    time_s = np.arange(logged_s[0], logged_s[-1], STEP_S)
    position_m = 1e-3 * np.interp(time_s, logged_s, table[4]) + 0.0045
    velocity_m_s = savgol_filter(position_m, 21, 3, deriv=1, delta=STEP_S)
    about = RecordingMetadata(f"{group}{number}", "1", f"{group}{number}", STEP_S, start=f"2021-01-0{number}T00:00:00Z")
    columns = {"time_s": time_s, "position_m": position_m, "velocity_m_s": velocity_m_s}
    columns["drive_force_n"] = np.interp(time_s, logged_s, table[6])
    return session_row([Recording(about, pd.DataFrame(columns))], CYLINDER, IndicatorPlan(slowest_m_s=4e-3))


@pytest.fixture(scope="module")
def repeats() -> list[list[SessionRow]]:
    groups = [("reconnected", bar) for bar in (1, 3, 5, 7)] + [("rerun", bar) for bar in (1, 3, 5)]
    return [[repeat(group, number, bar) for number in (1, 2, 3)] for group, bar in groups]


def friction_n(rows: list[SessionRow]) -> np.ndarray:
    return np.array([row.indicators["friction_n"].value for row in rows], dtype=np.float64)


def test_repeats_of_one_seal_differ_by_less_than_what_is_assumed(repeats: list[list[SessionRow]]) -> None:
    scatter = [float(friction_n(rows).std(ddof=1) / friction_n(rows).mean()) for rows in repeats]
    assert 0.02 < min(scatter) < max(scatter) < MonitorPlan().assumed_scatter


def test_strokes_of_a_session_do_not_show_how_sessions_differ(repeats: list[list[SessionRow]]) -> None:
    for rows in repeats:
        own_n = max(row.indicators["friction_n"].uncertainty or 0.0 for row in rows)
        assert own_n < friction_n(rows).std(ddof=1)


def test_friction_is_half_the_difference_and_the_piston_force_half_the_sum(repeats: list[list[SessionRow]]) -> None:
    for rows, bar in zip(repeats[:4], (1, 3, 5, 7), strict=True):
        for row in rows:
            half_sum_n = row.indicators["half_sum_n"].value
            assert half_sum_n is not None
            assert half_sum_n == pytest.approx(1e5 * bar * CYLINDER.piston_area_m2, rel=0.1)

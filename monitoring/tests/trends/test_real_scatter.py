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


def test_three_repeats_of_a_seal_differ_by_less_than_assumed_and_by_more_than_their_strokes_show() -> None:
    scatter = []
    for group, bars in (("reconnected", (1, 3, 5, 7)), ("rerun", (1, 3, 5))):
        for bar in bars:
            indicators = [repeat(group, number, bar).indicators for number in (1, 2, 3)]
            friction_n = np.array([each["friction_n"].value for each in indicators], dtype=np.float64)
            scatter.append(float(friction_n.std(ddof=1) / friction_n.mean()))
            assert max(each["friction_n"].uncertainty or 0.0 for each in indicators) < friction_n.std(ddof=1)
            for each in indicators if group == "reconnected" else ():  # half the sum is the force on the piston
                assert each["half_sum_n"].value == pytest.approx(1e5 * bar * CYLINDER.piston_area_m2, rel=0.1)
    assert 0.02 < min(scatter) < max(scatter) < MonitorPlan().assumed_scatter

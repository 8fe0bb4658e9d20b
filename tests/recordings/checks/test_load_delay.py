import re

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding
from cylinder_friction.recordings.checks.plausibility import check_friction
from logger_files import columns_of

STEP_S = 0.005


def strokes(cylinder: Cylinder, delay_s: float, load: str = "steps", seconds: float = 40.0) -> pd.DataFrame:
    """Return strokes at 50 mm/s against 300 N of friction and a load that a cell shows late."""
    generator = np.random.default_rng(0)
    time_s = STEP_S * np.arange(round(seconds / STEP_S))
    velocity = 0.05 * np.tanh(40.0 * np.sin(1.1 * time_s))
    fine_s = np.arange(-1.0, seconds + 1.0, 0.001)
    load_n = 800.0 * np.sin(0.02 * fine_s) if load == "slow" else stepping(generator, fine_s)
    other_n = stepping(generator, fine_s) if load == "unrelated" else load_n
    drive_n = 300.0 * velocity / 0.05 + np.interp(time_s, fine_s, load_n)
    rod_pa = 2e6 + generator.normal(0.0, 5e3, len(time_s))
    shown_n = np.interp(time_s - delay_s, fine_s, other_n) + generator.normal(0.0, 2.0, len(time_s))
    return pd.DataFrame(
        {
            "pressure_1_pa": (drive_n + rod_pa * cylinder.annulus_area_m2) / cylinder.piston_area_m2,
            "pressure_2_pa": rod_pa,
            "position_m": 0.05 + np.cumsum(velocity) * STEP_S + generator.normal(0.0, 3e-5, len(time_s)),
            "load_force_n": shown_n,
        }
    )


def stepping(generator: np.random.Generator, time_s: np.ndarray) -> np.ndarray:
    """Return another load every 1.3 s, within 0.15 s [N]."""
    at_s = np.arange(-1.0, time_s[-1], 1.3)
    levels_n = np.repeat(generator.uniform(-900.0, 900.0, len(at_s) + 1), 2)[1:-1]
    return np.interp(time_s, np.stack([at_s, at_s + 0.15], axis=1).ravel(), levels_n)


def found(cylinder: Cylinder, table: pd.DataFrame, mode: str = "measured") -> list[Finding]:
    limits = CheckLimits(cylinder.stroke_m, cylinder.piston_area_m2, cylinder.annulus_area_m2, mode)
    findings = check_friction(columns_of(table), STEP_S, limits)
    return [each for each in findings if each.check == "load_delay"]


@pytest.mark.parametrize(
    ("delay_s", "which", "when"), [(0.02, "the load cell", "after"), (-0.0325, "both pressure", "before")]
)
def test_a_late_load_cell_is_noted_with_its_delay(cylinder: Cylinder, delay_s: float, which: str, when: str) -> None:
    (finding,) = found(cylinder, strokes(cylinder, delay_s))
    assert finding.outcome == "noted"
    late_ms, error_ms = (float(finding.text.split()[place]) for place in (2, 4))
    assert late_ms == pytest.approx(1e3 * abs(delay_s), abs=1.5)
    assert error_ms < 3.0
    assert f"ms {when} the pressures; expected both at once" in finding.text
    assert f"state sensor.delay_s of {which}" in finding.text
    advised = re.search(r"in the mapping, (0\.\d{3}) s more than it is now$", finding.text)
    assert advised is not None
    assert float(advised[1]) == pytest.approx(abs(delay_s), abs=1.5e-3)


@pytest.mark.parametrize(("delay_s", "load"), [(0.0, "steps"), (0.02, "slow"), (0.02, "unrelated")])
def test_a_load_in_time_or_that_shows_no_delay_is_ok(cylinder: Cylinder, delay_s: float, load: str) -> None:
    table = strokes(cylinder, delay_s, load)
    assert found(cylinder, table) == found(cylinder, table, "none") == []

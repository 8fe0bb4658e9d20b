"""Recordings to check: a small campaign of the simulated rig, and a crane where its data lie beside the repository."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.rig.campaign import CampaignPlan, campaign

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder

CRANE = Path(__file__).parents[2] / "../shared/data/crane"


@pytest.fixture(scope="session")
def rig_tables(cylinder: Cylinder) -> dict[str, pd.DataFrame]:
    """Two recordings of each of the four load tests as the logger saw them, in SI units, at 200 Hz; read only."""
    plan = CampaignPlan(seed=11, sessions_per_condition=1, recordings_per_session=2, duration_s=40.0)
    return {
        recording.metadata.name: pd.DataFrame(
            {
                "time_s": recording.logger["Time [s]"],
                "pressure_1_pa": recording.logger["P1 [bar]"] * 1e5,
                "pressure_2_pa": recording.logger["P2 [bar]"] * 1e5,
                "position_m": recording.logger["Position [mm]"] * 1e-3,
            }
        )
        for recording in campaign(cylinder, plan)
    }


@pytest.fixture(scope="session")
def crane_tables() -> dict[str, pd.DataFrame]:
    """The jib cylinder of a real loader crane, at 100 Hz; it carries 25 to 38 kN that nobody measured."""
    if not CRANE.is_dir():
        pytest.skip("the crane's recordings are not here")
    tables = {}
    for path in sorted(CRANE.glob("*.csv.gz")):
        log = pd.read_csv(path)
        tables[path.name] = pd.DataFrame(
            {
                "time_s": 0.01 * np.arange(len(log)),
                "pressure_1_pa": log["jib_pA_cyl_bar"] * 1e5,
                "pressure_2_pa": log["jib_pB_cyl_bar"] * 1e5,
                "position_m": log["jib_x_m"],
            }
        )
    return tables

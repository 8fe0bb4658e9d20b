"""Recordings to check: a small campaign of the simulated rig."""

import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan


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

"""Rigs from the whole of their ranges: each within them, each another, and every one works."""

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.parameters import RigParameters, default_rig
from cylinder_friction.rig.variation import draw_wide_rig

SEEDS = 200


@pytest.fixture(scope="module")
def drawn(cylinder: Cylinder) -> list[RigParameters]:
    return [draw_wide_rig(default_rig(cylinder), np.random.default_rng(seed)) for seed in range(SEEDS)]


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("coulomb_n", 115.0, 750.0),
        ("asymmetry", 0.024, 0.167),
        ("static_ratio", 1.1, 2.0),
        ("stribeck_velocity_m_s", 0.002, 0.030),
        ("film_velocity_m_s", 0.020, 0.100),
        ("viscous_n_s_m", 300.0, 4000.0),
        ("film_build_s", 0.02, 0.15),
        ("film_squeeze_s", 0.08, 0.5),
        ("film_dwell_s", 5.0, 40.0),
    ],
)
def test_each_parameter_fills_its_range_and_keeps_to_it(
    drawn: list[RigParameters], name: str, low: float, high: float
) -> None:
    values = np.array([getattr(rig.friction, name) for rig in drawn])
    assert low <= values.min()
    assert values.max() <= high
    assert np.ptp(values) > 0.9 * (high - low)


@pytest.mark.extended
def test_fifty_of_them_work(cylinder: Cylinder) -> None:
    mean_n, speeds = [], []
    for seed in range(50):
        plan = CampaignPlan(seed, sessions_per_condition=1, recordings_per_session=1, duration_s=8.0, specimen="wide")
        truths = [recording.truth for recording in campaign(cylinder, plan)]
        pressures = np.array([truth[["pressure_1_pa", "pressure_2_pa"]].to_numpy() for truth in truths])
        assert pressures.min() > -1.0e5
        assert pressures.max() < 110e5
        friction = np.abs([truth["friction_n"] for truth in truths])
        assert friction.max() < 4000.0
        mean_n.append(friction.mean())
        speeds.append(np.quantile(np.abs([truth["velocity_m_s"] for truth in truths]), 0.95))
    assert 100.0 < min(mean_n) < 320.0
    assert 700.0 < max(mean_n) < 1500.0
    assert min(speeds) > 0.015
    assert max(speeds) < 0.15

"""Options that are off by default: a weight, transmitters at the valve, their lag, asymmetry by condition."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.campaign import RigRecording, campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan

SHORT = CampaignPlan(seed=3, sessions_per_condition=1, recordings_per_session=1, duration_s=15.0)


def first(cylinder: Cylinder, plan: CampaignPlan) -> RigRecording:
    return next(campaign(cylinder, plan))


@pytest.fixture(scope="module")
def plain(cylinder: Cylinder) -> RigRecording:
    return first(cylinder, SHORT)


def test_line_loss_is_in_the_sensors_and_not_in_the_chambers(cylinder: Cylinder, plain: RigRecording) -> None:
    lossy = first(cylinder, replace(SHORT, line_loss_bar=3.0, line_laminar_share=0.25))
    assert lossy.truth.equals(plain.truth)
    velocity_m_s = lossy.truth["velocity_m_s"].to_numpy()
    steady = np.abs(velocity_m_s) > 0.01
    part = 10.0 * velocity_m_s[steady]
    for column, area in (("P1 [bar]", 1.0), ("P2 [bar]", -cylinder.annulus_area_m2 / cylinder.piston_area_m2)):
        lost_bar = (lossy.logger[column] - plain.logger[column]).to_numpy()[steady]
        expected = 3.0 * (0.25 * area * part + 0.75 * area * abs(area) * part * np.abs(part))
        assert np.median(np.abs(lost_bar - expected)) < 0.1


def test_lag_makes_pressures_late(cylinder: Cylinder) -> None:
    late = first(cylinder, replace(SHORT, pressure_lag_s=0.05))
    seen, true = late.logger["P1 [bar]"].to_numpy(), 1e-5 * late.truth["pressure_1_pa"].to_numpy()
    errors = [np.square(seen[50:-50] - np.roll(true, shift)[50:-50]).mean() for shift in range(20)]
    assert 5 <= int(np.argmin(errors)) <= 13


def test_weight_is_carried_by_the_piston_side(cylinder: Cylinder) -> None:
    loaded = first(replace(cylinder, moving_mass_kg=400.0), replace(SHORT, weight_n=4000.0))
    truth = loaded.truth
    assert (truth["load_force_n"] == 4000.0).all()
    drive_n = truth["pressure_1_pa"] * cylinder.piston_area_m2 - truth["pressure_2_pa"] * cylinder.annulus_area_m2
    assert (drive_n - truth["friction_n"]).median() == pytest.approx(4000.0, rel=0.02)
    assert truth["velocity_m_s"].max() > 0.02
    assert truth["velocity_m_s"].min() < -0.02


def test_conditions_differ_in_asymmetry(cylinder: Cylinder) -> None:
    differing = list(campaign(cylinder, replace(SHORT, asymmetry_by_condition=0.2)))
    same = list(campaign(cylinder, SHORT))
    assert [not a.truth.equals(b.truth) for a, b in zip(differing, same, strict=True)] == [True] * 4

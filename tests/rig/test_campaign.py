from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.campaign import TRUTH_COLUMNS, RigRecording, campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.parameters import default_rig
from cylinder_friction.rig.sensors import LOAD_COLUMN, LOGGER_COLUMNS
from cylinder_friction.rig.variation import Session, draw_session

SHORT = CampaignPlan(seed=3, sessions_per_condition=1, recordings_per_session=2, duration_s=15.0)


@pytest.fixture(scope="module")
def recordings(cylinder: Cylinder) -> list[RigRecording]:
    return list(campaign(cylinder, SHORT))


def test_every_test_session_and_recording_is_there_by_name(recordings: list[RigRecording]) -> None:
    assert [recording.metadata.name for recording in recordings] == [
        f"condition{condition}_session01_recording{take:02d}" for condition in "1234" for take in (1, 2)
    ]
    assert recordings[2].metadata.session == "condition2_session01"
    assert recordings[2].metadata.condition == "2"
    assert len(recordings) == SHORT.recordings


def test_logger_and_truth_share_their_rows_and_tell_of_the_same_motion(recordings: list[RigRecording]) -> None:
    for recording in recordings:
        logger, truth = recording.logger, recording.truth
        assert tuple(truth.columns) == TRUTH_COLUMNS
        assert len(logger) == len(truth) == 3000
        assert np.array_equal(logger["Time [s]"], truth["time_s"])
        assert np.abs(logger["Position [mm]"] * 1e-3 - truth["position_m"]).mean() < 3e-4
        assert np.abs(logger["P1 [bar]"] * 1e5 - truth["pressure_1_pa"]).mean() < 2e4


def test_a_longer_campaign_begins_with_the_shorter_one(cylinder: Cylinder, recordings: list[RigRecording]) -> None:
    longer = next(
        campaign(cylinder, CampaignPlan(seed=3, sessions_per_condition=5, recordings_per_session=2, duration_s=15.0))
    )
    assert longer.truth.equals(recordings[0].truth)


def test_sessions_differ_and_their_recordings_share_the_calibration(cylinder: Cylinder) -> None:
    rig = default_rig(cylinder)
    sessions = [
        draw_session(rig, np.random.default_rng(seed), 600.0, zeroed=True, residual_offset_pa=5e3) for seed in range(20)
    ]
    offsets = np.array([session.rig.sensors.pressure_offset_pa for session in sessions])
    assert np.abs(offsets).max() <= 5e3
    assert len(np.unique(offsets)) == 40
    assert np.ptp([session.oil_temperature_c for session in sessions]) > 8.0
    assert 0.01 < np.concatenate([session.drift for session in sessions]).std() < 0.05


def test_asymmetry_varies_between_sessions_by_as_much_as_is_asked_for_and_changes_nothing_else(
    cylinder: Cylinder,
) -> None:
    rig = default_rig(cylinder)

    def drawn(seed: int, sd: float) -> Session:
        generator = np.random.default_rng(seed)
        return draw_session(rig, generator, 60.0, zeroed=True, residual_offset_pa=5e3, asymmetry_sd=sd)

    uneven = [drawn(seed, 0.01) for seed in range(400)]
    asymmetry = np.array([session.rig.friction.asymmetry for session in uneven])
    ratios = (1.0 + asymmetry) / (1.0 - asymmetry)
    assert ratios.std() == pytest.approx(0.01, rel=0.15)
    assert ratios.mean() == pytest.approx(290.0 / 240.0, abs=2e-3)
    even = drawn(7, 0.0)
    assert even.rig.friction == rig.friction
    assert even.rig.sensors == uneven[7].rig.sensors
    np.testing.assert_array_equal(even.drift, uneven[7].drift)


@pytest.fixture(scope="module")
def loaded(cylinder: Cylinder) -> list[RigRecording]:
    return list(campaign(cylinder, replace(SHORT, external_load="varied", recordings_per_session=1)))


def test_the_load_is_in_the_log_and_in_the_truth_of_such_campaigns_alone(
    recordings: list[RigRecording], loaded: list[RigRecording]
) -> None:
    for recording in loaded:
        assert tuple(recording.logger.columns) == (*LOGGER_COLUMNS, LOAD_COLUMN)
        assert tuple(recording.truth.columns) == (*TRUTH_COLUMNS, "load_force_n")
        assert np.abs(recording.logger[LOAD_COLUMN] - recording.truth["load_force_n"]).max() < 60.0
        assert recording.metadata.load.endswith("measured by a load cell")
    assert tuple(recordings[0].logger.columns) == LOGGER_COLUMNS


def test_with_the_measured_load_sensors_tell_friction_as_without_one(
    cylinder: Cylinder, loaded: list[RigRecording]
) -> None:
    for recording in loaded:
        assert np.ptp(recording.truth["load_force_n"]) > 150.0
        assert recording.truth["load_force_n"].abs().max() < 3100.0
        logger, truth = recording.logger, recording.truth
        oil = logger["P1 [bar]"] * 1e5 * cylinder.piston_area_m2 - logger["P2 [bar]"] * 1e5 * cylinder.annulus_area_m2
        inside = truth["position_m"].between(0.003, cylinder.stroke_m - 0.003)
        error = np.abs(oil - logger[LOAD_COLUMN] - truth["friction_n"])[inside].mean()
        assert error < 0.10 * truth["friction_n"][inside].abs().mean()
        assert np.abs(oil - truth["friction_n"])[inside].mean() > 2.0 * error


def test_a_crane_loads_all_recordings_alike_by_position_alone_and_has_no_load_cell(cylinder: Cylinder) -> None:
    crane = list(campaign(cylinder, replace(SHORT, external_load="boom", recordings_per_session=1)))
    truth = pd.concat([recording.truth for recording in crane]).sort_values("position_m")
    load_n, position_m = truth["load_force_n"].to_numpy(), truth["position_m"].to_numpy()
    assert load_n.max() > 1500.0
    assert load_n.min() < -1000.0
    # Straight between 65 positions over the stroke, nowhere steeper than 24 N/mm
    assert (np.abs(np.diff(load_n)) <= 24e3 * np.diff(position_m) + 1e-6).all()
    for recording in crane:
        assert tuple(recording.logger.columns) == LOGGER_COLUMNS
        assert tuple(recording.truth.columns) == (*TRUTH_COLUMNS, "load_force_n")
        assert recording.metadata.load.endswith("a weight on a crane's boom")


@pytest.mark.parametrize(
    ("key", "value", "known"),
    [
        ("external_load", "heavy", "'boom', 'none', 'varied'"),
        ("specimen", "narrow", "'default', .*'wide'"),  # a bench may add specimens of its own
    ],
)
def test_unknown_choices_are_refused(cylinder: Cylinder, key: str, value: Any, known: str) -> None:
    with pytest.raises(ValueError, match=rf"record\.{key}: got '{value}', but expected one of \[{known}\]"):
        next(campaign(cylinder, replace(SHORT, **{key: value})))


def test_line_loss_is_in_the_sensors_and_not_in_the_chambers(
    cylinder: Cylinder, recordings: list[RigRecording]
) -> None:
    plain, lossy = recordings[0], next(campaign(cylinder, replace(SHORT, line_loss_bar=3.0, line_laminar_share=0.25)))
    assert lossy.truth.equals(plain.truth)
    velocity_m_s = lossy.truth["velocity_m_s"].to_numpy()
    steady = np.abs(velocity_m_s) > 0.01
    part = 10.0 * velocity_m_s[steady]
    for column, area in (("P1 [bar]", 1.0), ("P2 [bar]", -cylinder.annulus_area_m2 / cylinder.piston_area_m2)):
        lost_bar = (lossy.logger[column] - plain.logger[column]).to_numpy()[steady]
        expected = 3.0 * (0.25 * area * part + 0.75 * area * abs(area) * part * np.abs(part))
        assert np.median(np.abs(lost_bar - expected)) < 0.1


def test_lag_makes_pressures_late(cylinder: Cylinder) -> None:
    late = next(campaign(cylinder, replace(SHORT, pressure_lag_s=0.05)))
    seen, true = late.logger["P1 [bar]"].to_numpy(), 1e-5 * late.truth["pressure_1_pa"].to_numpy()
    errors = [np.square(seen[50:-50] - np.roll(true, shift)[50:-50]).mean() for shift in range(20)]
    assert 5 <= int(np.argmin(errors)) <= 13


def test_weight_is_carried_by_the_piston_side(cylinder: Cylinder) -> None:
    loaded = next(campaign(replace(cylinder, moving_mass_kg=400.0), replace(SHORT, weight_n=4000.0)))
    truth = loaded.truth
    assert (truth["load_force_n"] == 4000.0).all()
    drive_n = truth["pressure_1_pa"] * cylinder.piston_area_m2 - truth["pressure_2_pa"] * cylinder.annulus_area_m2
    assert (drive_n - truth["friction_n"]).median() == pytest.approx(4000.0, rel=0.02)
    assert truth["velocity_m_s"].max() > 0.02
    assert truth["velocity_m_s"].min() < -0.02


def test_transmitters_can_keep_their_zeros_over_sessions(cylinder: Cylinder) -> None:
    plan = replace(SHORT, seed=4, residual_offset_bar=1.0, sessions_per_condition=2, recordings_per_session=1)

    def read_bar(zeros: str) -> np.ndarray:
        """Read each session's zero of side 1 off the recordings, less what a campaign without zeros reads."""
        shifted = campaign(cylinder, replace(plan, zeros=zeros))  # type: ignore[arg-type]
        bare = campaign(cylinder, replace(plan, zeros=zeros, residual_offset_bar=0.0))  # type: ignore[arg-type]
        pairs = [
            (with_zero.logger["P1 [bar]"], without.logger["P1 [bar]"])
            for with_zero, without in zip(shifted, bare, strict=True)
        ]
        return np.array([float(np.median(own - other)) for own, other in pairs])

    assert np.ptp(read_bar("kept")) < 0.07  # one step of the converter
    assert np.ptp(read_bar("drawn anew")) > 0.3
    drifting = read_bar("drifting").reshape(-1, 2)  # conditions, sessions
    assert np.ptp(drifting, axis=0).max() < 0.07 < abs(drifting[0, 1] - drifting[0, 0]) < 1.0


def test_conditions_differ_in_asymmetry(cylinder: Cylinder, recordings: list[RigRecording]) -> None:
    differing = list(campaign(cylinder, replace(SHORT, asymmetry_by_condition=0.2)))
    assert [not a.truth.equals(b.truth) for a, b in zip(differing, recordings, strict=True)] == [True] * 8


def test_contacts_that_age_at_rest_break_away_harder(cylinder: Cylinder, recordings: list[RigRecording]) -> None:
    aged = next(campaign(cylinder, replace(SHORT, ageing=0.1))).truth
    for part, least in ((1.0, 1.2), (0.5, 1.0)):
        friction_n = (np.quantile(np.abs(truth["friction_n"]), part) for truth in (aged, recordings[0].truth))
        assert next(friction_n) > least * next(friction_n)


def test_a_digital_position_has_steps(cylinder: Cylinder, recordings: list[RigRecording]) -> None:
    stepped = next(campaign(cylinder, replace(SHORT, position_step_m=1e-4)))
    assert stepped.truth.equals(recordings[0].truth)
    steps = stepped.logger["Position [mm]"].to_numpy() / 0.1
    assert np.abs(steps - np.round(steps)).max() < 1e-9


@pytest.mark.parametrize("start", ["rest", "end_stop"])
def test_a_recording_can_begin_at_rest(cylinder: Cylinder, start: Any) -> None:
    for each in campaign(cylinder, replace(SHORT, recordings_per_session=1, weight_n=500.0, start=start)):
        truth = each.truth
        assert len(truth) == len(each.logger) == 3000
        assert truth["time_s"].iloc[0] == 0.0
        assert np.abs(truth["velocity_m_s"][:200]).max() < 1e-4
        assert np.ptp(truth["position_m"]) > 0.02, "the work follows"
        ends_m = np.array([0.0, cylinder.stroke_m])
        assert (np.abs(truth["position_m"].iloc[0] - ends_m).min() < 1e-3) == (start == "end_stop")

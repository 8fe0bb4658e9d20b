"""Sessions of the servo rig: references, draws, sensors, and recordings that the product can label."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from friction_benchmark.servo_rig.dynamics import TICK_S
from friction_benchmark.servo_rig.evaluation import labelled_sessions
from friction_benchmark.servo_rig.parameters import BAR, CYLINDER, GREATEST_OFFSET_PA, Drive, Seals, Sensors
from friction_benchmark.servo_rig.references import HIGHEST_M, LOWEST_M
from friction_benchmark.servo_rig.sessions import (
    CONDITIONS,
    ServoSession,
    SessionPlan,
    as_seen_by,
    draw,
    measure,
    record,
    record_sessions,
)
from friction_benchmark.servo_rig.simulate import simulate

SHORT = SessionPlan(sessions=1, duration_s=8.0)


@pytest.fixture(scope="module")
def sessions() -> list[ServoSession]:
    return record_sessions(SHORT)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_references_keep_clear_of_the_ends_and_are_smooth(condition: str) -> None:
    for seed in range(5):
        reference_m = CONDITIONS[condition].duty(np.random.default_rng(seed), 20_001)
        assert len(reference_m) == 20_001
        assert reference_m.min() > LOWEST_M - 0.005
        assert reference_m.max() < HIGHEST_M + 0.005
        assert np.abs(np.diff(reference_m)).max() < 0.25 * TICK_S
        assert np.ptp(reference_m) > 0.02


def test_every_condition_is_recorded_at_250_hz_in_the_ranges_of_its_sensors(sessions: list[ServoSession]) -> None:
    assert [each.recording.metadata.condition for each in sessions] == list(CONDITIONS)
    for each in sessions:
        recording = each.recording
        assert len(recording) == len(each.true_friction_n) == 2000
        assert recording.column("time_s")[1] == pytest.approx(0.004)
        pressures = recording.samples()[:, :2]
        assert pressures.min() > 1.0 * BAR
        assert pressures.max() < 215.0 * BAR
        counts = pressures / (400.0 * BAR / 2**14)
        assert np.abs(counts - np.round(counts)).max() < 1e-6
        assert np.abs(each.true_load_n).max() == 0.0


def test_labels_meet_true_friction_but_for_the_zeros(sessions: list[ServoSession]) -> None:
    for each, labelled in zip(sessions, labelled_sessions(sessions, SHORT), strict=True):
        usable = labelled.usable()
        error_n = (labelled.column("friction_n") - each.true_friction_n)[usable]
        most_n = GREATEST_OFFSET_PA * (CYLINDER.piston_area_m2 + CYLINDER.annulus_area_m2)
        assert abs(error_n.mean()) < most_n + 2.0
        assert np.abs(error_n - error_n.mean()).mean() < 0.03 * np.abs(each.true_friction_n).mean()
        assert "friction_uncertainty_n" in labelled.columns


def test_equal_plans_give_equal_bits_and_another_rate_the_same_motion(sessions: list[ServoSession]) -> None:
    first, again = sessions[1], record(SHORT, "2", 1)
    assert again.recording.table.equals(first.recording.table)
    slower = record(replace(SHORT, sample_time_s=0.008), "2", 1)
    np.testing.assert_array_equal(slower.true_friction_n, first.true_friction_n[::2])
    other = record(replace(SHORT, seed=1), "2", 1)
    assert not np.array_equal(other.true_friction_n, first.true_friction_n)


def test_zeros_are_drawn_for_each_session_within_their_range() -> None:
    drawn = [draw(np.random.default_rng(seed), "1", "horizontal")[2] for seed in range(200)]
    zeros = np.array([(each.offset_1_pa, each.offset_2_pa) for each in drawn])
    assert np.abs(zeros).max() <= GREATEST_OFFSET_PA
    assert np.abs(zeros).max() > 0.9 * GREATEST_OFFSET_PA
    assert np.abs(zeros.mean(axis=0)).max() < 0.2 * GREATEST_OFFSET_PA


def test_a_transmitter_reads_its_zero_too_much_and_its_noise() -> None:
    trace = simulate(Seals(), Drive(), np.full(8001, 0.15))
    seen = measure(Sensors(offset_1_pa=0.1 * BAR), trace, np.random.default_rng(0))
    late = slice(1000, None)
    error_pa = (seen["pressure_1_pa"] - trace["pressure_1_pa"].to_numpy()[::4])[late]
    assert error_pa.mean() == pytest.approx(0.1 * BAR, abs=0.01 * BAR)
    assert error_pa.std() == pytest.approx(0.06 * BAR, rel=0.2)


def test_a_sample_time_between_ticks_is_refused() -> None:
    with pytest.raises(ValueError, match=r"sample_time_s: got 0.0033 s, but expected a multiple of 0.001 s"):
        record(replace(SHORT, sample_time_s=0.0033), "1", 1)


def test_another_cylinder_sees_the_same_forces_without_the_load(sessions: list[ServoSession]) -> None:
    recording = sessions[0].recording
    seen = as_seen_by(recording, (3e-3, 2.5e-3), 500.0)
    here = recording.samples()[:, :2] @ [CYLINDER.piston_area_m2, -CYLINDER.annulus_area_m2]
    np.testing.assert_allclose(seen.samples()[:, :2] @ [3e-3, -2.5e-3], here - 500.0, atol=1e-6)


def test_a_vertical_rig_carries_its_mass_on_a_spring() -> None:
    session = record(replace(SHORT, mounting="vertical"), "2", 1)
    weight_n = 60.0 * 9.81
    assert session.true_load_n.min() > weight_n + 1500.0 * LOWEST_M
    assert np.ptp(session.true_load_n) > 50.0

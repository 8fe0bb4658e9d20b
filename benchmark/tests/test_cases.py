"""Tasks and cases: what each shows, hides, adds and asks for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.linear import RidgeEstimator
from friction_benchmark.cases import (
    DRIFT_PA_S,
    LEVEL_STEP_PA,
    LEVELS,
    OFFSET_PA,
    LabelledRecording,
    Task,
    evaluation_case,
    shown_inputs,
    with_known_zeros,
)
from friction_benchmark.models.baselines import ByDirection
from friction_benchmark.tasks import TASKS, task_named
from friction_benchmark_models import CYLINDER, made_recording

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

CASE = made_recording("2", 1)
RAW = CASE.recording
AREAS = np.array([CYLINDER.piston_area_m2, -CYLINDER.annulus_area_m2])
SECRET = {"true_friction_n", "true_load_n", "load_force_n"}


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_a_case_holds_its_inputs_and_nothing_secret(task: Task) -> None:
    case = evaluation_case(task, CASE, 0)
    columns = set(case.recording.columns)
    assert set(task.inputs) <= columns
    assert not columns & SECRET
    assert np.isfinite(case.recording.column("friction_n")).all()


@pytest.mark.parametrize("name", ["pressure_free", "pressure_level"])
def test_raw_pressures_that_must_not_be_seen_are_zero(name: str) -> None:
    recording = evaluation_case(task_named(name), CASE, 0).recording
    assert not recording.column("pressure_1_pa").any()
    assert not recording.column("pressure_2_pa").any()


def test_identity_is_the_recording_itself() -> None:
    case = evaluation_case(task_named("identity"), CASE, 0)
    np.testing.assert_array_equal(case.recording.samples(), RAW.samples())
    np.testing.assert_array_equal(case.reference_n, RAW.column("friction_n"))
    np.testing.assert_array_equal(case.recording.usable(), RAW.usable())


@pytest.mark.parametrize(("name", "rows"), [("forecast_25ms", 5), ("forecast_100ms", 20), ("forecast_250ms", 50)])
def test_a_forecast_is_the_label_so_much_later_and_masked_at_the_end(name: str, rows: int) -> None:
    case = evaluation_case(task_named(name), CASE, 0)
    np.testing.assert_array_equal(case.reference_n[:-rows], RAW.column("friction_n")[rows:])
    np.testing.assert_array_equal(case.velocity_m_s[:-rows], RAW.column("velocity_m_s")[rows:])
    usable = case.recording.usable()
    assert not usable[-rows:].any()
    np.testing.assert_array_equal(usable[:-rows], RAW.usable()[:-rows] & RAW.usable()[rows:])
    np.testing.assert_array_equal(case.recording.samples(), RAW.samples())


def test_the_present_of_a_forecast_is_identity() -> None:
    now = evaluation_case(replace(task_named("forecast_250ms"), ahead_s=0.0), CASE, 0)
    np.testing.assert_array_equal(now.reference_n, RAW.column("friction_n"))


def level(pressure_pa: np.ndarray) -> np.ndarray:
    """Return the level shown of a pressure on the rod side."""
    shown = replace(CASE, recording=RAW.with_columns(pressure_2_pa=pressure_pa))
    return evaluation_case(task_named("pressure_level"), shown, 0).recording.column(LEVELS[1])


def test_a_level_is_the_mean_of_the_last_whole_second_held_for_one() -> None:
    raw = RAW.column("pressure_2_pa")
    shown = level(raw)
    np.testing.assert_allclose(shown[:200], raw[0], atol=0.5 * LEVEL_STEP_PA)
    np.testing.assert_allclose(shown[1400:], np.full(200, raw[1200:1400].mean()), atol=0.5 * LEVEL_STEP_PA)
    np.testing.assert_allclose(shown / LEVEL_STEP_PA, np.round(shown / LEVEL_STEP_PA))


def test_a_level_hides_what_happens_within_a_second() -> None:
    """Pressures that differ by bars, though not in the mean of a second, show one level: nothing can undo it."""
    raw = RAW.column("pressure_2_pa")
    within = 3e5 * np.sin(2.0 * np.pi * np.arange(len(raw)) / 200.0)
    np.testing.assert_array_equal(level(raw + within), level(raw))


def test_a_linear_filter_does_not_recover_friction_from_the_level() -> None:
    """Given the pressures a ridge is far better than a constant; given their levels it is worse."""
    train, test = ([made_recording("2", session) for session in own] for own in ((1, 2, 3, 4), (5, 6)))

    def error_n(estimator: FrictionEstimator, task: str) -> float:
        cases = [evaluation_case(task_named(task), each, 0).recording for each in test]
        estimator.fit([evaluation_case(task_named(task), each, 0).recording for each in train])
        return float(np.mean([np.abs(estimator.estimate(each) - each.column("friction_n")) for each in cases]))

    levels = shown_inputs(task_named("pressure_level"), RAW)
    constant_n = error_n(ByDirection(levels, viscous=False), "pressure_level")
    assert error_n(RidgeEstimator(60, 1e-3), "identity") < 0.5 * constant_n
    assert error_n(RidgeEstimator(60, 1e-3, levels), "pressure_level") > constant_n


def test_sensors_drift_linearly_from_an_offset_within_the_data_sheet() -> None:
    task = task_named("sensor_drift")
    case = evaluation_case(task, CASE, 0)
    error_pa = case.recording.samples()[:, :2] - RAW.samples()[:, :2]
    assert (np.abs(error_pa[0]) <= OFFSET_PA).all()
    rates = np.diff(error_pa, axis=0) / 0.005
    np.testing.assert_allclose(rates, np.broadcast_to(rates[0], rates.shape), atol=1e-3)
    assert (np.abs(rates[0]) <= DRIFT_PA_S).all()
    np.testing.assert_array_equal(case.recording.column("friction_n"), RAW.column("friction_n"))
    np.testing.assert_array_equal(case.reference_n, CASE.true_friction_n)


def test_a_drifting_sensor_is_stated_as_in_its_data_sheet_and_known_from_a_label_that_is_free_of_it() -> None:
    case = evaluation_case(task_named("sensor_drift"), CASE, 0)
    known = with_known_zeros(case.recording, CYLINDER)
    assert case.recording.metadata.uncertainty["pressure_1_pa"].zero == pytest.approx(OFFSET_PA / 3**0.5)
    assert not case.recording.metadata.identified_zero
    balances = [each.samples()[:, :2] @ AREAS for each in (known, known.zeroed())]
    errors = [np.abs((balance - RAW.column("friction_n"))[RAW.usable()]).mean() for balance in balances]
    assert errors[0] > 50.0
    offset_n = np.mean(RAW.samples()[:, :2] @ AREAS - RAW.column("friction_n"))
    assert np.mean(balances[1] - RAW.samples()[:, :2] @ AREAS) == pytest.approx(-offset_n, abs=1.0)
    assert errors[1] < 20.0
    assert np.ptp(balances[1] - RAW.samples()[:, :2] @ AREAS) < 3.0, "the drift is taken off too"


def test_every_recording_and_seed_has_other_sensors_and_the_same_ones_again() -> None:
    task = task_named("sensor_drift")
    made = {session: made_recording("2", session) for session in (1, 2)}
    drawn = [
        evaluation_case(task, made[session], seed).pressures_pa - made[session].recording.samples()[:, :2]
        for session, seed in ((1, 0), (2, 0), (1, 1), (1, 0))
    ]
    offsets = [each[0] for each in drawn]
    assert len({tuple(np.round(offset)) for offset in offsets}) == 3
    np.testing.assert_array_equal(drawn[0], drawn[3])


def test_further_draws_are_other_sensors_on_the_same_motion() -> None:
    task = task_named("sensor_drift")
    first, second = (evaluation_case(task, CASE, 0, draw) for draw in (0, 1))
    assert (first.pressures_pa[0] != second.pressures_pa[0]).all()
    np.testing.assert_array_equal(first.recording.column("position_m"), second.recording.column("position_m"))
    np.testing.assert_array_equal(first.reference_n, second.reference_n)


def test_a_load_is_known_to_the_scoring_alone() -> None:
    case = evaluation_case(task_named("external_load"), made_recording("1", 1, load_n=700.0), 0)
    assert case.true_load_n is not None
    assert case.true_load_n.min() == 700.0
    assert "load_force_n" not in case.recording.columns


def test_a_temperature_that_was_not_measured_is_no_input() -> None:
    bare = RAW.without_columns("oil_temperature_c")
    assert shown_inputs(task_named("pressure_free"), bare) == ("position_m",)
    assert shown_inputs(task_named("pressure_free"), RAW) == ("position_m", "oil_temperature_c")


def test_truth_that_is_not_known_cannot_be_asked_for() -> None:
    with pytest.raises(ValueError, match=r"task sensor_drift: true friction of recording .* is not known"):
        evaluation_case(task_named("sensor_drift"), LabelledRecording(RAW, None, None), 0)


def test_an_unknown_task_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="no task 'identify'; expected one of identity, pressure_free"):
        task_named("identify")

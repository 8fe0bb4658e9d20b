"""The filter of learned gain: its memory, its derivative, its limits, and that it beats a constant gain."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal

from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.loading import load_estimator
from friction_benchmark.models.learned_gain import GainPlan, LearnedGainEstimator, _track, track
from friction_benchmark.models.stroke_memory import MEMORY_NAMES, new_stroke_memory, remember_strokes

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

PLAN = GainPlan(presentations=14, stretch=200, batch_size=4)


def made(cylinder: Cylinder, recordings: Sequence[Recording], plan: GainPlan = PLAN) -> LearnedGainEstimator:
    estimator = LearnedGainEstimator(cylinder, 8, plan)
    estimator.fit(recordings)
    return estimator


def with_offsets(recordings: Sequence[Recording], offset_pa: float) -> list[Recording]:
    return [
        one.with_columns(pressure_1_pa=one.column("pressure_1_pa") + (-1) ** number * offset_pa)
        for number, one in enumerate(recordings)
    ]


@pytest.fixture(scope="module")
def fitted(cylinder: Cylinder, labelled_recordings: list[Recording]) -> LearnedGainEstimator:
    return made(cylinder, labelled_recordings[1:])


@pytest.mark.parametrize("cuts", [(1, 2, 3), (7, 500, 501, 1999), (2000,)])
def test_cutting_the_samples_changes_no_bit(
    fitted: LearnedGainEstimator, labelled_recordings: list[Recording], cuts: tuple[int, ...]
) -> None:
    samples = labelled_recordings[0].samples()
    state = fitted.new_state()
    pieces = [fitted.advance(state, piece) for piece in np.split(samples, cuts)]
    assert_array_equal(np.concatenate(pieces), fitted.estimate(labelled_recordings[0]))


def test_it_learns_more_than_a_constant_gain_can(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    train, test = labelled_recordings[1:], labelled_recordings[0]
    learnt = made(cylinder, train, replace(PLAN, presentations=56))
    constant = LowPassForceBalanceEstimator(cylinder)
    constant.fit(train)
    truth_n = test.column("friction_n")
    errors = [np.abs(each.estimate(test) - truth_n).mean() for each in (learnt, constant)]
    assert errors[0] < 0.9 * errors[1]


def test_strokes_are_remembered_where_sensors_are_far_off(
    fitted: LearnedGainEstimator, cylinder: Cylinder, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    assert fitted.features is not None
    assert not fitted.features.strokes
    far_off = made(cylinder, with_offsets(labelled_recordings, 1e5), replace(PLAN, presentations=1))
    assert far_off.features is not None
    assert far_off.features.strokes
    assert far_off.features.names[-len(MEMORY_NAMES) :] == MEMORY_NAMES
    far_off.save(tmp_path)
    expected = far_off.estimate(labelled_recordings[0])
    assert_array_equal(load_estimator(tmp_path).estimate(labelled_recordings[0]), expected)
    state, samples = far_off.new_state(), labelled_recordings[0].samples()
    pieces = [far_off.advance(state, piece) for piece in np.split(samples, (5, 1234))]
    assert_array_equal(np.concatenate(pieces), expected)


def test_pressures_must_come_first(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    estimator = LearnedGainEstimator(cylinder, 4, PLAN, ("position_m",))
    with pytest.raises(ValueError, match="inputs that begin with pressure_1_pa, pressure_2_pa, position_m, but got"):
        estimator.fit(labelled_recordings)


def test_further_inputs_are_seen(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    warm = [
        one.with_columns(oil_temperature_c=np.linspace(20.0, 40.0 + number, len(one)))
        for number, one in enumerate(labelled_recordings)
    ]
    inputs = ("pressure_1_pa", "pressure_2_pa", "position_m", "oil_temperature_c")
    estimator = LearnedGainEstimator(cylinder, 4, replace(PLAN, presentations=1), inputs)
    estimator.fit(warm[1:])
    assert estimator.features is not None
    assert "oil_temperature_c_20" in estimator.features.names
    hotter = warm[0].with_columns(oil_temperature_c=warm[0].column("oil_temperature_c") + 5.0)
    assert not np.array_equal(estimator.estimate(warm[0]), estimator.estimate(hotter))


@pytest.mark.parametrize("wrong", [{"presentations": 0}, {"stretch": 0}, {"batch_size": 0}])
def test_a_plan_that_cannot_be_followed_is_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="presentations, batch size and stretch of at least 1, but got"):
        replace(PLAN, **wrong)


def test_training_and_running_track_alike() -> None:
    gain, balance = torch.rand(2, 12, 3, generator=torch.Generator().manual_seed(0))
    tracked = track(gain, balance, balance[0])
    expected = [
        _track(*(part[:, one].double().numpy() for part in (balance, gain)), np.full(1, np.nan)) for one in range(3)
    ]
    np.testing.assert_allclose(tracked.numpy(), np.stack(expected, axis=1), rtol=1e-5)


@pytest.mark.parametrize(
    ("gain", "expected"), [(0.0, [5.0, 5.0, 5.0]), (1.0, [5.0, 1.0, -3.0]), (0.5, [5.0, 3.0, 0.0])]
)
def test_the_filter_begins_at_the_first_force_balance(gain: float, expected: list[float]) -> None:
    tracked = _track(np.array([5.0, 1.0, -3.0]), np.full(3, gain), np.full(1, np.nan))
    assert tracked.tolist() == expected


def strokes(velocity: Array, balance_n: Array) -> dict[str, Array]:
    rows = remember_strokes(velocity, balance_n, np.full(len(velocity), 30e5), new_stroke_memory())
    return dict(zip(MEMORY_NAMES, rows.T, strict=True))


def test_the_memory_of_strokes_reveals_an_offset() -> None:
    velocity = 0.05 * np.repeat([1.0, -1.0], 1000)
    seen = strokes(velocity, 300.0 * np.sign(velocity) + 40.0)
    both = (1000.0 / 1200.0) ** 2
    assert seen["both_strokes_known"][-1] == pytest.approx(both)
    assert seen["stroke_sum_over_difference"][-1] == pytest.approx(both * 80.0 / 600.0)
    assert seen["stroke_difference"][-1] == pytest.approx(both * 600.0 / 500.0)
    assert seen["pressure_2_out"][-1] == pytest.approx(1000.0 / 1200.0)
    assert seen["speed_in"][-1] == pytest.approx(1000.0 / 1200.0)


def test_the_memory_of_strokes_forgets_nothing_at_rest_and_learns_nothing_of_creep() -> None:
    velocity = np.concatenate([np.full(300, 0.05), np.full(500, 2e-3)])
    balance_n = np.concatenate([np.full(300, 250.0), np.full(500, 900.0)])
    rows = remember_strokes(velocity, balance_n, np.zeros(800), new_stroke_memory())
    assert_array_equal(rows[299], rows[-1])
    assert not strokes(velocity, balance_n)["both_strokes_known"].any()

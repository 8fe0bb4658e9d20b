"""Calibration sessions that differ in noise give each level of noise bounds of its own."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.saved_folder import DESCRIPTION_FILE
from cylinder_friction.realtime.bounds import SLIDING
from cylinder_friction.realtime.bounds_by_noise import noise_levels
from cylinder_friction.realtime.trained_for import pressure_noise_pa
from cylinder_friction.recordings.recording import Recording
from noisy_recordings import with_noise

NOISE_PA = 1e5  # 20 times that of the made recordings


def calibrated(cylinder: Cylinder, train: list[Recording], on: list[Recording]) -> LowPassForceBalanceEstimator:
    model = LowPassForceBalanceEstimator(cylinder).fit(train)
    model.calibrate(train, on, cylinder)
    return model


@pytest.fixture(scope="module")
def mixed(twelve_recordings: list[Recording]) -> list[Recording]:
    """Four quiet sessions and four noisy ones, in turn."""
    return [with_noise(each, NOISE_PA) if place % 2 else each for place, each in enumerate(twelve_recordings[:8])]


@pytest.fixture(scope="module")
def model(
    cylinder: Cylinder, twelve_recordings: list[Recording], mixed: list[Recording]
) -> LowPassForceBalanceEstimator:
    return calibrated(cylinder, twelve_recordings[:4], mixed)


def test_a_level_is_of_sessions_alike_in_noise(twelve_recordings: list[Recording], mixed: list[Recording]) -> None:
    names = [each.metadata.session for each in twelve_recordings]
    assert [sorted(level) for level in noise_levels(twelve_recordings)] == [sorted(names)]
    assert [sorted(level) for level in noise_levels(mixed)] == [names[:8:2], names[1:8:2]]
    other = replace(mixed[0], metadata=replace(mixed[0].metadata, session=names[1]))
    assert noise_levels([other, *mixed[1:3]]) == [[names[2]], [names[1]]], "a session is at one level"
    assert noise_levels([]) == []
    flat = mixed[0].with_columns(pressure_1_pa=np.ones(len(mixed[0])), pressure_2_pa=np.ones(len(mixed[0])))
    assert noise_levels([flat, mixed[1]]) == [names[:2]], "without noise nothing is known of it"


def test_bounds_are_those_of_the_sessions_as_noisy_as_a_recording(
    cylinder: Cylinder, twelve_recordings: list[Recording], mixed: list[Recording], model: LowPassForceBalanceEstimator
) -> None:
    quiet, noisy = (calibrated(cylinder, twelve_recordings[:4], mixed[first::2]).bounds for first in (0, 1))
    assert quiet is not None
    assert noisy is not None
    assert quiet.upper_n[SLIDING] < 0.1 * noisy.upper_n[SLIDING]
    assert [each.bounds for each in model.bounds_by_noise] == [quiet, noisy]
    assert model.bounds == noisy, "half of the sessions are noisy: a step without a measured noise has the wider ones"
    recording = twelve_recordings[8]
    assert model.with_bounds_for([recording]).bounds == quiet
    assert model.with_bounds_for([with_noise(recording, NOISE_PA)]).bounds == noisy
    between = with_noise(recording, 0.3 * NOISE_PA)
    assert model.with_bounds_for([between]).bounds == noisy
    assert model.noise_level(pressure_noise_pa([recording])) == model.bounds_by_noise[0]


def test_beyond_the_noisiest_sessions_bounds_grow_with_noise(
    twelve_recordings: list[Recording], model: LowPassForceBalanceEstimator
) -> None:
    noisier = with_noise(twelve_recordings[8], 4.0 * NOISE_PA)
    level = model.bounds_by_noise[-1]
    times = pressure_noise_pa([noisier]) / level.noise_pa
    assert times == pytest.approx(4.0, rel=0.1)
    wider = model.with_bounds_for([noisier])
    assert wider.bounds is not None
    np.testing.assert_allclose(wider.bounds.upper_n, times * np.array(level.bounds.upper_n))
    assert wider.with_bounds_for([twelve_recordings[8]]).bounds == model.bounds_by_noise[0].bounds


@pytest.mark.parametrize("noise_pa", [0.0, NOISE_PA])
def test_bounds_hold_as_often_as_stated_at_each_level(
    twelve_recordings: list[Recording], model: LowPassForceBalanceEstimator, noise_pa: float
) -> None:
    held = []
    for recording in twelve_recordings[8:11]:
        given = with_noise(recording, noise_pa)
        steps, _ = model.with_bounds_for([given]).real_time().run(given.samples())
        label_n = given.column("friction_n")
        held.append(((steps[:, 1] <= label_n) & (label_n <= steps[:, 2]))[600:])
    assert 0.85 < np.concatenate(held).mean() < 0.97


def test_a_level_of_one_session_or_of_few_rows_has_no_bounds(
    cylinder: Cylinder, twelve_recordings: list[Recording], mixed: list[Recording]
) -> None:
    train, quiet = twelve_recordings[:4], mixed[::2]
    alone = calibrated(cylinder, train, [mixed[1], *quiet])
    few = [each.with_columns(usable=np.arange(len(each)) < 1000) for each in mixed[1:5:2]]
    for model in (alone, calibrated(cylinder, train, [*few, *quiet])):
        assert model.bounds_by_noise == ()
        assert model.bounds == calibrated(cylinder, train, quiet).bounds
    one_of_each = calibrated(cylinder, train, mixed[:2])
    assert one_of_each.bounds_by_noise == ()
    assert one_of_each.bounds is not None
    assert alone.bounds is not None
    assert one_of_each.bounds.upper_n[SLIDING] > 3.0 * alone.bounds.upper_n[SLIDING], "of both sessions together"


def test_levels_are_saved_if_there_are_several(
    cylinder: Cylinder, twelve_recordings: list[Recording], model: LowPassForceBalanceEstimator, tmp_path: Path
) -> None:
    model.save(tmp_path / "mixed")
    assert load_estimator(tmp_path / "mixed").bounds_by_noise == model.bounds_by_noise
    calibrated(cylinder, twelve_recordings[:4], twelve_recordings[4:8]).save(tmp_path / "alike")
    assert "bounds_by_noise" not in json.loads((tmp_path / "alike" / DESCRIPTION_FILE).read_text())
    wrong = replace(model.bounds_by_noise[0].bounds, upper_n=(-1e9,) * 4)
    damaged = LowPassForceBalanceEstimator.load(tmp_path / "mixed")
    damaged.bounds_by_noise = (replace(model.bounds_by_noise[0], bounds=wrong), model.bounds_by_noise[1])
    damaged.save(tmp_path / "damaged")
    with pytest.raises(ValueError, match=r"bounds\.lower_n: .* is above upper_n"):
        load_estimator(tmp_path / "damaged")

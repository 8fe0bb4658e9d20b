"""A model knows the cylinder, the level of friction and the noise it was trained for, and says what differs."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.flags import unknown_in_words
from cylinder_friction.realtime.trained_for import TrainedFor, pressure_noise_pa
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.noise import times_as_noisy
from noisy_recordings import with_noise


@pytest.fixture(scope="module")
def trained(labelled_recordings: list[Recording], cylinder: Cylinder) -> TrainedFor:
    return TrainedFor.of(labelled_recordings, cylinder)


def test_it_is_saved_and_read_with_the_model(small_hybrid: HybridEstimator, tmp_path) -> None:
    small_hybrid.save(tmp_path)
    read = HybridEstimator.load(tmp_path)
    assert read.trained_for == small_hybrid.trained_for
    assert read.trained_for is not None
    assert read.trained_for.in_words().startswith("a cylinder of 63 mm bore and 28 mm rod, with friction of ")
    low, high = f"{read.trained_for.friction_n / 2:.0f}", f"{2 * read.trained_for.friction_n:.0f}"
    assert f"if it leaves {low} to {high} N, its estimates are not to be used" in read.trained_for.in_words()
    assert "noisier" not in replace(read.trained_for, pressure_noise_pa=0.0).in_words(), "it has no pressures"
    assert read.step_model().trained_for == read.trained_for
    with pytest.raises(ValueError, match="expected finite numbers"):
        TrainedFor(np.nan, 0.03, 300.0, 1e3)


def differences(trained: TrainedFor, recording: Recording) -> tuple[str, str]:
    return trained.differences([recording], pressure_noise_pa([recording]))


def test_another_level_of_friction_and_other_noise_are_named(
    trained: TrainedFor, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    label_n = recording.column("friction_n")
    like = recording.with_columns(label_n=label_n)
    assert differences(trained, like) == ("", "")
    other, _ = differences(trained, like.with_columns(label_n=label_n / 3.0))
    assert other.startswith("friction is about 0.2")
    noisy = with_noise(like, 1e5)
    times = times_as_noisy(pressure_noise_pa([noisy]), trained.pressure_noise_pa)
    assert times == pytest.approx(1e5 / trained.pressure_noise_pa, rel=0.1)
    words = f"pressures are {times:.1f} times as noisy as those that this model knows, and bounds as much wider"
    assert differences(trained, noisy) == ("", words)
    a_little = with_noise(like, 0.8 * trained.pressure_noise_pa)  # 1.3 times as noisy
    assert differences(trained, a_little) == ("", "")


def test_the_noise_is_that_of_the_recordings_that_bounds_come_from(
    trained: TrainedFor, labelled_recordings: list[Recording]
) -> None:
    noisy = [with_noise(each, 1e5) for each in labelled_recordings]
    assert trained.calibrated_on(labelled_recordings[:2]) == trained, "about as noisy as training"
    assert trained.calibrated_on(noisy).pressure_noise_pa == pytest.approx(1e5, rel=0.1)
    quiet = replace(trained, pressure_noise_pa=1e5).calibrated_on(labelled_recordings)
    assert quiet.pressure_noise_pa == pytest.approx(trained.pressure_noise_pa)


def test_rows_that_a_model_does_not_know_are_named() -> None:
    assert unknown_in_words(4000, {"UNMODELLED_FORCE": 3520}) == (
        "88 % of the rows hold a force that this model does not know"
    )
    assert unknown_in_words(4000, {"OUTSIDE": 1200}) == "30 % of the rows lie outside the range of its training"
    assert unknown_in_words(4000, {"OUTSIDE": 900, "UNMODELLED_FORCE": 900}) == ""
    assert unknown_in_words(900, {"OUTSIDE": 900}) == "", "too few rows to speak of"


def test_a_recording_without_usable_rows_says_nothing_of_friction(
    labelled_recordings: list[Recording], cylinder: Cylinder
) -> None:
    first = labelled_recordings[0]
    resting = first.with_columns(usable=np.zeros(len(first), dtype=np.bool_))
    assert TrainedFor.of([first, resting], cylinder).friction_n == TrainedFor.of([first], cylinder).friction_n

"""What the served model does with rows: its own sequences, its flag, and refusals that the guide does not list."""

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.deployment.scoring import ScoringError, ServedModel
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from learned_offset import learning_hybrid, offset_samples
from served_rows import score

__all__ = ["learning_hybrid", "offset_samples"]


@pytest.fixture(scope="session")
def small_served(small_model: StepModel) -> ServedModel:
    return ServedModel(small_model)


def rows_of(recording: Recording, count: int | None = None) -> pd.DataFrame:
    return recording.table[list(SAMPLE_COLUMNS)].iloc[:count].reset_index(drop=True)


def test_one_recording_is_scored_as_every_runtime_runs_it(
    small_served: ServedModel,
    small_model: StepModel,
    small_hybrid: HybridEstimator,
    labelled_recordings: list[Recording],
) -> None:
    recording = labelled_recordings[0]
    scored = score(small_served, rows_of(recording))
    assert list(scored.columns) == ["friction_n", "lower_n", "upper_n", "flags", "flag_names", "in_training_range"]
    newtons, flags = RealTimeStream(small_model).run(recording.samples())
    np.testing.assert_array_equal(scored[["friction_n", "lower_n", "upper_n"]], newtons)
    np.testing.assert_array_equal(scored["flags"], flags)
    assert [tuple(names.split()) for names in scored["flag_names"]] == [Flag.names(value) for value in flags]
    np.testing.assert_array_equal(scored["friction_n"], small_hybrid.estimate(recording))
    assert scored["in_training_range"].all()


def test_an_estimator_that_learns_the_sensors_offset_states_what_it_has_learned(
    learning_hybrid: HybridEstimator, offset_samples: np.ndarray
) -> None:
    """Each recording is a session of its own, whose offset nobody knows before."""
    finite = offset_samples[10:800]
    samples = np.concatenate([finite, finite])
    rows = pd.DataFrame(samples, columns=list(SAMPLE_COLUMNS)).assign(recording=["one"] * 790 + ["other"] * 790)
    scored = score(ServedModel(learning_hybrid.step_model()), rows)
    offsets, flags = [], []
    for half in np.split(samples, 2):
        stream = learning_hybrid.real_time()
        for sample in half:
            flags.append(stream.step(*sample).flags)
            offsets.append(stream.offset)
    np.testing.assert_array_equal(scored[["offset_n", "offset_uncertainty_n"]], offsets)
    np.testing.assert_array_equal(scored["flags"], flags)
    np.testing.assert_array_equal(scored.iloc[:790, :6], scored.iloc[790:, :6])
    unknown = np.array(flags) & Flag.OFFSET_UNKNOWN != 0
    assert unknown[:50].all()
    assert not unknown[780:790].any()


def test_an_estimator_on_other_inputs_is_scored_on_them(labelled_recordings: list[Recording]) -> None:
    recordings = [each.with_columns(oil_temperature_c=30.0 + each.column("position_m")) for each in labelled_recordings]
    inputs = ("position_m", "oil_temperature_c")
    ridge = RidgeEstimator(lags=4, inputs=inputs).fit(recordings)
    scored = score(ServedModel(ridge.step_model()), recordings[0].table[list(inputs)])
    np.testing.assert_allclose(scored["friction_n"], ridge.estimate(recordings[0]), atol=1e-6)
    with pytest.raises(ScoringError, match="column 'oil_temperature_c' is missing"):
        score(ServedModel(ridge.step_model()), rows_of(recordings[0]))


def test_motion_spikes_and_held_values_are_no_other_recording(
    small_served: ServedModel, labelled_recordings: list[Recording]
) -> None:
    for recording in labelled_recordings:
        rows = rows_of(recording)
        score(small_served, rows)
        place = rows["position_m"]
        for bad in (place.where(place.index != 300, place[300] + 0.01), place.where(place.index != 0, 1e9)):
            score(small_served, rows.assign(position_m=bad))


@pytest.mark.parametrize(("row", "count"), [(1, 500), (2, 500), (250, 500), (250, 251)])
def test_a_jump_of_the_position_is_another_recording(
    row: int, count: int, small_served: ServedModel, labelled_recordings: list[Recording]
) -> None:
    rows = rows_of(labelled_recordings[0], count)
    rows["position_m"] += 0.02 * (np.arange(count) >= row)
    with pytest.raises(ScoringError, match=rf"jumps from .* at row {row}, which no piston does: another recording"):
        score(small_served, rows)
    named = rows.assign(recording=np.where(np.arange(count) < row, "one", "other"))
    score(small_served, named)
    both = pd.concat([rows_of(labelled_recordings[1], 500).assign(recording=1), rows.assign(recording=2)])
    with pytest.raises(ScoringError, match=rf"at row {row + 500}, "):
        score(small_served, both)


def test_times_are_checked_within_each_recording(
    small_served: ServedModel, labelled_recordings: list[Recording]
) -> None:
    rows = rows_of(labelled_recordings[0], 100)
    jitter = 0.001 * np.random.default_rng(0).random(100)
    ticks = 1e9 + 0.005 * np.arange(100) + jitter
    plain = score(small_served, rows)
    pd.testing.assert_frame_equal(score(small_served, rows.assign(time_s=ticks)), plain)
    two = pd.concat([rows.assign(time_s=ticks, recording=name) for name in ("one", "other")])
    score(small_served, two)
    with pytest.raises(
        ScoringError, match=r"time_s goes on by -.* s at row 100, expected 0.005 s .* name each recording"
    ):
        score(small_served, two.drop(columns="recording"))
    with pytest.raises(ScoringError, match=r"column 'time_s' holds '8:00' at row 0"):
        score(small_served, rows.assign(time_s="8:00"))


def test_a_sample_out_of_range_makes_doubtful_the_second_after_it(
    small_served: ServedModel, labelled_recordings: list[Recording]
) -> None:
    rows = rows_of(labelled_recordings[0], 500)
    rows.loc[100, "pressure_1_pa"] = 3e8
    flags = score(small_served, rows.assign(recording="spiked"))["in_training_range"].to_numpy()
    assert flags[:100].all()
    assert not flags[100:300].any()
    assert flags[300:].all()
    both = pd.concat([rows.assign(recording="spiked"), rows_of(labelled_recordings[0], 50).assign(recording="calm")])
    assert score(small_served, both)["in_training_range"].to_numpy()[500:].all(), "another recording is not affected"

"""The Python streams: rows and runs alike, never poisoned, at rest without denormal numbers."""

import numpy as np
import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.packed import ROWS
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording
from learned_offset import learning


def test_after_rubbish_it_comes_back_to_the_undisturbed_estimate(
    small_model: StepModel, labelled_recordings: list[Recording]
) -> None:
    samples = labelled_recordings[0].samples()
    undisturbed, _ = RealTimeStream(small_model).run(samples)
    spoilt = samples.copy()
    spoilt[1000:1200] = np.nan
    newtons, flags = RealTimeStream(small_model).run(spoilt)
    back = 1200 + small_model.guard.recovery_samples
    assert (flags[1200:back] == Flag.RECOVERING).all()
    assert (flags[back:] == 0).all()
    assert np.abs(newtons[back:, 0] - undisturbed[back:, 0]).max() < 0.5


def test_a_run_is_its_steps_wherever_it_is_cut(small_model: StepModel, labelled_recordings: list[Recording]) -> None:
    samples = labelled_recordings[0].samples()[:400].copy()
    samples[: ROWS + 3, 1] = np.nan
    one = RealTimeStream(small_model)
    stepped = [one.step(*sample) for sample in samples]
    other = RealTimeStream(small_model)
    pieces = [other.run(samples[start:end]) for start, end in ((0, 1), (1, 1), (1, 250), (250, 400))]
    newtons, flags = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    np.testing.assert_array_equal(newtons, [estimate[:3] for estimate in stepped])
    np.testing.assert_array_equal(flags, [estimate.flags for estimate in stepped])


def test_after_warm_up_the_estimate_is_to_be_trusted(small_hybrid: HybridEstimator) -> None:
    stream = small_hybrid.real_time()
    sample = (9e5, 1.0e6, 0.125)
    assert stream.step(*sample).flags == Flag.WARMING
    stream.warm_up(*sample)
    first = stream.step(*sample)
    assert first.flags == 0
    stream.warm_up(*sample, steps=stream.model.guard.warm_up_samples + 1)
    assert stream.step(*sample).friction_n == pytest.approx(first.friction_n, abs=0.5)


def test_whole_numbers_and_numpy_numbers_are_taken(small_model: StepModel) -> None:
    expected = RealTimeStream(small_model).step(1_000_000.0, 900_000.0, 0.0)
    assert RealTimeStream(small_model).step(1_000_000, 900_000, 0) == expected
    assert RealTimeStream(small_model).step(np.float64(1e6), np.float32(9e5), np.int64(0)) == expected


def test_a_long_hold_leaves_no_denormal_number_behind(small_model: StepModel) -> None:
    quiet = RealTimeStream(small_model)
    quiet._packed.network.bias[:] = -20.0  # every gate shut: cells sink towards 0 for ever
    quiet._packed.network.input[:] = 0.0
    quiet._packed.network.recurrent[:] = 0.0
    quiet._state.lstm[:] = 1e-3
    newtons, _ = quiet.run(np.tile((1.2e6, 1.0e6, 0.125), (2000, 1)))
    state = quiet._state.lstm
    assert ((state == 0.0) | (np.abs(state) >= 1e-30)).all()
    assert np.isfinite(newtons).all()


def test_one_list_in_place_of_numbers_is_named(small_hybrid: HybridEstimator) -> None:
    for stream in (small_hybrid.real_time(), small_hybrid.stream()):
        with pytest.raises(
            TypeError, match=r"got one list, but expected pressure_1_pa, .*; give its numbers one by one"
        ):
            stream.step([1e5, 1e5, 0.1])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("learns", "start"),
    [(False, (1.0, None)), (False, (0.0, 5.0))]
    + [(True, start) for start in ((np.nan, None), (np.inf, 1.0), (0.0, -1.0), (0.0, np.nan), (0.0, np.inf))],
)
def test_an_offset_to_start_from_must_be_possible(
    small_model: StepModel, learns: bool, start: tuple[float, float | None]
) -> None:
    stream = RealTimeStream(learning(small_model) if learns else small_model)
    words = "a finite offset and an uncertainty of at least 0 N, but got" if learns else "no offset to start from"
    with pytest.raises(ValueError, match=f"expected {words}"):
        stream.reset(*start)
    assert learns or stream.offset == (0.0, 0.0)


def test_before_the_first_valid_sample_the_offset_is_what_was_given(small_model: StepModel) -> None:
    stream = RealTimeStream(learning(small_model))
    stream.reset(25.0, 5.0)
    newtons, offsets, flags = stream.run_with_offset(np.full((30, 3), np.nan))
    assert not newtons.any()
    assert (flags & Flag.NOT_READY != 0).all()
    np.testing.assert_allclose(offsets, np.tile(offsets[:1], (30, 1)), rtol=0.0)
    assert offsets[0, 0] == 25.0

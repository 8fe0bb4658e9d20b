"""What an instance remembers, and what it must never remember."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.stream import RealTimeStream
from learned_offset import learning

if TYPE_CHECKING:
    from collections.abc import Callable

    from cylinder_friction.deployment.c_export.compiled import CompiledEstimator, CompiledStream
    from cylinder_friction.realtime.model import StepModel


def floats_of(stream: CompiledStream, model: StepModel) -> np.ndarray:
    """Return the single-precision part of the state: hidden and cell values, which stand before the counters."""
    assert model.network is not None
    count = 2 * model.network.layers * model.network.nodes
    lags = max(taps.shape[-1] for taps in (model.feature_taps, model.base_taps, model.velocity_taps))
    doubles = 3 * 2 * lags + 3 + 2
    numbers = np.frombuffer(stream.saved(), dtype=np.float32)[2 * doubles :]
    counters = 10
    return numbers[counters : counters + count]


def test_reset_is_exact(compiled: Callable[..., CompiledEstimator], trajectories: dict[str, np.ndarray]) -> None:
    stream = compiled("whole").stream()
    first = stream.run(trajectories["bad_samples"])
    stream.reset()
    again = stream.run(trajectories["bad_samples"])
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])


def test_reset_forgets_the_offset_and_can_begin_from_a_known_one(
    compiled: Callable[..., CompiledEstimator], golden_model: StepModel, offset_samples: np.ndarray
) -> None:
    stream, python = compiled("learning").stream(), RealTimeStream(learning(golden_model))
    for start in ((0.0, None), (90.0, 4.0), (90.0, 0.0), (-30.0, None)):
        stream.reset(*start)
        python.reset(*start)
        assert stream.offset == pytest.approx(python.offset, rel=1e-12)
        newtons, flags = stream.run(offset_samples[:1500])
        expected, expected_flags = python.run(offset_samples[:1500])
        np.testing.assert_array_equal(flags, expected_flags)
        np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("start", [(math.nan, 4.0), (math.inf, 4.0), (90.0, math.nan), (90.0, math.inf), (1e10, 4.0)])
def test_an_offset_that_is_no_number_is_not_begun_from(
    start: tuple[float, float], compiled: Callable[..., CompiledEstimator]
) -> None:
    stream, fresh = compiled("learning").stream(), compiled("learning").stream()
    stream.reset(*start)
    assert stream.saved() == fresh.saved()


def test_an_offset_is_not_taken_where_none_is_learned(compiled: Callable[..., CompiledEstimator]) -> None:
    stream = compiled("whole").stream()
    assert stream.offset == (0.0, 0.0)
    with pytest.raises(ValueError, match="this estimator learns no sensor offset"):
        stream.reset(1.0)


def test_instances_do_not_touch_each_other(
    compiled: Callable[..., CompiledEstimator], trajectories: dict[str, np.ndarray]
) -> None:
    samples = trajectories["stick_slip_reversals"][:300]
    alone, _ = compiled("whole").stream().run(samples)
    one, other = compiled("whole").stream(), compiled("whole").stream()
    beside = []
    for sample in samples:
        beside.append(one.step(*sample)[:3])
        other.step(*(0.5 * sample))
    np.testing.assert_array_equal(beside, alone)


@pytest.mark.parametrize("shape", ["whole", "learning"])
def test_a_saved_state_goes_on_where_it_was(
    shape: str, compiled: Callable[..., CompiledEstimator], trajectories: dict[str, np.ndarray]
) -> None:
    samples = trajectories["bad_samples"]
    stream = compiled(shape).stream()
    stream.run(samples[:700])
    saved = stream.saved()
    expected = stream.run(samples[700:])
    restored = compiled(shape).stream()
    restored.restore(saved)
    went_on = restored.run(samples[700:])
    np.testing.assert_array_equal(went_on[0], expected[0])
    np.testing.assert_array_equal(went_on[1], expected[1])


@pytest.mark.parametrize("shape", ["whole", "learning"])
def test_warm_up_leaves_the_state_of_as_many_steps(
    shape: str, compiled: Callable[..., CompiledEstimator], golden_model: StepModel, trajectories: dict[str, np.ndarray]
) -> None:
    sample = trajectories["stick_slip_reversals"][0].tolist()
    stepped, warmed = compiled(shape).stream(), compiled(shape).stream()
    warmed.run(trajectories["frozen"][:50])
    for _ in range(golden_model.guard.warm_up_samples):
        stepped.step(*sample)
    warmed.warm_up(*sample, steps=golden_model.guard.warm_up_samples)
    assert warmed.saved() == stepped.saved()
    assert not warmed.step(*sample).flags & Flag.WARMING


def test_nothing_is_poisoned(
    compiled: Callable[..., CompiledEstimator], golden_model: StepModel, trajectories: dict[str, np.ndarray]
) -> None:
    """After the worst of samples and the time that recovery states, a stream is where an undisturbed one is."""
    samples = trajectories["stick_slip_reversals"]
    disturbed = samples.copy()
    disturbed[200:230] = [[np.nan, np.inf, -np.inf]]
    newtons, flags = compiled("whole").stream().run(disturbed)
    expected, _ = compiled("whole").stream().run(samples)
    assert np.isfinite(newtons).all()
    invalid = Flag.INVALID_PRESSURE_1 | Flag.INVALID_PRESSURE_2 | Flag.INVALID_POSITION
    assert (flags[200:230] & invalid == invalid).all()
    recovered = np.flatnonzero((flags == 0) & (np.arange(len(flags)) >= 230))
    assert recovered[0] <= 230 + golden_model.guard.recovery_samples
    np.testing.assert_allclose(newtons[recovered, 0], expected[recovered, 0], atol=2.0)


def test_long_holds_leave_no_denormal_number(
    compiled: Callable[..., CompiledEstimator], golden_model: StepModel, trajectories: dict[str, np.ndarray]
) -> None:
    stream = compiled("lstm").stream()
    stream.run(trajectories["stick_slip_reversals"])
    hold = trajectories["stick_slip_reversals"][-1].tolist()
    for _ in range(200_000):
        stream.step(*hold)
    values = np.abs(floats_of(stream, golden_model))
    assert np.count_nonzero(values) > 0
    assert not np.any((values > 0.0) & (values < np.finfo(np.float32).tiny))

"""What an instance remembers, and what it must never remember."""

import math
from collections.abc import Callable

import numpy as np
import pytest

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

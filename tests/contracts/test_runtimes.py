"""One suite that every runtime passes: golden trajectories, exact reset, warm-up, streams apart, nothing poisoned."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from contracts.runtimes import all_runtimes, run
from contracts.tolerances import TOLERANCES_N
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.reference import ReferenceStream
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from contracts.runtimes import Stream
    from cylinder_friction.realtime.model import StepModel

GOLDEN = Path(__file__).parents[1] / "golden"
TRAJECTORIES = read_trajectories(GOLDEN)
RUNTIMES = {runtime.name: runtime for runtime in all_runtimes()}
STEPPING = sorted(name for name, runtime in RUNTIMES.items() if getattr(runtime, "steps", True))


@pytest.fixture(scope="module")
def model() -> StepModel:
    return load_estimator(GOLDEN / MODEL_FOLDER).step_model()


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One folder a runtime, so that what it builds is built once."""
    return {name: tmp_path_factory.mktemp(name) for name in RUNTIMES}


@pytest.fixture
def opened(model: StepModel, folders: dict[str, Path]) -> Iterator[Callable[[str], Stream]]:
    streams: list[Stream] = []

    def open_one(name: str) -> Stream:
        streams.append(RUNTIMES[name].open(model, folders[name]))
        return streams[-1]

    yield open_one
    for stream in streams:
        stream.close()


def assert_meets(
    name: str, newtons: np.ndarray, flags: np.ndarray, expected: np.ndarray, expected_flags: np.ndarray
) -> None:
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=TOLERANCES_N[name])


def referred(model: StepModel, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    stream = ReferenceStream(model)
    outputs = [stream.step(*sample) for sample in samples]
    return np.array([output[:3] for output in outputs]), np.array([output.flags for output in outputs])


@pytest.mark.parametrize("trajectory", sorted(TRAJECTORIES))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_it_meets_the_golden_trajectory(name: str, trajectory: str, opened: Callable[[str], Stream]) -> None:
    golden = TRAJECTORIES[trajectory]
    newtons, flags = run(opened(name), golden.samples)
    assert_meets(name, newtons, flags, golden.newtons, golden.flags)


@pytest.mark.parametrize("name", STEPPING)
def test_reset_is_exact(name: str, opened: Callable[[str], Stream]) -> None:
    samples = TRAJECTORIES["bad_samples"].samples[:700]
    stream = opened(name)
    first, first_flags = run(stream, samples)
    stream.reset()
    again, again_flags = run(stream, samples)
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(again_flags, first_flags)


@pytest.mark.parametrize("name", STEPPING)
def test_two_streams_do_not_touch_each_other(name: str, opened: Callable[[str], Stream]) -> None:
    samples = TRAJECTORIES["stick_slip_reversals"].samples[:300]
    alone, _ = run(opened(name), samples)
    one, other = opened(name), opened(name)
    beside = []
    for sample in samples:
        beside.append(one.step(*sample)[:3])
        other.step(*(0.5 * sample))
    np.testing.assert_array_equal(beside, alone)


@pytest.mark.parametrize("name", STEPPING)
def test_warm_up_is_a_reset_and_then_steps_on_one_sample(
    name: str, model: StepModel, opened: Callable[[str], Stream]
) -> None:
    samples = TRAJECTORIES["stick_slip_reversals"].samples[:200]
    steps = model.guard.warm_up_samples
    expected, expected_flags = referred(model, np.concatenate([np.tile(samples[0], (steps, 1)), samples]))
    stream = opened(name)
    run(stream, samples[100:150])
    stream.warm_up(*samples[0], steps=steps)
    newtons, flags = run(stream, samples)
    assert not np.any(flags & Flag.WARMING)
    assert_meets(name, newtons, flags, expected[steps:], expected_flags[steps:])


@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_before_the_first_sound_sample_it_says_so_and_remembers_nothing(
    name: str, opened: Callable[[str], Stream]
) -> None:
    samples = TRAJECTORIES["stick_slip_reversals"].samples[:50]
    early = samples[:3].copy()
    early[0, 0], early[1, 1], early[2, 2] = np.nan, np.inf, 1e6
    newtons, flags = run(opened(name), np.concatenate([early, samples]))
    np.testing.assert_array_equal(newtons[:3], 0.0)
    invalid = [Flag.INVALID_PRESSURE_1, Flag.INVALID_PRESSURE_2, Flag.INVALID_POSITION]
    assert list(flags[:3]) == [Flag.NOT_READY | flag for flag in invalid]
    fresh, fresh_flags = run(opened(name), samples)
    np.testing.assert_array_equal(newtons[3:], fresh)
    np.testing.assert_array_equal(flags[3:], fresh_flags)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_whatever_comes_it_meets_the_reference(
    name: str, seed: int, model: StepModel, opened: Callable[[str], Stream]
) -> None:
    generator = np.random.default_rng(seed)
    samples = TRAJECTORIES["stick_slip_reversals"].samples[:600].copy()
    bad = generator.random(samples.shape) < 0.1
    samples[bad] = generator.choice([np.nan, np.inf, -np.inf, 1e300, -1e12, 5e-324, 0.0], int(bad.sum()))
    expected, expected_flags = referred(model, samples)
    newtons, flags = run(opened(name), samples)
    assert np.isfinite(newtons).all()
    assert_meets(name, newtons, flags, expected, expected_flags)


def test_every_runtime_has_its_place_in_the_table() -> None:
    assert set(RUNTIMES) <= set(TOLERANCES_N)

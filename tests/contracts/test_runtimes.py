"""One suite that every runtime passes: golden trajectories, exact reset, warm-up, separate streams, no bad state."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from contracts.runtimes import Stream, all_runtimes, run
from contracts.tolerances import RARELY_N, TOLERANCES_N
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.flags import Flag, invalid_flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories, trace
from golden_fixtures import GOLDEN

MODELS = {"pressures": GOLDEN, "pressure_free": GOLDEN / "pressure_free", "learns_offset": GOLDEN / "learns_offset"}
"""Golden sets by name: both pressures and the position; position and oil temperature, with the history of motion; the
first again, with the offset of the sensors' zeros learned."""
TRAJECTORIES = {name: read_trajectories(folder) for name, folder in MODELS.items()}
RUNTIMES = {runtime.name: runtime for runtime in all_runtimes()}
Opened = Callable[[str, str], Stream]


@pytest.fixture(scope="module")
def models() -> dict[str, StepModel]:
    return {name: load_estimator(folder / MODEL_FOLDER).step_model() for name, folder in MODELS.items()}


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    """One folder per runtime and model, so that what it builds is built once."""
    return {(name, model): tmp_path_factory.mktemp(name) for name in RUNTIMES for model in MODELS}


@pytest.fixture
def opened(models: dict[str, StepModel], folders: dict[tuple[str, str], Path]) -> Iterator[Opened]:
    streams: list[Stream] = []

    def open_one(name: str, model: str) -> Stream:
        streams.append(RUNTIMES[name].open(models[model], folders[name, model]))
        return streams[-1]

    yield open_one
    for stream in streams:
        getattr(stream, "close", lambda: None)()


def assert_meets(
    name: str, model: str, newtons: np.ndarray, flags: np.ndarray, expected: np.ndarray, expected_flags: np.ndarray
) -> None:
    np.testing.assert_array_equal(flags, expected_flags)
    differences = np.abs(newtons - expected)
    rare = differences.max(axis=1) > TOLERANCES_N[name]
    assert differences.max() <= RARELY_N.get((name, model), TOLERANCES_N[name])
    assert rare.mean() <= 0.05


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_it_meets_the_golden_trajectories(name: str, model: str, opened: Opened) -> None:
    for golden in TRAJECTORIES[model].values():
        newtons, flags = run(opened(name, model), golden.samples)
        assert_meets(name, model, newtons, flags, golden.newtons, golden.flags)


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_reset_is_exact(name: str, model: str, opened: Opened) -> None:
    samples = TRAJECTORIES[model]["bad_samples"].samples[:700]
    stream = opened(name, model)
    first, first_flags = run(stream, samples)
    stream.reset()
    again, again_flags = run(stream, samples)
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(again_flags, first_flags)


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_two_streams_do_not_touch_each_other(name: str, model: str, opened: Opened) -> None:
    samples = TRAJECTORIES[model]["stick_slip_reversals"].samples[:300]
    alone, _ = run(opened(name, model), samples)
    one, other = opened(name, model), opened(name, model)
    beside = []
    for sample in samples:
        beside.append(one.step(*sample)[:3])
        other.step(*(0.5 * sample))
    np.testing.assert_array_equal(beside, alone)


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_warm_up_is_a_reset_and_then_steps_on_one_sample(
    name: str, model: str, models: dict[str, StepModel], opened: Opened
) -> None:
    samples = TRAJECTORIES[model]["stick_slip_reversals"].samples[:200]
    steps = models[model].guard.warm_up_samples
    expected = trace(models[model], np.concatenate([np.tile(samples[0], (steps, 1)), samples]))
    stream = opened(name, model)
    run(stream, samples[100:150])
    stream.warm_up(*samples[0], steps=steps)
    newtons, flags = run(stream, samples)
    assert not np.any(flags & Flag.WARMING)
    assert_meets(name, model, newtons, flags, expected.newtons[steps:], expected.flags[steps:])


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_before_the_first_valid_sample_it_is_not_ready_and_remembers_nothing(
    name: str, model: str, models: dict[str, StepModel], opened: Opened
) -> None:
    samples = TRAJECTORIES[model]["stick_slip_reversals"].samples[:50]
    inputs = models[model].inputs
    early = np.tile(samples[:1], (len(inputs), 1))
    early[range(len(inputs)), range(len(inputs))] = [np.nan, np.inf, 1e6][: len(inputs)]
    newtons, flags = run(opened(name, model), np.concatenate([early, samples]))
    np.testing.assert_array_equal(newtons[: len(inputs)], 0.0)
    assert list(flags[: len(inputs)]) == [Flag.NOT_READY | invalid_flag(column) for column in inputs]
    fresh, fresh_flags = run(opened(name, model), samples)
    np.testing.assert_array_equal(newtons[len(inputs) :], fresh)
    np.testing.assert_array_equal(flags[len(inputs) :], fresh_flags)


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("name", sorted(RUNTIMES))
def test_whatever_comes_it_meets_python(name: str, model: str, models: dict[str, StepModel], opened: Opened) -> None:
    generator = np.random.default_rng(0)
    samples = TRAJECTORIES[model]["stick_slip_reversals"].samples[:1800].copy()
    bad = generator.random(samples.shape) < 0.1
    samples[bad] = generator.choice([np.nan, np.inf, -np.inf, 1e300, -1e12, 5e-324, 0.0], int(bad.sum()))
    expected = trace(models[model], samples)
    newtons, flags = run(opened(name, model), samples)
    assert np.isfinite(newtons).all()
    assert_meets(name, model, newtons, flags, expected.newtons, expected.flags)


def test_every_runtime_has_its_place_in_the_table() -> None:
    assert set(RUNTIMES) <= set(TOLERANCES_N)

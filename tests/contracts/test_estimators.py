"""One suite that every estimator passes: causal, stream equals estimate, exact reset, save and load, NaN refused."""

from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cylinder_friction.estimators.base import FrictionEstimator, NotFittedError
from cylinder_friction.estimators.forest_alone import ForestEstimator
from cylinder_friction.estimators.hybrid import ForestPlan, HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from friction_benchmark.registry.model import RegisteredModel

PLAN = TrainingPlan(epochs=1, patience=1, sequence_length=200, burn_in=20, batch_size=4)
FOREST = ForestPlan(trees=4, depth=4, rows=2000, leaf=5)

MAKERS: dict[str, Callable[[Cylinder], FrictionEstimator]] = {
    "force_balance_unfiltered": lambda cylinder: ForceBalanceEstimator(cylinder, "none"),
    "force_balance_paper": lambda cylinder: ForceBalanceEstimator(cylinder, "paper"),
    "force_balance_low_pass": LowPassForceBalanceEstimator,
    "ridge": lambda cylinder: RidgeEstimator(lags=8),
    "random_forest": lambda cylinder: ForestEstimator(cylinder, FOREST),
    "lugre": lambda cylinder: LugreEstimator(cylinder, condition="1", population=4, generations=2),
    "pressure_lugre": lambda cylinder: PressureLugreEstimator(cylinder, condition="1", population=4, generations=2),
    "hybrid": lambda cylinder: HybridEstimator(cylinder, "force_balance", Architecture(1, 8, 0.0, 3e-3), PLAN, FOREST),
    "lstm": lambda cylinder: HybridEstimator(cylinder, "force_balance", Architecture(2, 8, 0.1, 3e-3), PLAN),
    "paper_hybrid": lambda cylinder: HybridEstimator(cylinder, "paper", Architecture(3, 8, 0.3, 1e-3), PLAN, FOREST),
}

EFFORT = 0.02


def made(entry: RegisteredModel, cylinder: Cylinder, inputs: tuple[str, ...] = SAMPLE_COLUMNS) -> FrictionEstimator:
    return entry.build(BuildConfiguration(cylinder, inputs, 0, EFFORT, entry.defaults))


MAKERS |= {
    f"benchmark_{entry.name}": partial(made, entry)
    for entry in registered_models().values()
    if entry.supports(SAMPLE_COLUMNS)
}


@pytest.fixture(scope="module", params=sorted(MAKERS))
def estimator(
    request: pytest.FixtureRequest, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> FrictionEstimator:
    made = MAKERS[request.param](cylinder)
    assert made.fit(labelled_recordings) is made
    return made


@pytest.fixture
def recording(labelled_recordings: list[Recording]) -> Recording:
    return labelled_recordings[0]


def shortened(recording: Recording, rows: int) -> Recording:
    return Recording(recording.metadata, recording.table.iloc[:rows].reset_index(drop=True))


def streamed(estimator: FrictionEstimator, recording: Recording) -> np.ndarray:
    stream = estimator.stream()
    return np.array([stream.step(*sample) for sample in recording.samples(estimator.inputs)])


def test_it_gives_one_finite_newton_value_a_sample(estimator: FrictionEstimator, recording: Recording) -> None:
    estimate = estimator.estimate(recording)
    assert estimate.shape == (len(recording),)
    assert np.isfinite(estimate).all()
    assert np.abs(estimate).max() < 1e4


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(min_value=1, max_value=599), seed=st.integers(min_value=0, max_value=99))
def test_changing_the_future_never_changes_the_past(
    estimator: FrictionEstimator, recording: Recording, cut: int, seed: int
) -> None:
    short = shortened(recording, 600)
    table = short.table.copy()
    noise = np.random.default_rng(seed).normal(size=(600 - cut, 3)) * [1e6, 1e6, 1e-2]
    table.loc[cut:, list(SAMPLE_COLUMNS)] += noise
    changed = estimator.estimate(Recording(short.metadata, table))
    np.testing.assert_array_equal(changed[:cut], estimator.estimate(short)[:cut])


def test_stream_equals_estimate_bit_for_bit(estimator: FrictionEstimator, recording: Recording) -> None:
    short = shortened(recording, 500)
    np.testing.assert_array_equal(streamed(estimator, short), estimator.estimate(short))


@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cuts=st.lists(st.integers(min_value=0, max_value=400), max_size=4))
def test_cutting_the_input_into_pieces_changes_nothing(
    estimator: FrictionEstimator, recording: Recording, cuts: list[int]
) -> None:
    short = shortened(recording, 400)
    state = estimator.new_state()
    edges = [0, *sorted(cuts), 400]
    pieces = [
        estimator.advance(state, short.samples(estimator.inputs)[start:end])
        for start, end in itertools.pairwise(edges)
        if end > start
    ]
    np.testing.assert_array_equal(np.concatenate(pieces), estimator.estimate(short))


def test_reset_is_exact(estimator: FrictionEstimator, recording: Recording) -> None:
    stream = estimator.stream()
    first = [stream.step(*sample) for sample in recording.samples(estimator.inputs)[:300]]
    stream.reset()
    assert [stream.step(*sample) for sample in recording.samples(estimator.inputs)[:300]] == first


def test_two_streams_do_not_touch_each_other(estimator: FrictionEstimator, recording: Recording) -> None:
    alone = streamed(estimator, shortened(recording, 200))
    one, other = estimator.stream(), estimator.stream()
    beside = []
    for sample in recording.samples(estimator.inputs)[:200]:
        beside.append(one.step(*sample))
        other.step(*(sample * 0.5))
    np.testing.assert_array_equal(beside, alone)


def test_save_and_load_round_trip(estimator: FrictionEstimator, recording: Recording, tmp_path: Path) -> None:
    estimator.save(tmp_path / "model")
    loaded = load_estimator(tmp_path / "model")
    np.testing.assert_array_equal(loaded.estimate(recording), estimator.estimate(recording))
    assert loaded.multiply_adds() == estimator.multiply_adds() > 0
    assert loaded.training_range == estimator.training_range
    assert {path.suffix for path in (tmp_path / "model").iterdir()} <= {".json", ".onnx"}


def test_saving_twice_writes_the_same_bytes(estimator: FrictionEstimator, tmp_path: Path) -> None:
    for folder in ("first", "second"):
        estimator.save(tmp_path / folder)
    for file in (tmp_path / "first").iterdir():
        assert file.read_bytes() == (tmp_path / "second" / file.name).read_bytes()


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_nan_is_refused_by_name_and_leaves_the_stream_as_it_was(
    estimator: FrictionEstimator, recording: Recording, value: float
) -> None:
    stream, untouched = estimator.stream(), estimator.stream()
    sample = recording.samples(estimator.inputs)[0].copy()
    stream.step(*sample)
    untouched.step(*sample)
    for column, name in enumerate(estimator.inputs):
        bad = sample.copy()
        bad[column] = value
        with pytest.raises(RecordingError, match=f"stream: {name} is {value} at row 0"):
            stream.step(*bad)
        assert stream.step(*sample) == untouched.step(*sample)


def test_another_sample_time_is_refused(estimator: FrictionEstimator, recording: Recording) -> None:
    from dataclasses import replace

    faster = replace(recording, metadata=replace(recording.metadata, sample_time_s=0.001))
    with pytest.raises(RecordingError, match=r"sample time is 0\.001 s, but this estimator was trained at 0\.005 s"):
        estimator.estimate(faster)


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_an_unfitted_estimator_says_so(name: str, cylinder: Cylinder, recording: Recording) -> None:
    with pytest.raises(NotFittedError, match="not fitted yet; call fit or load first"):
        MAKERS[name](cylinder).estimate(recording)


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_fitting_on_nothing_is_refused(name: str, cylinder: Cylinder) -> None:
    with pytest.raises(RecordingError, match="nothing to fit on, got no recording"):
        MAKERS[name](cylinder).fit([])

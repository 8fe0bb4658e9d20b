"""The measurement: which runtimes, how many steps, what is kept of the process. Never how fast."""

import gc
import os
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.deployment.latency.measuring import Effort, Measured, latency_of, measure
from cylinder_friction.deployment.latency.runtimes import CompiledRuntime, PythonRuntime, Runtime
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from deployment.latency.conftest import STEPS

COMPILED = {"c", "c_o2", "c_float"}


def test_every_runtime_takes_every_step_and_estimates_the_same(measured: Measured) -> None:
    assert set(measured.models["small"].runtimes) == COMPILED | {"onnx_step", "python"}
    assert set(measured.models["lugre"].runtimes) == COMPILED | {"python"}
    for model in measured.models.values():
        for figures in model.runtimes.values():
            assert figures.latency.steps == STEPS
            assert figures.largest_difference_n < 0.5
            assert 0.0 <= figures.latency.p50_us <= figures.latency.p99_us <= figures.latency.maximum_us


def test_one_that_learns_the_sensors_offset_takes_it_off_in_every_runtime(
    learning_hybrid: HybridEstimator, offset_samples: np.ndarray
) -> None:
    measured = measure({"learner": learning_hybrid}, {"learner": offset_samples[1000:1400]}, Effort(steps=4, rounds=2))
    model = measured.models["learner"]
    assert model.size.endswith("LSTM, 4 trees of depth 5, learning the sensors' offset")
    assert max(figures.largest_difference_n for figures in model.runtimes.values()) < 0.5


def test_the_process_is_left_as_it_was(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    before = (os.sched_getaffinity(0), gc.isenabled())
    measure({"small": hybrid}, {"small": samples}, Effort(steps=4, rounds=2))
    assert (os.sched_getaffinity(0), gc.isenabled()) == before


def test_peers_are_measured_beside_the_runtimes(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    def peers(
        estimator: FrictionEstimator, compiled: CompiledRuntime, rows: np.ndarray, folder: Path
    ) -> tuple[Runtime, ...]:
        assert (estimator, compiled.name, len(rows)) == (hybrid, "c", len(samples))
        assert folder.is_dir()
        return (
            PythonRuntime("zero", "nothing", lambda *sample: 0.0),
            PythonRuntime("one", "other", lambda *sample: sample[0], "other"),
        )

    measured = measure({"small": hybrid}, {"small": samples}, Effort(steps=4, rounds=2), peers)
    runtimes = measured.models["small"].runtimes
    assert list(runtimes)[:2] == ["zero", "one"]
    assert runtimes["zero"].largest_difference_n > 1.0, "runtimes of one group are compared"
    assert runtimes["one"].largest_difference_n == 0.0, "the first of another group is what the rest is compared with"


def test_slow_ones_take_fewer_steps() -> None:
    effort = Effort(steps=1000, rounds=10, seconds=1.0)
    assert effort.steps_per_round(1e3) == 100
    assert effort.steps_per_round(1e7) == 10
    assert effort.steps_per_round(1e12) == 1


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"rounds": 0}, {"seconds": 0.0}])
def test_no_effort_is_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="expected at least one step"):
        Effort(**wrong)


def test_too_few_samples_are_refused(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected at least 200 samples, but got 10"):
        measure({"small": hybrid}, {"small": samples[:10]}, Effort())


def test_every_figure_is_one_of_the_measured_times() -> None:
    times = np.random.default_rng(0).permutation(np.arange(1, 10_001)) * 1000
    latency = latency_of(times, np.array([7000, 9000, 50_000]), timer_ns=0.0, preempted=3)
    assert (latency.p50_us, latency.p99_us, latency.p999_us, latency.maximum_us) == (5000.0, 9900.0, 9990.0, 10_000.0)
    assert (latency.steps, latency.first_us, latency.preempted) == (10_000, 9.0, 3)


def test_the_clocks_own_time_is_taken_off_and_never_leaves_less_than_nothing() -> None:
    latency = latency_of(np.array([10, 40, 1040]), np.array([540]), timer_ns=40.0)
    assert (latency.p50_us, latency.maximum_us, latency.first_us) == (0.0, 1.0, 0.5)


@pytest.mark.parametrize(("steps", "first"), [(0, 1), (1, 0)])
def test_nothing_measured_is_refused(steps: int, first: int) -> None:
    with pytest.raises(ValueError, match=f"expected at least one timed step, but got {steps} and {first} first ones"):
        latency_of(np.zeros(steps, dtype=np.int64), np.zeros(first, dtype=np.int64), 0.0)

"""The measurement: which runtimes, how many steps, what is kept of the process. Never how fast."""

import gc
import json
import os
from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.deployment.latency.machine import Quiet
from cylinder_friction.deployment.latency.measuring import Effort, Measured, latency_of, measure
from cylinder_friction.deployment.latency.report import as_dict, metrics_of, table
from cylinder_friction.deployment.latency.runtimes import PythonRuntime, Runtime
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from deployment.latency.conftest import STEPS

COMPILED = {"c", "c_o2", "c_float"}


def test_every_runtime_takes_every_step_and_estimates_the_same(measured: Measured) -> None:
    assert set(measured.models["small"].runtimes) == COMPILED | {"onnx_step", "python"}
    assert set(measured.models["lugre"].runtimes) == COMPILED | {"python"}
    for model in measured.models.values():
        for figures in model.runtimes.values():
            assert figures.steps == STEPS
            assert figures.largest_difference_n < 0.5
            assert 0.0 <= figures.p50_us <= figures.p99_us <= figures.maximum_us


def test_text_json_and_metrics_have_every_model_and_runtime_and_say_how_quiet_the_machine_was(
    measured: Measured,
) -> None:
    content = json.loads(json.dumps(as_dict(measured), allow_nan=False))
    assert content["models"]["small"]["runtimes"]["c"]["ratio_to_c"] in (0.0, 1.0)
    assert content["machine"]["processor"]
    assert {"small.c.p999_us", "small.onnx_step.ratio_to_c", "lugre.python.p50_us"} <= set(metrics_of(measured))
    busy, quiet = (table(replace(measured, quiet=Quiet(share, 0.5, 1.0))) for share in (0.3, 0.0))
    assert "a BUSY machine" in busy
    assert "others had 0.0 % of that core" in quiet
    for model in measured.models.values():
        assert all(figures.title in quiet for figures in model.runtimes.values())


def test_the_process_is_left_as_it_was(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    before = (os.sched_getaffinity(0), gc.isenabled())
    measure({"small": hybrid}, {"small": samples}, Effort(steps=4, rounds=2))
    assert (os.sched_getaffinity(0), gc.isenabled()) == before


def test_peers_are_measured_beside_the_runtimes(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    def peers(estimator: FrictionEstimator) -> tuple[Runtime, ...]:
        assert estimator is hybrid
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


def test_no_effort_and_too_few_samples_are_refused(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected at least one step"):
        Effort(steps=0)
    with pytest.raises(ValueError, match="expected at least 200 samples, but got 10"):
        measure({"small": hybrid}, {"small": samples[:10]}, Effort())


def test_every_figure_is_one_of_the_measured_times() -> None:
    times = np.random.default_rng(0).permutation(np.arange(1, 10_001)) * 1000
    latency = latency_of(times, np.array([7000, 9000, 50_000]), timer_ns=0.0, preempted=3)
    assert (latency.p50_us, latency.p99_us, latency.p999_us, latency.maximum_us) == (5000.0, 9900.0, 9990.0, 10_000.0)
    assert (latency.steps, latency.first_us, latency.preempted) == (10_000, 9.0, 3)
    # the clock's own time is taken off, and never leaves less than nothing
    latency = latency_of(np.array([10, 40, 1040]), np.array([540]), timer_ns=40.0)
    assert (latency.p50_us, latency.maximum_us, latency.first_us) == (0.0, 1.0, 0.5)

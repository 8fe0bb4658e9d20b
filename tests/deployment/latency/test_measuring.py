"""The harness: who runs, how often, what is written. Never how fast."""

from __future__ import annotations

import gc
import json
import os
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from cylinder_friction.deployment.latency.floor import FloorKernels, Work, work_of
from cylinder_friction.deployment.latency.instructions import instructions_per_step
from cylinder_friction.deployment.latency.line_up import line_up
from cylinder_friction.deployment.latency.machine import Quiet
from cylinder_friction.deployment.latency.measuring import Effort, Measured, measure
from cylinder_friction.deployment.latency.report import as_dict, metrics_of, table
from cylinder_friction.deployment.latency.spin import Spin
from cylinder_friction.deployment.latency.verdicts import verdicts_on
from cylinder_friction.estimators.linear import RidgeEstimator

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.estimators.lugre import LugreEstimator
    from cylinder_friction.realtime.model import StepModel

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
STEPS = 50
LEARNED = {"torch_window", "onnx_window", "onnx_step", "python", "c", "c_o2", "c_float", "spin"}


@pytest.fixture(scope="module")
def measured(hybrid: HybridEstimator, lugre: LugreEstimator, samples: np.ndarray) -> Measured:
    return measure({"small": hybrid, "lugre": lugre}, samples, Effort(steps=STEPS, rounds=5, seconds=60.0))


def test_everybody_takes_every_step_and_estimates_the_same(measured: Measured) -> None:
    assert set(measured.models["small"].contenders) == LEARNED
    assert set(measured.models["lugre"].contenders) == {"numpy", "c", "c_o2", "c_float", "spin"}
    for model in measured.models.values():
        for figures in model.contenders.values():
            assert figures.latency.steps == STEPS
            assert figures.largest_difference_n < 0.5
            assert 0.0 <= figures.latency.p50_us <= figures.latency.p99_us <= figures.latency.maximum_us


def test_the_process_is_left_as_it_was(hybrid: HybridEstimator, samples: np.ndarray) -> None:
    before = (os.sched_getaffinity(0), torch.get_num_threads(), gc.isenabled())
    measure({"small": hybrid}, samples, Effort(steps=4, rounds=2))
    assert (os.sched_getaffinity(0), torch.get_num_threads(), gc.isenabled()) == before


def test_json_says_what_was_measured_where_and_how(measured: Measured) -> None:
    content = json.loads(json.dumps(as_dict(measured), allow_nan=False))
    assert content["models"]["small"]["contenders"]["c"]["ratio_to_c"] in (0.0, 1.0)
    assert set(content["models"]["small"]["contenders"]) == LEARNED
    assert content["models"]["small"]["floor"]["bandwidth_us"] > 0.0
    assert content["models"]["lugre"]["floor"] is None
    assert "-march=native" in content["options"]["c"]
    assert content["options"]["c_o2"][0] == "-O2"
    assert content["machine"]["processor"]
    assert content["effort"]["steps"] == STEPS
    assert {"core_share", "is_quiet"} <= set(content["quiet"])


def test_metrics_are_finite_numbers_by_model_and_contender(measured: Measured) -> None:
    metrics = metrics_of(measured)
    assert {"small.c.p999_us", "small.onnx_step.ratio_to_c", "lugre.numpy.p50_us"} <= set(metrics)
    assert np.isfinite(list(metrics.values())).all()


def test_the_table_names_everybody(measured: Measured) -> None:
    text = table(measured)
    for model in measured.models.values():
        assert all(figures.title in text for figures in model.contenders.values())
    assert "floor, bandwidth" in text


@pytest.mark.parametrize(("share", "word"), [(0.3, "a BUSY machine"), (0.0, "others had 0.0 % of that core")])
def test_a_busy_machine_is_said_to_be_busy(measured: Measured, share: float, word: str) -> None:
    text = table(replace(measured, quiet=Quiet(share, 0.5, 1.0)))
    assert word in text
    assert ("BUSY" in text) == (share > 0.02)


def with_p50(measured: Measured, model: str, times: dict[str, float], published: bool) -> Measured:
    """The run with other medians; p99.9 of each ten times its median."""
    old = measured.models[model]
    contenders = dict(old.contenders)
    for name, p50_us in times.items():
        latency = replace(contenders[name].latency, p50_us=p50_us, p999_us=10.0 * p50_us)
        contenders[name] = replace(contenders[name], latency=latency)
    changed = replace(old, contenders=contenders, published=published)
    return replace(measured, models={**measured.models, model: changed})


def test_verdicts_on_the_papers_size(measured: Measured) -> None:
    floor = measured.models["small"].floor
    assert floor is not None
    own_us = 3.0 * floor.bandwidth_us
    times = {"c": own_us, "torch_window": 200.0 * own_us, "onnx_step": 3.0 * own_us}
    verdicts = verdicts_on(with_p50(measured, "small", times, published=True))
    assert [(verdict.limit, verdict.met) for verdict in verdicts] == [
        (100.0, True),
        (600.0, False),
        (4.0, False),
        (5.0, False),
        (4.0, True),
    ]
    assert [verdict.measured for verdict in verdicts] == pytest.approx([200.0, 200.0, 3.0, 10.0, 3.0])
    assert verdicts[1].line().startswith("MISSED  small: C at least 600 times faster than PyTorch + scikit-learn")


@pytest.mark.parametrize(("ratio", "met"), [(9.9, True), (10.1, False)])
def test_verdict_on_any_other_size(measured: Measured, ratio: float, met: bool) -> None:
    run = with_p50(with_p50(measured, "lugre", {"c": 0.1}, False), "small", {"c": 0.1 * ratio}, False)
    (verdict,) = verdicts_on(run)
    assert verdict.met == met
    assert verdict.measured == pytest.approx(ratio)


class Steady:
    """Takes as long as it says."""

    name, title, family, timer_ns = "steady", "steady", "step", 0.0

    def __init__(self, step_ns: int) -> None:
        self.step_ns = step_ns

    def run(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(samples)), np.full(len(samples), self.step_ns)


def test_the_machines_own_tail_is_measured_on_steps_of_the_length_asked_for(
    samples: np.ndarray, tmp_path: Path
) -> None:
    folders = [tmp_path / "short", tmp_path / "long"]
    for folder in folders:
        folder.mkdir()
    short, long = (
        Spin(Steady(step_ns), samples, folder) for step_ns, folder in zip((1_000, 100_000), folders, strict=True)
    )
    friction, times = long.run(samples)
    assert len(times) == len(friction) == len(samples)
    assert long._links > 20 * short._links > 0


def test_work_counts_every_weight_once(model: StepModel) -> None:
    work = work_of(model)
    assert model.network is not None
    assert model.forest is not None
    network = model.network
    weights = network.recurrent.size + network.bias.size + network.head.size + 1
    weights += 4 * network.nodes * (network.inputs + (network.layers - 1) * network.nodes)
    assert work.network_bytes == 4 * weights
    assert work.forest_bytes == 8 * len(model.forest.roots) * (model.forest.depth + 1)
    assert work.multiply_adds > network.multiply_adds()


def test_the_floor_is_bytes_over_bandwidth_and_multiply_adds_over_their_peak(tmp_path: Path) -> None:
    floor = FloorKernels(tmp_path).floor(Work(40_000, 1000, 96, 20_000))
    assert floor.bandwidth_us == pytest.approx(1e6 * 41_096 / floor.bytes_per_s)
    assert floor.arithmetic_us == pytest.approx(1e6 * 20_000 / floor.multiply_adds_per_s)
    assert min(floor.bandwidth_us, floor.arithmetic_us) > 0.0


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="there is no Valgrind")
@pytest.mark.slow
def test_instructions_are_counted_and_repeat(hybrid: HybridEstimator, samples: np.ndarray, tmp_path: Path) -> None:
    exported = line_up(hybrid, samples, tmp_path).exported
    counted = instructions_per_step(exported, samples)
    assert counted is not None
    assert counted > 1000.0
    assert instructions_per_step(exported, samples) == counted
    assert instructions_per_step(exported, samples[:10]) is None


def test_slow_ones_take_fewer_steps() -> None:
    effort = Effort(steps=1000, rounds=10, seconds=1.0)
    assert effort.steps_a_round(1e3) == 100
    assert effort.steps_a_round(1e7) == 10
    assert effort.steps_a_round(1e12) == 1


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"rounds": 0}, {"seconds": 0.0}])
def test_no_effort_is_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="expected at least one step"):
        Effort(**wrong)


def test_too_few_samples_and_other_kinds_are_refused(
    hybrid: HybridEstimator, samples: np.ndarray, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match="expected at least 200 samples, but got 10"):
        measure({"small": hybrid}, samples[:10], Effort())
    with pytest.raises(ValueError, match="ridge: cannot be measured here; expected a hybrid or LuGre"):
        line_up(RidgeEstimator(), samples, tmp_path)

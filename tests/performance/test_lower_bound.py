"""The lower bound counts every weight once, and instructions repeat. Never how fast."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest
from lower_bound import LowerBoundKernels, Work, instructions_per_step, work_of

from cylinder_friction.deployment.c_export.export import export_c

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.realtime.model import StepModel


def test_work_counts_every_weight_once(golden_model: StepModel) -> None:
    work = work_of(golden_model)
    assert golden_model.network is not None
    assert golden_model.forest is not None
    network = golden_model.network
    weights = network.recurrent.size + network.bias.size + network.head.size + 1
    weights += 4 * network.nodes * (network.inputs + (network.layers - 1) * network.nodes)
    assert work.network_bytes == 4 * weights
    assert work.forest_bytes == 8 * len(golden_model.forest.roots) * (golden_model.forest.depth + 1)
    assert work.multiply_adds > network.multiply_adds()


def test_the_lower_bound_is_bytes_over_bandwidth_and_multiply_adds_over_their_peak(tmp_path: Path) -> None:
    bound = LowerBoundKernels(tmp_path).measure(Work(40_000, 1000, 96, 20_000))
    assert bound.bandwidth_us == pytest.approx(1e6 * 41_096 / bound.bytes_per_s)
    assert bound.arithmetic_us == pytest.approx(1e6 * 20_000 / bound.multiply_adds_per_s)
    assert min(bound.bandwidth_us, bound.arithmetic_us) > 0.0


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="there is no Valgrind")
@pytest.mark.slow
def test_instructions_are_counted_and_repeat(hybrid: HybridEstimator, samples: np.ndarray, tmp_path: Path) -> None:
    exported = export_c(hybrid, tmp_path)
    counted = instructions_per_step(exported, samples)
    assert counted is not None
    assert counted > 1000.0
    assert instructions_per_step(exported, samples) == counted
    assert instructions_per_step(exported, samples[:10]) is None

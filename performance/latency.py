"""The cost of one step on one core, in every runtime and beside peers, with the lower bound of the core and the claims.

Usage: python performance/latency.py [model folder ...]

It prints, and leaves nothing behind; `cylinder-friction latency` measures the runtimes alone, and keeps the figures.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")

import numpy as np
import torch
from latency_peers import peers_of
from lower_bound import LowerBoundKernels, instructions_per_step, work_of

from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.deployment.latency.machine import one_core
from cylinder_friction.deployment.latency.measuring import Effort, measure
from cylinder_friction.deployment.latency.report import circumstances, model_table
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.recordings.storage import read_recordings

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from lower_bound import LowerBound

    from cylinder_friction.deployment.latency.measuring import Measured, ModelFigures
    from cylinder_friction.estimators.base import FrictionEstimator

FOLDERS = ("models/hybrid", "models/paper_hybrid", "models/lugre/lugre")
PUBLISHED = "4x64 LSTM, 64 trees of depth 10"
LEAST_RATIOS = (("torch_window", 100.0), ("torch_window", 600.0), ("onnx_step", 4.0))
TAIL_RATIO = 5.0
BOUND_RATIO = 4.0
LUGRE_RATIO = 10.0


@dataclass(frozen=True)
class Claim:
    """A claim in words, its limit, the measured value, and whether it holds."""

    what: str
    limit: float
    measured: float
    met: bool

    def line(self) -> str:
        return f"{'met   ' if self.met else 'MISSED'}  {self.what}: {self.measured:.3g}"


def main() -> None:
    """Print one table per model with its lower bound and instructions, then the claims."""
    torch.set_num_threads(1)
    estimators = {folder: load_estimator(Path(folder)) for folder in sys.argv[1:] or FOLDERS}
    recordings = read_recordings(Path("data/processed/test"))[:4]
    samples = {
        folder: np.concatenate([recording.samples(estimator.inputs) for recording in recordings])
        for folder, estimator in estimators.items()
    }
    measured = measure(estimators, samples, Effort(), peers_of)
    bounds = lower_bounds(estimators)
    for name, model in measured.models.items():
        print(model_table(name, model))
        if name in bounds:
            print(bound_lines(bounds[name]))
        with TemporaryDirectory() as folder:
            instructions = instructions_per_step(export_c(estimators[name], Path(folder)), samples[name])
        if instructions is not None:
            print(f"{instructions:.0f} instructions per step of the C (-O3, 256 bit wide)")
        print()
    print("\n".join(claim.line() for claim in claims_on(measured, bounds)))
    print(f"\n{circumstances(measured)}")


def lower_bounds(estimators: Mapping[str, FrictionEstimator]) -> dict[str, LowerBound]:
    """Return the lower bound of each estimator that is made of filters, network and forest."""
    with TemporaryDirectory() as folder, one_core():
        kernels = LowerBoundKernels(Path(folder))
        return {
            name: kernels.measure(work_of(estimator.step_model()))
            for name, estimator in estimators.items()
            if not isinstance(estimator, LugreEstimator)
        }


def bound_lines(bound: LowerBound) -> str:
    """Return the lower bound in two lines."""
    work = bound.work
    return (
        f"lower bound, bandwidth:  {bound.bandwidth_us:8.3f} µs = {work.bytes} bytes at "
        f"{1e-9 * bound.bytes_per_s:.1f} GB/s "
        f"(network {work.network_bytes}, forest {work.forest_bytes}, filters {work.filter_bytes})\n"
        f"lower bound, arithmetic: {bound.arithmetic_us:8.3f} µs = {work.multiply_adds} multiply-adds at "
        f"{1e-9 * bound.multiply_adds_per_s:.1f} G/s"
    )


def claims_on(measured: Measured, bounds: Mapping[str, LowerBound]) -> list[Claim]:
    """Return the claims on models of the paper's size, and on every other model beside the first LuGre."""
    lugre = next((model for name, model in measured.models.items() if name not in bounds), None)
    result: list[Claim] = []
    for name, model in measured.models.items():
        if model.size == PUBLISHED:
            result += _published(name, model, bounds[name])
        elif name in bounds and lugre is not None:
            ratio = _p50(model, "c") / _p50(lugre, "c")
            what = f"{name}: C below {LUGRE_RATIO:g} times the time of LuGre in C"
            result.append(Claim(what, LUGRE_RATIO, ratio, ratio < LUGRE_RATIO))
    return result


def _published(name: str, model: ModelFigures, bound: LowerBound) -> Iterator[Claim]:
    own = model.runtimes["c"].latency
    for other, least in LEAST_RATIOS:
        ratio = _p50(model, other) / own.p50_us
        what = f"{name}: C at least {least:g} times faster than {model.runtimes[other].title}"
        yield Claim(what, least, ratio, ratio >= least)
    tail = own.p999_us / own.p50_us
    machine = model.runtimes["tail"].latency
    machine_ratio = machine.p999_us / machine.p50_us
    what = f"{name}: p99.9 of C below {TAIL_RATIO:g} times its p50 (arithmetic alone: {machine_ratio:.3g})"
    yield Claim(what, TAIL_RATIO, tail, tail < TAIL_RATIO)
    ratio = own.p50_us / bound.bandwidth_us
    what = f"{name}: C within {BOUND_RATIO:g} times the lower bound by bandwidth"
    yield Claim(what, BOUND_RATIO, ratio, ratio <= BOUND_RATIO)


def _p50(model: ModelFigures, runtime: str) -> float:
    return model.runtimes[runtime].latency.p50_us


if __name__ == "__main__":
    main()
